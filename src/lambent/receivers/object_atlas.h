#pragma once
// A lightmap's atlas taken apart: an atlas for each object, for engines that keep a picture an object.
#include <lambent/receivers/receivers.h>

#include <string>
#include <vector>

namespace lambent {

// All parts of one node of the input, or one part that has none.
struct ObjectAtlas {
  std::string name;  // the first part's; a second object of that name "NAME_2"
  std::vector<uint32_t> parts;
  int width = 0, height = 0;     // in texels
  std::vector<uint32_t> source;  // the whole atlas's texel that each one is a copy of; `none` between charts
};

// Charts move by whole texels, with two free ones around what bilinear look-ups reach, so that a look-up finds the very
// values that it found in the whole atlas. Places in `texels` change: divided by the WHOLE atlas's size they are
// coordinates in [0, 1]^2 of the object's own. Objects without a place have no texels.
std::vector<ObjectAtlas> split_atlas(const Scene& scene, TexelReceivers& texels);

// Values over the whole atlas, at an object's texels; T() between charts.
template <class T>
std::vector<T> values_of(const ObjectAtlas& object, const std::vector<T>& whole) {
  std::vector<T> out(object.source.size());
  for (size_t i = 0; i < out.size(); ++i)
    if (object.source[i] != none) out[i] = whole[object.source[i]];
  return out;
}

}  // namespace lambent

#pragma once
// glTF animations: what they do to nodes at a time. Pointers to anything but nodes' transforms and weights are left
// alone.
#include <lambent/scene/gltf_read.h>

namespace lambent {

struct GltfAnimation {
  std::string name;         // "" where the document has none
  double from = 0, to = 0;  // seconds, over all of its channels
};
// All of the document's animations. Fails at the first that is broken: missing samplers, counts that do not fit, times
// that do not grow, numbers that are not finite.
bool read_animations(GltfCheck& check, const GltfDocument& document, std::vector<GltfAnimation>& animations);

// A copy of the JSON's nodes as the animation sets them at `time`, clamped to each channel's range: LINEAR (rotations
// along the shorter great circle), STEP and CUBICSPLINE. Rotations come out of unit length, whatever is stored; zero
// ones as no rotation.
bool animate_nodes(GltfCheck& check, const GltfDocument& document, size_t animation, double time,
                   nlohmann::json& nodes);

}  // namespace lambent

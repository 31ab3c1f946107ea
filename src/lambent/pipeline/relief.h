#pragma once
// Relief from pictures of heights: for patches, and as geometry of its own.
#include <lambent/bake/patch.h>
#include <lambent/scene/scene.h>

#include <string>
#include <vector>

namespace lambent {

// A picture's values as the file has them: the curve that loading undoes in PNG and JPEG is put back.
struct HeightMap {
  int width = 0, height = 0;
  std::vector<float> values;
};
Result<HeightMap> load_height_map(const std::string& path);

// A picture as heights, white `depth` sides of the patch above black. Errors name the file.
Result<HeightField> load_heights(const std::string& path, int size, float depth);

struct Displacement {
  std::string heights;       // a picture
  std::string tile = "1,1";  // its repetitions over the unit of texture coordinates
  float depth = 0.1f;        // of white over black, in sides of one repetition
  int size = 128;            // texels a side that the picture is taken at
};
// The scene with the relief on it, repeated, about its own mean height; edges are split to the heights' texels first.
Result<void> displace_scene(Scene& scene, const Displacement& displacement);

}  // namespace lambent

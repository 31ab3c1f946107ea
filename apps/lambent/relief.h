#pragma once
// Relief from height maps: for patches, and as geometry of its own.
#include "options.h"

#include <lambent/bake/patch.h>

namespace lambent::tool {

// A picture's values as the file has them: the curve that loading undoes in PNG and JPEG is put back.
struct HeightMap {
  int width = 0, height = 0;
  std::vector<float> values;
};
Result<HeightMap> load_height_map(const std::string& path);

// A picture as heights, white `depth` sides of the patch above black. Errors name the file.
Result<HeightField> load_heights(const std::string& path, int size, float depth);

struct DisplaceOptions {
  std::string heights, tile = "1,1";
  float depth = 0.1f;
  int size = 128;
  void add_to(CLI::App& command);
};

// The scene with the relief on it, repeated, about its own mean height; edges are split to the heights' texels first.
Result<void> displace_scene(Scene& scene, const DisplaceOptions& options);

}  // namespace lambent::tool

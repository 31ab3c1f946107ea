#pragma once
// All-frequency light: `lambent bake --transfer blocks`, `lambent render` of what it made, and `lambent relight`.
#include "options.h"
#include "terminal.h"

#include <lambent/bake/visibility.h>
#include <lambent/baked/baked_file.h>

namespace lambent::tool {

struct BlocksFlags {
  int cube = 64;
  std::string visibility = "binary";  // or bits:N
  std::vector<CLI::Option*> add_to(CLI::App& command);
};
int run_blocks_bake(Context& context, const SceneOptions& scene, const BlocksFlags& flags, size_t memory,
                    const std::string& output);

// How visibility in blocks is shaded.
struct ProductFlags {
  std::string method = "blocks";  // or standard, haar, haar:FRACTION
  std::string samples = "bounded";
  float tolerance = 0.2f;
  std::string indirect = "none";
  std::vector<CLI::Option*> add_to(CLI::App& command);
};
int run_product_render(Context& context, const Baked& baked, const ProductFlags& flags, const LightOptions& light,
                       const ViewOptions& view, const BrdfOptions& brdf, int samples);

}  // namespace lambent::tool

#pragma once
// Shading visibility in blocks, frame by frame.
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/draw_light.h>
#include <lambent/relight/relighter.h>

namespace lambent {

// "blocks", "standard", "haar" or "haar:FRACTION".
struct ProductMethod {
  Product product = Product::blocks;
  double haar_fraction = 0.01;  // of coefficients, kept
};
Result<ProductMethod> parse_method(const std::string& text);

// What stays from frame to frame, and what a frame fills. `baked` must outlive it.
struct BlockShading {
  const Baked* baked = nullptr;
  Relighter relighter;
  std::vector<Vec3> albedo;            // diffuse, of each receiver
  Relit relit = {};                    // exit radiance towards the eye, of the receivers that were seen
  std::vector<uint32_t> in_view = {};  // those, of the latest view
  Breakdown breakdown = {};
  size_t seen = 0;
  double project_seconds = 0, forms_seconds = 0, cull_seconds = 0, shade_seconds = 0;
};
// By --brdf and --material.
Result<Reflection> block_reflection(const Scene& scene, const DrawRequest& request);
Result<BlockShading> make_block_shading(const Baked& baked, const DrawRequest& request);

// Warns of light that binary visibility shows steps under where `job` is given.
Result<void> set_environment(BlockShading& shading, const Environment& env, const Mat3& rotation,
                             const Job* job = nullptr);
Result<void> shade_view(BlockShading& shading, const View& view);

// Light that has bounced: what a diffuse bake with bounces has more than one without, times the diffuse albedo.
Result<void> add_indirect(BlockShading& shading, const Tracer& tracer, const Surroundings& around, const Job& job);

// Shares in percent.
nlohmann::json describe(const Breakdown& breakdown);

// draw() of such a file.
Result<Drawing> draw_blocks(const Baked& baked, const DrawRequest& request, const Job& job);

}  // namespace lambent

#pragma once
// What a drawing is asked for: the options of `lambent render`.
#include <lambent/baked/baked_file.h>
#include <lambent/light/environment.h>
#include <lambent/pipeline/options.h>
#include <lambent/pipeline/parse.h>
#include <lambent/render/render.h>

namespace lambent {

struct DrawRequest {
  std::string baked, output;
  // Light
  std::string env, env_rotate, window = "auto";
  int light_order = 0;  // bands; 0: all that there are
  std::vector<std::string> lamp, sphere_lamp, move;
  int lamp_bounces = 1;
  // View
  std::string camera = "auto", size = "512x512", background = "env";
  int spp = 64;
  std::string exposure = "auto", tone = "neutral";
  // What is shown
  std::string show = "product";
  std::string brdf;  // "": as baked; of blocks, which know none, diffuse
  std::vector<std::string> insert, albedo, place, pose, material;
  std::string at = "pixels";
  int near_rays = 8;
  // Motion
  std::string animation, frames, deform;
  double time = 0;
  int frame_bounces = 0;  // 0: as many as it takes
  int frame_leaves = 0;   // 0: all
  // Blocks
  std::string method = "blocks", brdf_samples = "bounded", indirect = "none";
  float tolerance = 0;  // 0: 0.2 of Phong's lobes, 0.02 of other models
  // Wavelets
  int terms = 0;  // of the light's; 0: all
  // Transfer textures
  std::string transfer_texture, tile = "1,1", groove_map, wrinkle;
  float groove_depth = 0, groove_width = 1;  // depth 0: the table's deepest

  // The environment itself, in place of what `env` names, which is said all the same.
  std::shared_ptr<const Environment> environment;

  GivenOptions given;  // by JSON name; what differs from its default counts as given too
};

// By what the rows mean and the store can do.
enum class DrawKind {
  diffuse,
  clusters,
  lobes,
  matrix,
  factors,
  lamps,
  blocks,
  fixed_view,
  indirect,
  wavelets,
  texture
};
inline constexpr const char* draw_kind_names[] = {
    "diffuse transfer", "clusters",         "lobes",
    "matrices",         "factors",          "lamps alone (lightmaps, fixed light)",
    "blocks",           "fixed views",      "direct to indirect light",
    "wavelets",         "transfer textures"};
std::span<const Option<DrawRequest>> draw_options();
DrawKind kind_of(const Field& surface);

// Whether an option, by its name in JSON, was said or differs from its default.
bool is_given(const DrawRequest& request, const std::string& option);

// What --show asks for: product, radiosity, albedo; emission, bounce:K, sum:K; direct, indirect.
struct Show {
  RenderOptions::Show colour = RenderOptions::Show::product;
  // All light; that of lamps that are seen and nothing else; that of one term of the Neumann series; that of lamps that
  // are seen and of the terms up to one; of direct-to-indirect transport, lamps and what they light, or the rest.
  enum class Part { all, emission, bounce, sum, direct, indirect } part = Part::all;
  int term = 0;
};
Result<Show> parse_show(const std::string& text);

// Every option that was given goes with the kind and has an effect, or is refused by name. Errors begin with the
// option.
Result<void> check_draw(const DrawRequest& request, DrawKind kind);
// And with what this file holds. Errors begin with the option, or name the file where that lacks what is asked for.
Result<void> check_draw(const DrawRequest& request, const Baked& baked);

}  // namespace lambent

#pragma once
// What a bake is asked for: the options of `lambent bake`, a JSON object, and the provenance of a baked file are this.
#include <lambent/pipeline/options.h>

namespace lambent {

struct BakeRequest {
  std::string scene, output;
  std::string transfer = "diffuse";
  int order = 0;  // bands; 0: 6, or, of a lightmap, none
  std::string light;
  std::string precision = "half";
  std::string receivers;  // "": texels for lightmaps, else vertices
  float texels_per_unit = 0;
  std::string atlas;
  // Scene
  bool ground = false;
  float max_edge = 0, max_albedo = 1;
  std::vector<std::string> emit;
  // Rays
  int samples = 1024;
  std::string bounces = "3";
  std::string shadows = "on";
  bool terms = false;
  size_t memory = size_t{4} << 30;
  uint32_t seed = 1;
  // Glossy
  std::string brdf = "materials", outgoing = "map", simulate = "recursion";
  int incident_order = 5, view_map = 64;
  bool factors = false;
  // Lobes, media, sheets
  int lobes = 4;
  std::string subsurface, membrane;
  // Lightmaps
  std::string direct = "included", directional = "none", solver = "gmres", gather = "rays", sky;
  bool light_groups = false;
  int lamp_samples = 32;
  // Blocks
  int cube = 64;
  std::string visibility = "binary";
  // Special cases and smaller files
  std::string fix_light, fix_view, size = "512x512", compress;
  int spp = 16;
  // Free space
  std::string lattice, lattice_box;
  int lattice_order = 4;

  GivenOptions given;  // by JSON name
};

enum class BakeKind { diffuse, matrix, factors, zonal, glossy_zonal, membrane, lightmap, blocks };
inline constexpr const char* bake_kind_names[] = {"diffuse transfer",
                                                  "matrix transfer",
                                                  "factors",
                                                  "zonal transfer",
                                                  "glossy lobes (zonal with --brdf or --outgoing)",
                                                  "membranes (--membrane)",
                                                  "lightmaps",
                                                  "blocks"};
std::span<const Option<BakeRequest>> bake_options();
BakeKind kind_of(const BakeRequest& request);

// Fills in what depends on the kind, and refuses by name what has no effect, what contradicts another option and what
// is out of range. Errors begin with the option.
Result<BakeRequest> resolved(BakeRequest request);

// The fields that have an effect, of files the name alone; and back. Errors name the field.
nlohmann::json to_json(const BakeRequest& request);
Result<BakeRequest> bake_request_from_json(const nlohmann::json& object);
Result<BakeRequest> load_bake_request(const std::string& path);

// The request that a baked file was made by, its inputs looked for beside it and where we are; `scene`, if not empty,
// is the scene instead. Errors: no such request in the file, a scene that is not there or is another.
Result<BakeRequest> request_of_baked_file(const std::string& path, const std::string& scene);

}  // namespace lambent

#pragma once
// What a bake is asked for, and ONE bake of it, whatever the kind: the options of `lambent bake`, a JSON object, and
// the provenance of a baked file are such a request.
#include <lambent/baked/baked_file.h>
#include <lambent/core/progress.h>

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace lambent {

// The fields are the options of `lambent bake` and their syntaxes; docs/options.md says which go with which kind.
struct BakeRequest {
  std::string scene, output;
  std::string checkpoint;  // a folder; "": beside the output, of long work; "off": none
  std::string depfile;
  std::string transfer = "diffuse";
  int order = 0;  // bands; 0: 6, or, of a lightmap, none
  std::string light;
  std::string precision = "half";
  std::string receivers;  // "": texels for lightmaps, else vertices
  std::string projection = "collocation";
  float texels_per_unit = 0;
  std::string atlas;
  // Scene
  bool ground = false;
  float max_edge = 0, max_albedo = 1;
  std::vector<std::string> emit, exclude;
  // Rays
  std::string quality = "good", error, denoise = "on", adapt = "auto";
  double time = -1;  // seconds; negative: no limit
  int samples = 0;   // 0: as many as the error asks for, or, of kinds that are not baked to an error, 1024
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
  std::string direct = "included", directional = "none", solver = "gmres", gather = "rays", sky, light_units = "auto";
  std::vector<std::string> lamp;
  bool light_groups = false;
  int lamp_samples = 32;
  // Blocks
  int cube = 64;
  std::string visibility = "binary";
  // Special cases and smaller files
  std::string fix_light, fix_view, size = "512x512", compress;
  int spp = 16;
  // Direct to indirect light
  int surfels = 0;
  std::string gatherers = "quarter";
  // Free space
  std::string lattice, lattice_box;
  int lattice_order = 4;

  // The scene itself, in place of the file that `scene` names; no field of the JSON.
  std::shared_ptr<const Scene> loaded;

  // Names (as in JSON) of fields that were said. A field that differs from its default counts as said without being
  // here.
  std::set<std::string> given;

  // Large scenes
  size_t bin_limit = size_t{1} << 30;  // bytes of each .bin of a .gltf
  std::string scratch;                 // a folder; "": the output's; "off": none
  std::string rooms;                   // "": the scene as a whole
  double rooms_error = 0.01;           // residual of the joined solution
};

// What runs beside a request and does not change its result.
struct Job {
  Progress* progress = nullptr;
  std::function<void(const std::string&)> warn = [](const std::string&) {};  // one line each
  // Called once the inputs are read, before any ray, with what is to be added to the output's stem for each picture
  // that will be written beside it. An error ends the bake.
  std::function<Result<void>(const std::vector<std::string>&)> inputs_read = [](const auto&) { return Result<void>(); };
};

// Loads the scene, bakes it, and says in the result's provenance by which request. `output` is not read: save_baked()
// writes the file. Errors begin with the option that contradicts another, is out of range or goes with no such kind;
// those of files and of the stages; cancelled.
Result<Baked> bake(const BakeRequest& request, const Job& job = {});

// The request as a JSON object, and back. Errors name the field: unknown, of another type, out of range.
std::string to_text(const BakeRequest& request);
Result<BakeRequest> bake_request(const std::string& json);

}  // namespace lambent

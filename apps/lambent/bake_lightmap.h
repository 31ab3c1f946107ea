#pragma once
// `lambent bake --transfer lightmap`, and receivers other than vertices for any bake.
#include "options.h"
#include "terminal.h"

#include <lambent/bake/lightmap.h>
#include <lambent/receivers/atlas.h>

namespace lambent::tool {

struct ReceiverFlags {
  std::string kind;  // "": vertices, or texels for lightmaps
  float texels_per_unit = 0;
  std::string atlas;
  void add_to(CLI::App& command);
};
struct PlacedReceivers {
  Receivers receivers;
  std::optional<Atlas> atlas;  // of texels
};
// May split the scene's vertices, so before anything is built from it.
Result<PlacedReceivers> place_receivers(Scene& scene, const ReceiverFlags& flags, const std::string& default_kind);

struct LightmapFlags {
  std::string direct = "included", solver = "gmres", sky, directional = "none", gather = "rays";
  bool groups = false;
  int lamp_samples = 32;
  void add_to(CLI::App& command);
};

extern const std::map<std::string, Solver> solver_names;
// {converged, steps: [{applications, residual}]}
nlohmann::json convergence(const SolveReport& report);

// "k" or "converge:EPS".
struct Bounces {
  int count = 0;
  double converge = 0;
};
Result<Bounces> parse_bounces(const std::string& text);

struct LightmapBake {
  SceneOptions scene;
  ReceiverFlags receivers;
  LightmapFlags flags;
  LightmapOptions options;  // all but the solver
  std::string output, precision;
};
int run_lightmap(Context& context, LightmapBake bake);

}  // namespace lambent::tool

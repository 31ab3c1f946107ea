#pragma once
// Options that several commands take, in one spelling.
#include "terminal.h"

#include <lambent/bake/subsurface.h>
#include <lambent/image/image.h>
#include <lambent/light/environment.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/request.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/transfer.h>

#include <CLI/CLI.hpp>

namespace lambent::tool {

// A scene as a bake prepares it: rows of the bake's table.
struct SceneOptions {
  BakeRequest request;
  void add_to(CLI::App& command);
};
// Loads and prepares a scene, its lamps with it where they give light; prints its warnings.
Result<Scene> load_prepared_scene(const SceneOptions& options, bool lamps);

// How a PNG shows light; an EXR keeps it.
struct DisplayOptions {
  std::string exposure = "auto", tone = "neutral";
  void add_to(CLI::App& command);
};
// Errors: as parse_display(), and options that were given for an EXR.
Result<void> check_display_options(const DisplayOptions& options, const CLI::App& command, const std::string& output);
Result<void> save_shown(const std::string& output, const Image& image, const DisplayOptions& options);

struct ViewOptions {
  std::string camera = "auto", size = "512x512", background = "env", output;
  DisplayOptions display;
  void add_to(CLI::App& command);
};
Result<View> make_view(const ViewOptions& options, const Scene& scene);

struct LightOptions {
  std::string env, rotate;
  void add_to(CLI::App& command, bool required = true);
};
Result<Environment> load_light(const LightOptions& options);
inline Result<Mat3> light_rotation(const LightOptions& options) {
  return parse_rotation(options.rotate, "--env-rotate");
}

struct BrdfOptions {
  std::string brdf = "diffuse";
  CLI::Option* add_to(CLI::App& command);
};
inline Result<Reflection> load_reflection(const BrdfOptions& options) { return parse_reflection(options.brdf); }

// Of --subsurface: what it takes, and a warning where walks came to nothing.
inline constexpr const char* subsurface_help =
    "Light through a medium: sigma_s=S,sigma_a=A[,g=G][,eta=E] per unit, S and A one number or R,G,B; or NAME[:MM], a "
    "measured one (marble, skin, wholemilk, ...) where a unit is MM millimetres (1000)";
void warn_of_lost_walks(const SubsurfaceReport& walks);

}  // namespace lambent::tool

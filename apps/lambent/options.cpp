#include "options.h"
#include "table.h"

#include <lambent/pipeline/bake_parse.h>
#include <lambent/pipeline/bake_request.h>

#include <lambent/brdf/parse_brdf.h>
#include <lambent/core/file.h>
#include <lambent/scene/load.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>

namespace lambent::tool {

void SceneOptions::add_to(CLI::App& command) {
  command.add_option("scene", request.scene, "Scene: .gltf, .glb, .obj or .ply")->required();
  const std::set<std::string> taken{"ground", "max-edge", "emit", "max-albedo", "exclude", "light-units", "lamp"};
  add_table(command, bake_options(), request, request.given,
            [&](const std::string& name) { return taken.contains(name); });
}

Result<Scene> load_prepared_scene(const SceneOptions& o, bool lamps) {
  BakeRequest request = o.request;
  for (const char* name : {"light_units", "lamp"})
    if (!lamps && request.given.contains(name))
      return Error{name == std::string("lamp") ? "--lamp" : "--light-units", "needs --lamps", true};
  if (auto ok = check_values(bake_options(), request, request.given); !ok) return ok.error();
  if (lamps) request.transfer = "lightmap";
  return load_scene_of(request, {nullptr, [](const std::string& message) { warn(message); }});
}

void DisplayOptions::add_to(CLI::App& command) {
  command.add_option("--exposure", exposure, "Stops that a PNG is brightened by, or auto")->capture_default_str();
  command.add_option("--tone", tone, "Curve from light to the screen, of a PNG")
      ->check(CLI::IsMember({"neutral", "agx", "aces", "none"}))
      ->capture_default_str();
}

Result<void> check_display_options(const DisplayOptions& options, const CLI::App& command, const std::string& output) {
  for (const char* option : {"--exposure", "--tone"})
    if (command.count(option) && file_extension(output) == "exr")
      return Error{option, "is for a PNG; an EXR keeps radiance as it is", true};
  return check_display(options.exposure, options.tone);
}

Result<void> save_shown(const std::string& output, const Image& image, const DisplayOptions& options) {
  auto display = parse_display(options.exposure, options.tone, {&image, 1});
  if (!display) return display.error();
  return save_image(output, image, *display);
}

void ViewOptions::add_to(CLI::App& command) {
  command.add_option("--camera", camera, "EX,EY,EZ,TX,TY,TZ,FOV: eye, target, vertical degrees; or auto")
      ->capture_default_str();
  command.add_option("--size", size, "Picture size, WIDTHxHEIGHT pixels")->capture_default_str();
  display.add_to(command);
  command.add_option("--background", background, "What lies behind the scene: env, or none (transparent)")
      ->check(CLI::IsMember({"env", "none"}))
      ->capture_default_str();
  command.add_option("-o,--output", output, "Picture to write: .png (8-bit sRGB) or .exr (linear)")->required();
}

Result<View> make_view(const ViewOptions& options, const Scene& scene) {
  return parse_view(options.camera, options.size, scene);
}

void LightOptions::add_to(CLI::App& command, bool required) {
  command
      .add_option("--env", env,
                  "Environment: a .hdr or .exr file, uniform:R,G,B, or sky:elevation=35,azimuth=45,turbidity=3")
      ->required(required);
  command.add_option("--env-rotate", rotate, "YAW,PITCH,ROLL: turn the environment, degrees about +Y, +X, +Z");
}

Result<Environment> load_light(const LightOptions& options) {
  auto env = load_environment(options.env);
  if (env) warn(env->warnings);
  return env;
}

CLI::Option* BrdfOptions::add_to(CLI::App& command) {
  return command
      .add_option("--brdf", brdf,
                  std::string("How surfaces reflect: diffuse (by base colour), materials (glTF's metallic-roughness), "
                              "or one model for all: ") +
                      brdf_syntax)
      ->capture_default_str();
}

void warn_of_lost_walks(const SubsurfaceReport& walks) {
  if (walks.lost > 0.005)
    warn(
        fmt::format("{:.1f}% of the walks through the medium were lost, and their light with them: surfaces are not "
                    "closed, or the medium is too dense",
                    100 * walks.lost));
}

}  // namespace lambent::tool

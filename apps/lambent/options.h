#pragma once
// Options that several commands take, in one spelling.
#include "terminal.h"

#include <lambent/bake/subsurface.h>
#include <lambent/basis/sh.h>
#include <lambent/compress/cpca.h>
#include <lambent/core/camera.h>
#include <lambent/light/environment.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/transfer.h>

#include <CLI/CLI.hpp>

#include <optional>

namespace lambent::tool {

// Strictly `count` finite numbers, separated by commas.
Result<std::vector<float>> parse_numbers(const std::string& text, size_t count, const std::string& what);

// "NAME=R,G,B": a name (which may hold '=') and three numbers.
struct NamedColor {
  std::string name;
  Vec3 color;
};
Result<NamedColor> parse_named_color(const std::string& text, const std::string& option);

// WIDTHxHEIGHT, each from 1 to 16384.
Result<std::array<int, 2>> parse_size(const std::string& text, const std::string& option);

struct SceneOptions {
  std::string path;
  bool ground = false;
  float max_edge = 0;             // 0: leave edges alone
  std::vector<std::string> emit;  // NAME=R,G,B
  float max_albedo = 1;
  void add_to(CLI::App& command);
};
// Loads and prepares a scene; prints its warnings.
Result<Scene> load_prepared_scene(const SceneOptions& options);

struct ViewOptions {
  std::string camera = "auto", size = "512x512", background = "env", output;
  float exposure = 0;
  void add_to(CLI::App& command);
};
struct View {
  Camera camera;
  int width = 0, height = 0;
};
Result<View> make_view(const ViewOptions& options, const Scene& scene);
// What --camera says: seven numbers, or nothing for "auto".
Result<std::optional<Camera>> parse_camera(const std::string& text);

struct LightOptions {
  std::string env, rotate;
  void add_to(CLI::App& command, bool required = true);
};
Result<Environment> load_light(const LightOptions& options);
Result<Mat3> light_rotation(const LightOptions& options);

struct BrdfOptions {
  std::string brdf = "diffuse";
  CLI::Option* add_to(CLI::App& command);
};
Result<Reflection> load_reflection(const BrdfOptions& options);

// cpca:CLUSTERS,RANK.
Result<void> parse_cpca(const std::string& text, CpcaOptions& options);

extern const std::map<std::string, ShWindow> window_names;

// Before long work: the folder of `path` exists and can be written, and the extension is one of those given.
Result<void> check_output(const std::string& path, std::initializer_list<const char*> extensions);

// Of --subsurface: what it takes, and a warning where walks came to nothing.
inline constexpr const char* subsurface_help =
    "Light through a medium: sigma_s=S,sigma_a=A[,g=G][,eta=E] per unit, S and A one number or R,G,B; or NAME[:MM], a "
    "measured one (marble, skin, wholemilk, ...) where a unit is MM millimetres (1000)";
void warn_of_lost_walks(const SubsurfaceReport& walks);

}  // namespace lambent::tool

#pragma once
// Options that several commands take, in one spelling.
#include "terminal.h"

#include <lambent/basis/sh.h>
#include <lambent/core/camera.h>
#include <lambent/light/environment.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/scene.h>
#include <lambent/transfer/transfer.h>

#include <CLI/CLI.hpp>

namespace lambent::tool {

// Strictly `count` finite numbers, separated by commas.
Result<std::vector<float>> parse_numbers(const std::string& text, size_t count, const std::string& what);

struct SceneOptions {
  std::string path;
  bool ground = false;
  float max_edge = 0;  // 0: leave edges alone
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

struct LightOptions {
  std::string env, rotate;
  void add_to(CLI::App& command);
};
Result<Environment> load_light(const LightOptions& options);
Result<Mat3> light_rotation(const LightOptions& options);

struct BrdfOptions {
  std::string brdf = "diffuse";
  CLI::Option* add_to(CLI::App& command);
};
Result<Reflection> load_reflection(const BrdfOptions& options);

extern const std::map<std::string, ShWindow> window_names;

// "order 6", "order 5 and 8 lobes", "36 lobes".
std::string describe_light(const LightBasis& light);

// Before long work: the folder of `path` exists and can be written, and the extension is one of those given.
Result<void> check_output(const std::string& path, std::initializer_list<const char*> extensions);

}  // namespace lambent::tool

#include "bench.h"

#include <lambent/core/parallel.h>
#include <lambent/light/environment.h>
#include <lambent/scene/load.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <time.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>

namespace lambent::bench {

void report(const std::string& name, double ours, double limit, const std::string& unit, const std::string& limit_is,
            nlohmann::json more) {
  nlohmann::ordered_json line{
      {"name", name}, {"ours", ours},         {"limit", limit},           {"ratio", ours / limit},
      {"unit", unit}, {"limit_is", limit_is}, {"threads", thread_count()}};
  for (auto& [key, value] : more.items()) line[key] = value;
  fmt::print("{}\n", line.dump());
  std::fflush(stdout);
}

double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

std::optional<Scene> data_scene(const std::string& name, bool ground) {
  const char* given = std::getenv("LAMBENT_DATA");
  const std::filesystem::path repository = std::filesystem::path(__FILE__).parent_path().parent_path();
  const std::filesystem::path folder = given ? std::filesystem::path(given)
                                             : repository.parent_path() / "shared" / "data";
  auto scene = load_scene((folder / "meshes" / name).string());
  if (!scene) {
    fmt::print(stderr, "skipped: {}\n", scene.error().text());
    return std::nullopt;
  }
  if (ground) add_ground(*scene);
  return std::move(*scene);
}

std::optional<Scene> refined(std::optional<Scene> scene, size_t vertices) {
  if (!scene) return scene;
  for (float edge = bounds(*scene).diagonal() / 30; scene->positions.size() < vertices; edge *= 0.85f)
    if (!split_long_edges(*scene, edge)) return std::nullopt;
  return scene;
}

std::optional<Environment> data_environment(const std::string& name) {
  const char* given = std::getenv("LAMBENT_DATA");
  const std::filesystem::path repository = std::filesystem::path(__FILE__).parent_path().parent_path();
  const std::filesystem::path folder = given ? std::filesystem::path(given)
                                             : repository.parent_path() / "shared" / "data";
  auto env = load_environment((folder / "environments" / (name + ".hdr")).string());
  if (!env) {
    fmt::print(stderr, "skipped: {}\n", env.error().text());
    return std::nullopt;
  }
  return std::move(*env);
}

}  // namespace lambent::bench

int main(int argc, char** argv) {
  using namespace lambent::bench;
#ifndef __OPTIMIZE__
  return fmt::print(stderr, "lambent-bench: built without optimising (LAMBENT_TOGETHER), so that times mean nothing\n"),
         2;
#endif
  struct Bench {
    const char* name;
    void (*run)();
    bool asked = false;  // run where it is named alone: it takes minutes
  };
  const Bench all[] = {
      {"bake", bench_bake},           {"basis", bench_basis},         {"certificate", bench_certificate, true},
      {"error", bench_error},         {"haar", bench_haar},           {"products", bench_products},
      {"radiosity", bench_radiosity}, {"lightmaps", bench_lightmaps}, {"load", bench_load},
      {"moving", bench_moving},       {"relight", bench_relight},     {"rooms", bench_rooms, true},
      {"scale", bench_scale, true},   {"scaling", bench_scaling},     {"zonal", bench_zonal},
      {"window", bench_window},       {"wobble", bench_wobble, true}};
  bool known = argc == 1;
  for (int i = 1; i < argc; ++i)
    for (const Bench& bench : all) known |= !std::strcmp(argv[i], bench.name);
  if (!known)
    return fmt::print(stderr,
                      "usage: lambent-bench [bake] [basis] [certificate] [error] [products] [radiosity] [lightmaps] "
                      "[haar] [load] [moving] [relight] [rooms] [scale] [scaling] [zonal] [window] [wobble]\n"),
           2;
  for (auto [name, run, asked] : all) {
    bool wanted = argc == 1 && !asked;
    for (int i = 1; i < argc; ++i) wanted |= !std::strcmp(argv[i], name);
    if (wanted) run();
  }
}

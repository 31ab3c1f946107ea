#pragma once
// Benchmarks print one JSON object a line: name, ours, limit (or peer), ratio, and what they ran on. Limits are
// measured in the same run, on the same data. Nothing here is a test: machines are shared and noisy.
#include <lambent/light/environment.h>
#include <lambent/scene/scene.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>
#include <string>

namespace lambent::bench {

// Prints {"name": ..., "ours": ..., "limit": ..., "ratio": ours / limit, "unit": ..., ...more}.
void report(const std::string& name, double ours, double limit, const std::string& unit, const std::string& limit_is,
            nlohmann::json more = nlohmann::json::object());

// Least time of `runs` calls, seconds. The least is what the code can do when the machine lets it.
template <class F>
double least_seconds(int runs, F&& f) {
  double least = 1e300;
  for (int i = 0; i < runs; ++i) {
    const auto start = std::chrono::steady_clock::now();
    f();
    least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return least;
}

// Processor time of the calling thread, seconds: what others do on the machine makes little difference to it.
double thread_seconds();
template <class F>
double least_thread_seconds(int runs, F&& f) {
  double least = 1e300;
  for (int i = 0; i < runs; ++i) {
    const double start = thread_seconds();
    f();
    least = std::min(least, thread_seconds() - start);
  }
  return least;
}

// A shared mesh on a floor, if the data folder (LAMBENT_DATA, or ../shared/data beside the repository) is there.
std::optional<Scene> data_scene(const std::string& name, bool ground);
// Made finer until it has at least so many vertices.
std::optional<Scene> refined(std::optional<Scene> scene, size_t vertices);
// The eight scenes of `products` whose names are wanted, the made ones with so much of their vertices.
void each_product_scene(float detail, const std::function<bool(const std::string&)>& wanted,
                        const std::function<void(const std::string&, const Scene&)>& use);
// A shared environment, by its name without .hdr, if it is there.
std::optional<Environment> data_environment(const std::string& name);

void bench_bake();
void bench_basis();
void bench_certificate();
void bench_error();
void bench_haar();
void bench_lightmaps();
void bench_load();
void bench_moving();
void bench_products();
void bench_radiosity();
void bench_relight();
void bench_rooms();
void bench_scale();
void bench_scaling();
void bench_window();
void bench_wobble();
void bench_zonal();

}  // namespace lambent::bench

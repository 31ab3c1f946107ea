// Loading a scan: made sheets of half a million to eight million triangles as binary PLY without normals, in a
// temporary folder. Processor time, the system's part of it too, the least of a few runs.
#include "bench.h"

#include <lambent/core/file.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>

namespace lambent::bench {
namespace {

rusage usage() {
  rusage u;
  getrusage(RUSAGE_SELF, &u);
  return u;
}

template <class F>
double least_processor_seconds(int runs, F&& f) {
  auto seconds = [] {
    const rusage u = usage();
    return double(u.ru_utime.tv_sec + u.ru_stime.tv_sec) + 1e-6 * double(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
  };
  double least = 1e300;
  for (int i = 0; i < runs; ++i) {
    const double start = seconds();
    f();
    least = std::min(least, seconds() - start);
  }
  return least;
}

template <class T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// n x n vertices of a wavy sheet.
std::string sheet(int n) {
  std::string out = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      n * n, 2 * (n - 1) * (n - 1));
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x)
      put(out, float(x)), put(out, 3 * std::sin(0.05f * float(x)) * std::cos(0.03f * float(y))), put(out, float(y));
  for (int y = 0; y + 1 < n; ++y) {
    for (int x = 0; x + 1 < n; ++x) {
      const int32_t i = y * n + x;
      for (auto t : {std::array{i, i + n, i + 1}, {i + 1, i + n, i + n + 1}}) put(out, uint8_t(3)), put(out, t);
    }
  }
  return out;
}

// What any reader does: the file's bytes, value by value, into arrays.
size_t read_plainly(const std::string& path, int n) {
  auto file = read_file(path);
  if (!file) return 0;
  std::vector<Vec3> positions(size_t(n) * size_t(n));
  std::vector<int32_t> corners(6 * size_t(n - 1) * size_t(n - 1));
  const size_t faces = corners.size() / 3, start = file->size() - positions.size() * 12 - faces * 13;
  const uint8_t* at = file->data() + start;
  for (Vec3& p : positions)
    for (size_t k = 0; k < 3; ++k, at += 4) std::memcpy(&p[k], at, 4);
  for (size_t f = 0; f < faces; ++f) {
    size_t count = *at++;
    for (size_t k = 0; k < count && k < 3; ++k, at += 4) std::memcpy(&corners[3 * f + k], at, 4);
  }
  return size_t(corners.back()) + size_t(positions.back().x);
}

}  // namespace

void bench_load() {
  const auto folder = std::filesystem::temp_directory_path();
  double before = 0;
  for (int n : {501, 1001, 2001}) {
    const int triangles = 2 * (n - 1) * (n - 1), runs = n > 1500 ? 3 : 7;
    const std::string path = (folder / fmt::format("lambent_bench_{}_{}.ply", getpid(), n)).string();
    if (auto saved = write_file_atomically(path, sheet(n)); !saved) return;
    size_t scene_bytes = 0, sum = 0;
    const double plain = least_processor_seconds(runs, [&] { sum += read_plainly(path, n); });
    const double ours = least_processor_seconds(runs, [&] {
      auto scene = load_scene(path);
      if (scene) scene_bytes = scene->positions.size() * sizeof(Vec3) * 2 + scene->triangles.size() * sizeof(Triangle);
    });
    std::filesystem::remove(path);
    report("load ply", ours, plain, "s", "the bytes read into arrays of positions and corners",
           {{"triangles", triangles}, {"check", sum % 7}});
    if (before > 0)
      report("load ply, time per triangle", ours / 4, before, "s", "a quarter of the triangles",
             {{"triangles", triangles}});
    report("load ply, peak memory", double(usage().ru_maxrss) * 1024, double(scene_bytes), "bytes",
           "the scene that comes out", {{"triangles", triangles}});
    before = ours;
  }
}

}  // namespace lambent::bench

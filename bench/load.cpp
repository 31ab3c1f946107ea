// Loading a scan: made sheets of half a million to eight million triangles as binary PLY without normals, in a
// temporary folder. Processor time, the system's part of it too, the least of a few processes. And a forest: copies of
// a tree by EXT_mesh_gpu_instancing, what they take in memory, and rays through them with and without shared triangles.
#include "bench.h"

#include <lambent/core/file.h>
#include <lambent/core/random.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>
#include <lambent/scene/procedural.h>
#include <lambent/trace/tracer.h>

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
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

double processor_seconds() {
  const rusage u = usage();
  return double(u.ru_utime.tv_sec + u.ru_stime.tv_sec) + 1e-6 * double(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

template <class F>
double least_processor_seconds(int runs, F&& f) {
  double least = 1e300;
  for (int i = 0; i < runs; ++i) {
    const double start = processor_seconds();
    f();
    least = std::min(least, processor_seconds() - start);
  }
  return least;
}

struct Run {
  double seconds = 1e300, peak = 0;  // of the processor; bytes of the process
};

// The least of some runs, each in a process of its own, as a tool's first file is read: memory that the one before gave
// back would spare the pages' faults, which are a good part of reading.
template <class F>
Run least_apart(int runs, F&& f) {
  Run least;
  for (int i = 0; i < runs; ++i) {
    int ends[2];
    if (pipe(ends) != 0) return least;
    const pid_t child = fork();
    if (child == 0) {
      Run run;
      const double start = processor_seconds();
      f();
      run.seconds = processor_seconds() - start, run.peak = double(usage().ru_maxrss) * 1024;
      _exit(write(ends[1], &run, sizeof run) == ssize_t(sizeof run) ? 0 : 1);
    }
    close(ends[1]);
    Run run;
    if (read(ends[0], &run, sizeof run) == ssize_t(sizeof run) && run.seconds < least.seconds) least = run;
    close(ends[0]);
    waitpid(child, nullptr, 0);
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

// A tree of 1,280 triangles, and where its copies stand; a glTF file of one mesh.
bool save_forest(const std::string& path, size_t copies) {
  Scene tree = make_sphere(1, 3, Vec3(0.6f));
  for (Vec3& p : tree.positions) p = Vec3(p.x * (1.2f + 0.4f * p.y), 2 * p.y, p.z + 0.5f * p.y * p.y);
  Random random(1);
  std::vector<Vec3> places, scales;
  const size_t side = size_t(std::ceil(std::sqrt(double(copies))));
  for (size_t i = 0; i < copies; ++i) {
    places.push_back(Vec3(4 * double(i % side) + random.next(), 0, 4 * double(i / side) + random.next()));
    scales.push_back(Vec3(0.7f + 0.6f * random.next(), 0.7f + 0.6f * random.next(), 0.7f + 0.6f * random.next()));
  }
  auto bytes = [](const std::vector<Vec3>& v) {
    return GltfBlob{{reinterpret_cast<const uint8_t*>(v.data()), v.size() * sizeof(Vec3)}};
  };
  const GltfBlob blobs[] = {bytes(places), bytes(scales)};
  return bool(save_gltf(path, tree, blobs, [&](nlohmann::json& document, const GltfPlaces& at) {
    const size_t first = document["accessors"].size();
    for (size_t i = 0; i < 2; ++i)
      document["accessors"].push_back(
          {{"bufferView", at.views[i].front()}, {"componentType", 5126}, {"count", copies}, {"type", "VEC3"}});
    document["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", first},
                                                                                   {"SCALE", first + 1}};
    document["extensionsUsed"] = nlohmann::json::array({"EXT_mesh_gpu_instancing"});
  }));
}

struct Loaded {
  double peak = 0;       // bytes of the process
  double receivers = 0;  // of the scene's vertices and triangles, which receivers stand on
  double tracer = 0, copies = 0, seconds = 0;
};

// In a process of its own, whose peak is that of this alone; an empty path loads nothing.
Loaded load_apart(const std::string& path, Sharing sharing) {
  int ends[2];
  Loaded out;
  if (pipe(ends) != 0) return out;
  const pid_t child = fork();
  if (child == 0) {
    if (!path.empty()) {
      auto scene = load_scene(path);
      if (!scene) _exit(1);
      auto tracer = Tracer::build(*scene, nullptr, sharing);
      if (!tracer) _exit(1);
      out.receivers = double(scene->positions.size() * (2 * sizeof(Vec3) + sizeof(uint32_t)) +
                             scene->triangles.size() * sizeof(Triangle));
      out.tracer = double(tracer->bytes()), out.copies = double(tracer->copies());
    }
    const rusage u = usage();
    out.peak = double(u.ru_maxrss) * 1024;
    out.seconds = double(u.ru_utime.tv_sec + u.ru_stime.tv_sec) +
                  1e-6 * double(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
    _exit(write(ends[1], &out, sizeof out) == ssize_t(sizeof out) ? 0 : 1);
  }
  close(ends[1]);
  if (read(ends[0], &out, sizeof out) != ssize_t(sizeof out)) out = {};
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return out;
}

// Processor seconds of rays from a few thousand receivers, 256 each in a sorted fan, the closest hits.
double fan_seconds(const Tracer& tracer, const Receivers& receivers) {
  std::vector<float> x, y, z;
  for (int i = 0; i < 256; ++i) {
    const float cosine = 1 - 2 * (float(i) + 0.5f) / 256, sine = std::sqrt(1 - cosine * cosine);
    x.push_back(sine * std::cos(2.399963f * float(i))), y.push_back(cosine);
    z.push_back(sine * std::sin(2.399963f * float(i)));
  }
  std::vector<Hit> hits(256);
  const size_t step = std::max<size_t>(receivers.count() / 4000, 1);
  return least_processor_seconds(3, [&] {
    for (size_t r = 0; r < receivers.count(); r += step)
      tracer.closest_fan(receivers.origins[r], {x.data(), y.data(), z.data(), 256}, hits.data());
  });
}

void bench_forest(const std::string& path) {
  const double empty = load_apart({}, Sharing::automatic).peak;
  double one = 0;
  for (size_t copies : {size_t(1), size_t(100), size_t(10000)}) {
    if (!save_forest(path, copies)) return;
    const Loaded shared = load_apart(path, Sharing::always), own = load_apart(path, Sharing::automatic),
                 flat = load_apart(path, Sharing::never);
    if (copies == 1) one = shared.peak - empty;
    for (const auto& [name, loaded] : {std::pair{"shared", shared}, {"automatic", own}, {"flat", flat}})
      report(fmt::format("load forest, {}, peak memory beyond an empty process", name), loaded.peak - empty,
             2 * one + loaded.receivers, "bytes", "twice one copy's, and the scene's vertices and triangles",
             {{"copies", copies}, {"shared", loaded.copies}, {"tracer", loaded.tracer}, {"seconds", loaded.seconds}});
    auto scene = load_scene(path);
    if (!scene) return;
    const Receivers receivers = make_vertex_receivers(*scene);
    const double a = fan_seconds(*Tracer::build(*scene, nullptr, Sharing::always), receivers),
                 b = fan_seconds(*Tracer::build(*scene, nullptr, Sharing::never), receivers);
    report("load forest, rays, shared", a, b, "s", "the same rays where each copy has triangles of its own",
           {{"copies", copies}});
  }
  std::filesystem::remove(path);
}

}  // namespace

void bench_load() {
  const auto folder = std::filesystem::temp_directory_path();
  Run before, plain_before;
  for (int n : {501, 1001, 2001}) {
    const int triangles = 2 * (n - 1) * (n - 1), runs = n > 1500 ? 3 : 7;
    const std::string path = (folder / fmt::format("lambent_bench_{}_{}.ply", getpid(), n)).string();
    if (auto saved = write_file_atomically(path, sheet(n)); !saved) return;
    const double scene_bytes = double(n) * n * 2 * sizeof(Vec3) + double(triangles) * sizeof(Triangle);
    const double empty = least_apart(1, [] {}).peak;
    const Run plain = least_apart(runs, [&] {
      if (read_plainly(path, n) == 0) _exit(1);
    });
    const Run ours = least_apart(runs, [&] {
      if (!load_scene(path)) _exit(1);
    });
    std::filesystem::remove(path);
    report("load ply", ours.seconds, plain.seconds, "s", "the bytes read into arrays of positions and corners",
           {{"triangles", triangles}});
    if (plain_before.peak > 0)
      report("load ply, time per triangle", ours.seconds / 4, before.seconds, "s", "a quarter of the triangles",
             {{"triangles", triangles}, {"the_same_of_reading", plain.seconds / 4 / plain_before.seconds}});
    report("load ply, peak memory", ours.peak - empty, scene_bytes, "bytes", "the scene that comes out",
           {{"triangles", triangles}});
    before = ours, plain_before = plain;
  }
  bench_forest((folder / fmt::format("lambent_bench_{}.glb", getpid())).string());
}

}  // namespace lambent::bench

// Time and memory a receiver from tens of thousands of receivers to millions, where the operator leaves the caches and
// then the memory: the same courtyard at finer and finer tessellation, a process each. What raw closest hits of the
// same rays grow by is divided out. LAMBENT_SCALE: details of the tessellation, LAMBENT_SCRATCH: a folder for rows that
// memory has no room for.
#include "embree.h"

#include <lambent/bake/bake.h>
#include <lambent/core/progress.h>
#include <lambent/scene/procedural.h>

#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

namespace lambent::bench {
namespace {

// A line of /proc/self/status in bytes: VmRSS, what is there now; VmHWM, the most that was.
double memory_bytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key)) return 1024 * std::strtod(line.c_str() + key.size() + 1, nullptr);
  return 0;
}

struct Measured {
  double receivers = 0, triangles = 0, each = 0, raw_each = 0, trace = 0, bounce = 0, memory = 0, in_memory = 0,
         in_file = 0, kept = 0;
};

Measured measure(float detail, bool measured_error, size_t memory) {
  Measured m;
  const Scene scene = make_courtyard(detail);
  auto tracer = Tracer::build(scene);
  if (!tracer) return m;
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options;
  options.order = 4, options.samples = 64, options.bounces = 1, options.memory = memory;
  options.denoise = options.certify = measured_error;
  Progress progress;
  const char* scratch = std::getenv("LAMBENT_SCRATCH");
  progress.scratch = scratch ? scratch : ".";
  m.receivers = double(receivers.count()), m.triangles = double(scene.triangles.size());
  BakeReport r;
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // the most that was begins anew
  const double before = memory_bytes("VmRSS:");
  const double seconds = least_seconds(1, [&] { (void)bake(scene, *tracer, receivers, options, &r, &progress); });
  m.memory = (memory_bytes("VmHWM:") - before - double(r.bytes)) / m.receivers;
  m.each = 1e6 * seconds / m.receivers;
  m.trace = 1e6 * r.trace_seconds / m.receivers, m.bounce = 1e6 * r.bounce_seconds / m.receivers;
  m.in_memory = double(r.operator_bytes) / m.receivers, m.in_file = double(r.operator_file_bytes) / m.receivers;
  m.kept = r.operator_kept;
  const RawScene raw(scene);
  const DirectionSets sets = make_direction_sets(options.order, options.samples, 8, 1);
  m.raw_each = 1e6 / m.receivers *
               raw_seconds(1, receivers, sets, [&](Vec3 o, const float* x, const float* y, const float* z, size_t n) {
                 return packets<true>(raw.scene, o, x, y, z, n);
               });
  return m;
}

// In a process of its own, whose memory is nobody else's.
Measured measure_apart(float detail, bool measured_error, size_t memory) {
  Measured m;
  int ends[2];
  if (::pipe(ends) != 0) return m;
  const pid_t child = ::fork();
  if (child == 0) {
    m = measure(detail, measured_error, memory);
    (void)!::write(ends[1], &m, sizeof m);
    ::_exit(0);
  }
  ::close(ends[1]);
  if (::read(ends[0], &m, sizeof m) != sizeof m) m = {};
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return m;
}

}  // namespace

void bench_scale() {
  const char* asked = std::getenv("LAMBENT_SCALE");
  std::istringstream details(asked ? asked : "0.6 2 4 8");
  Measured first;
  for (float detail; details >> detail;) {
    double receivers = 0;
    for (const bool small : {false, true}) {  // the operator in memory as far as 4 GiB go, and hardly any of it
      const Measured m =
          measure_apart(detail, false, small ? size_t(receivers * 560) + (size_t{64} << 20) : size_t{4} << 30);
      if (m.receivers == 0) continue;
      receivers = m.receivers;
      if (first.receivers == 0) first = m;
      const double growth = m.each / first.each / (m.raw_each / first.raw_each);
      report("bake_scale", m.each, first.each * m.raw_each / first.raw_each, "us a receiver",
             "the smallest of these scenes, grown as raw closest hits of the same rays do",
             {{"receivers", m.receivers},
              {"triangles", m.triangles},
              {"growth", growth},
              {"raw_us", m.raw_each},
              {"trace_us", m.trace},
              {"bounce_us", m.bounce},
              {"memory_bytes_a_receiver", m.memory},
              {"operator_bytes_a_receiver", m.in_memory},
              {"operator_file_bytes_a_receiver", m.in_file},
              {"operator_kept", m.kept},
              {"aim", "<= 1.3"}});
    }
  }
}

}  // namespace lambent::bench

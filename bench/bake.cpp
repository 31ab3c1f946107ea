// The bake against Embree itself on the same rays: same origins, same sorted and spun directions, nothing done with the answer.
// The limit is the best of Embree's entry points in this run. Not measured here: loading, writing.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/gather.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/materials.h>
#include <lambent/core/parallel.h>
#include <lambent/scene/procedural.h>

#include <embree3/rtcore.h>

#include <atomic>
#include <cstring>

namespace lambent::bench {
namespace {

constexpr int samples = 1024, order = 6, runs = 3;

struct RawScene {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  explicit RawScene(const Scene& s) {
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* p = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), s.positions.size());
    std::memcpy(p, s.positions.data(), s.positions.size() * sizeof(Vec3));
    auto* i = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, s.triangles.size()));
    for (const Triangle& t : s.triangles) std::memcpy(i, t.v, 12), i += 3;
    rtcCommitGeometry(g), rtcAttachGeometry(scene, g), rtcReleaseGeometry(g), rtcCommitScene(scene);
  }
  ~RawScene() { rtcReleaseScene(scene), rtcReleaseDevice(device); }
};

// Calls trace(origin, x, y, z, count) for every receiver's directions, in parallel.
template <class Trace>
double raw_seconds(const Receivers& receivers, const DirectionSets& sets, Trace trace) {
  std::atomic<size_t> hits{0};
  const double seconds = least_seconds(runs, [&] {
    parallel_for(receivers.count(), gather_block, [&](size_t begin, size_t end) {
      AlignedVector<float> x(sets.stride), y(sets.stride), z(sets.stride);
      size_t found = 0;
      for (size_t r = begin; r < end; ++r) {
        const DirectionChoice c = choose_directions(sets, receivers.normals[r], 1, r);
        const size_t base = size_t(c.set) * sets.stride;
        rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride, x.data(), y.data(), z.data());
        for (size_t i = 0; i < size_t(samples); i += 256) found += trace(receivers.origins[r], x.data() + i, y.data() + i, z.data() + i, 256);
      }
      hits += found;
    });
  });
  if (hits == 0) std::fprintf(stderr, "no ray hit anything\n");
  return seconds;
}

size_t occluded_stream(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) RTCRay rays[256];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (size_t i = 0; i < n; ++i) rays[i] = {o.x, o.y, o.z, 0, x[i], y[i], z[i], 0, INFINITY, ~0u, 0, 0};
  rtcOccluded1M(scene, &context, rays, unsigned(n), sizeof(RTCRay));
  size_t found = 0;
  for (size_t i = 0; i < n; ++i) found += rays[i].tfar < 0;
  return found;
}

template <bool closest>
size_t packets(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) int valid[16];
  std::fill(valid, valid + 16, -1);
  size_t found = 0;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (size_t begin = 0; begin < n; begin += 16) {
    RTCRayHit16 p;
    for (int i = 0; i < 16; ++i) {
      p.ray.org_x[i] = o.x, p.ray.org_y[i] = o.y, p.ray.org_z[i] = o.z;
      p.ray.dir_x[i] = x[begin + size_t(i)], p.ray.dir_y[i] = y[begin + size_t(i)], p.ray.dir_z[i] = z[begin + size_t(i)];
      p.ray.tnear[i] = 0, p.ray.tfar[i] = INFINITY, p.ray.time[i] = 0, p.ray.mask[i] = ~0u, p.ray.id[i] = 0, p.ray.flags[i] = 0;
      p.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    if (closest) rtcIntersect16(valid, scene, &context, &p);
    else rtcOccluded16(valid, scene, &context, &p.ray);
    for (int i = 0; i < 16; ++i) found += closest ? p.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID : p.ray.tfar[i] < 0;
  }
  return found;
}

size_t closest_stream(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) RTCRayHit rays[256];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (size_t i = 0; i < n; ++i) {
    rays[i].ray = {o.x, o.y, o.z, 0, x[i], y[i], z[i], 0, INFINITY, ~0u, 0, 0};
    rays[i].hit.geomID = RTC_INVALID_GEOMETRY_ID, rays[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect1M(scene, &context, rays, unsigned(n), sizeof(RTCRayHit));
  size_t found = 0;
  for (size_t i = 0; i < n; ++i) found += rays[i].hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return found;
}

void bake_scene(const std::string& name, const Scene& scene) {
  auto tracer = Tracer::build(scene);
  if (!tracer) return;
  const RawScene raw(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const DirectionSets sets = make_direction_sets(order, samples, 8, 1);
  const double rays = double(receivers.count()) * samples / 1e6;
  auto time = [&](auto f) {
    return raw_seconds(receivers, sets, [&](Vec3 o, const float* x, const float* y, const float* z, size_t n) { return f(raw.scene, o, x, y, z, n); });
  };
  const double stream = time(occluded_stream), packet = time(packets<false>);
  const double closest_packet = time(packets<true>), closest_m = time(closest_stream);
  const double occluded = std::min(stream, packet), closest = std::min(closest_packet, closest_m);
  const nlohmann::json about{{"scene", name}, {"receivers", receivers.count()}, {"triangles", scene.triangles.size()}, {"samples", samples}, {"order", order}};
  auto with = [&](nlohmann::json more) {
    nlohmann::json j = about;
    j.update(more);
    return j;
  };
  auto bake_seconds = [&](int bounces, BakeReport& report) {
    BakeOptions options;
    options.bounces = bounces, options.order = order, options.samples = samples;
    return least_seconds(runs, [&] { (void)bake(scene, *tracer, receivers, options, &report); });
  };
  BakeReport r0, r1, r3;
  auto matrix_seconds = [&](int bounces) {
    const BakeOptions options{.order = 5, .samples = samples, .bounces = bounces};
    const ReceiverMaterials materials = make_receiver_materials(scene, receivers, {.everywhere = Ggx{.alpha = Vec2(0.16f)}});
    return least_seconds(runs, [&] { (void)bake_matrix(scene, *tracer, receivers, materials, options, {.response_samples = 256}); });
  };
  const double m0 = matrix_seconds(0), m1 = matrix_seconds(1);
  const double b0 = bake_seconds(0, r0), b1 = bake_seconds(1, r1), b3 = bake_seconds(3, r3);
  report("bake_direct", rays / b0, rays / occluded, "Mrays/s", "best raw Embree occlusion, same rays",
         with({{"raw_stream", rays / stream}, {"raw_packets", rays / packet}, {"aim", ">= 0.8"}}));
  report("bake_matrix_direct", rays / m0, rays / occluded, "Mrays/s", "best raw Embree occlusion, same rays",
         with({{"order", 5}, {"incident_order", 5}, {"outgoing", "svd:6"}, {"aim", ">= 0.5"}}));
  report("bake_matrix_1_bounce", rays / m1, rays / closest, "Mrays/s", "raw Embree closest hits, same rays",
         with({{"order", 5}, {"incident_order", 5}, {"outgoing", "svd:6"}}));
  report("bake_1_bounce", b1, closest, "s", "raw Embree closest hits, same rays",
         with({{"raw_stream_s", closest_m}, {"raw_packets_s", closest_packet}, {"trace_s", r1.trace_seconds}, {"bounce_s", r1.bounce_seconds}, {"aim", "<= 1.35"}}));
  report("bake_3_bounces", b3, b1, "s", "the bake with 1 bounce",
         with({{"operator_bytes_per_receiver", double(r3.operator_bytes) / double(receivers.count())}, {"bounce_s", r3.bounce_seconds}, {"aim", "<= 1.15"}}));
}

}  // namespace

void bench_bake() {
  for (const char* name : {"bunny.obj", "armadillo.obj"})
    if (auto scene = data_scene(name, true)) bake_scene(std::string(name) + " --ground", *scene);
  bake_scene("courtyard", make_courtyard());
}

}  // namespace lambent::bench

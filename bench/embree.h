#pragma once
// Embree itself on a bake's rays: same origins, same sorted and spun directions, nothing done with the answer. The
// limit that bakes are held to.
#include "bench.h"

#include <lambent/bake/gather.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/embree.h>
#include <lambent/core/parallel.h>

#include <atomic>
#include <cstring>

namespace lambent::bench {

struct RawScene {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  explicit RawScene(const Scene& s) {
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* p =
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), s.positions.size());
    std::memcpy(p, s.positions.data(), s.positions.size() * sizeof(Vec3));
    auto* i = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, s.triangles.size()));
    for (const Triangle& t : s.triangles) std::memcpy(i, t.v, 12), i += 3;
    rtcCommitGeometry(g), rtcAttachGeometry(scene, g), rtcReleaseGeometry(g), rtcCommitScene(scene);
  }
  ~RawScene() { rtcReleaseScene(scene), rtcReleaseDevice(device); }
};

// Least seconds of `runs` calls of trace(origin, x, y, z, count) for every receiver's directions, in parallel; samples
// % 256 == 0, or below 256 and a multiple of 16.
template <class Trace>
double raw_seconds(int runs, const Receivers& receivers, const DirectionSets& sets, Trace trace) {
  std::atomic<size_t> hits{0};
  const size_t samples = size_t(sets.samples);
  const double seconds = least_seconds(runs, [&] {
    parallel_for(receivers.count(), gather_block, [&](size_t begin, size_t end) {
      AlignedVector<float> x(sets.stride), y(sets.stride), z(sets.stride);
      size_t found = 0;
      for (size_t r = begin; r < end; ++r) {
        const DirectionChoice c = choose_directions(sets, receivers.normals[r], 1, r);
        const size_t base = size_t(c.set) * sets.stride;
        rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                          x.data(), y.data(), z.data());
        for (size_t i = 0, each = std::min<size_t>(256, samples); i < samples; i += each)
          found += trace(receivers.origins[r], x.data() + i, y.data() + i, z.data() + i, each);
      }
      hits += found;
    });
  });
  if (hits == 0) std::fprintf(stderr, "no ray hit anything\n");
  return seconds;
}

inline size_t occluded_stream(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) RTCRay rays[256];
  embree::Query query;
  for (size_t i = 0; i < n; ++i) rays[i] = {o.x, o.y, o.z, 0, x[i], y[i], z[i], 0, INFINITY, ~0u, 0, 0};
  embree::occluded_many(scene, query, rays, n);
  size_t found = 0;
  for (size_t i = 0; i < n; ++i) found += rays[i].tfar < 0;
  return found;
}

template <bool closest>
size_t packets(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) int valid[16];
  std::fill(valid, valid + 16, -1);
  size_t found = 0;
  embree::Query query;
  for (size_t begin = 0; begin < n; begin += 16) {
    RTCRayHit16 p;
    for (int i = 0; i < 16; ++i) {
      p.ray.org_x[i] = o.x, p.ray.org_y[i] = o.y, p.ray.org_z[i] = o.z;
      p.ray.dir_x[i] = x[begin + size_t(i)], p.ray.dir_y[i] = y[begin + size_t(i)],
      p.ray.dir_z[i] = z[begin + size_t(i)];
      p.ray.tnear[i] = 0, p.ray.tfar[i] = INFINITY, p.ray.time[i] = 0, p.ray.mask[i] = ~0u, p.ray.id[i] = 0,
      p.ray.flags[i] = 0;
      p.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    if (closest) embree::intersect16(valid, scene, query, p);
    else embree::occluded16(valid, scene, query, p.ray);
    for (int i = 0; i < 16; ++i) found += closest ? p.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID : p.ray.tfar[i] < 0;
  }
  return found;
}

inline size_t closest_stream(RTCScene scene, Vec3 o, const float* x, const float* y, const float* z, size_t n) {
  alignas(64) RTCRayHit rays[256];
  embree::Query query;
  for (size_t i = 0; i < n; ++i) {
    rays[i].ray = {o.x, o.y, o.z, 0, x[i], y[i], z[i], 0, INFINITY, ~0u, 0, 0};
    rays[i].hit.geomID = RTC_INVALID_GEOMETRY_ID, rays[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  }
  embree::intersect_many(scene, query, rays, n);
  size_t found = 0;
  for (size_t i = 0; i < n; ++i) found += rays[i].hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return found;
}

}  // namespace lambent::bench

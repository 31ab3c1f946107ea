#include <lambent/core/parallel.h>
#include <lambent/trace/tracer.h>

#include <embree3/rtcore.h>

#include <algorithm>
#include <atomic>
#include <cstring>

namespace lambent {
namespace {

constexpr size_t build_units = 1000;  // of progress

struct Build {
  ProgressStage stage;
  size_t done = 0;
  // Called by the thread that builds. False: stop.
  static bool advance(void* user, double share) {
    Build& b = *static_cast<Build*>(user);
    const size_t reached = size_t(std::clamp(share, 0.0, 1.0) * double(build_units));
    if (reached > b.done) b.stage.advance(reached - b.done), b.done = reached;
    return !b.stage.cancelled();
  }
};

}  // namespace

struct Tracer::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::atomic<ssize_t> bytes{0};
  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

Result<Tracer> Tracer::build(const Scene& scene, Progress* progress) {
  auto impl = std::make_shared<Impl>();
  impl->device = rtcNewDevice(nullptr);
  if (!impl->device) return Error{scene.path, "the ray tracer could not start"};
  rtcSetDeviceMemoryMonitorFunction(
      impl->device,
      [](void* user, ssize_t bytes, bool) {
        static_cast<Impl*>(user)->bytes += bytes;
        return true;
      },
      impl.get());
  impl->scene = rtcNewScene(impl->device);
  rtcSetSceneBuildQuality(impl->scene, RTC_BUILD_QUALITY_HIGH);

  RTCGeometry mesh = rtcNewGeometry(impl->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* positions = static_cast<Vec3*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               sizeof(Vec3), scene.positions.size()));
  auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(uint32_t), scene.triangles.size()));
  if (!positions || !indices) {
    rtcReleaseGeometry(mesh);
    return Error{scene.path, "out of memory for the ray tracer"};
  }
  std::copy(scene.positions.begin(), scene.positions.end(), positions);
  for (size_t i = 0; i < scene.triangles.size(); ++i)
    std::memcpy(indices + 3 * i, scene.triangles[i].v, 3 * sizeof(uint32_t));
  Build building{{progress, "ray tree", build_units}};
  rtcSetSceneProgressMonitorFunction(impl->scene, Build::advance, &building);
  // A build on many threads may order the leaves differently from run to run, and with them the winner of exact ties.
  run_serially([&] {
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(impl->scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(impl->scene);
  });
  rtcSetSceneProgressMonitorFunction(impl->scene, nullptr, nullptr);
  if (is_cancelled(progress)) return Error{"", "cancelled"};
  if (rtcGetDeviceError(impl->device) != RTC_ERROR_NONE) return Error{scene.path, "out of memory for the ray tracer"};
  Tracer tracer;
  tracer.impl_ = std::move(impl);
  return tracer;
}

size_t Tracer::bytes() const { return size_t(std::max<ssize_t>(impl_->bytes, 0)); }

// Occlusion: streams of 256 rays were the fastest of Embree's entry points for sorted directions; the COHERENT flag
// slows it.
void Tracer::visible_fan(Vec3 origin, const Directions& d, float* visible) const {
  constexpr size_t batch = 256;
  alignas(64) RTCRay rays[batch];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (size_t begin = 0; begin < d.count; begin += batch) {
    const size_t n = std::min(batch, d.count - begin);
    for (size_t i = 0; i < n; ++i) {
      RTCRay& r = rays[i];
      r.org_x = origin.x, r.org_y = origin.y, r.org_z = origin.z, r.tnear = 0;
      r.dir_x = d.x[begin + i], r.dir_y = d.y[begin + i], r.dir_z = d.z[begin + i], r.time = 0;
      r.tfar = INFINITY, r.mask = ~0u, r.id = 0, r.flags = 0;
    }
    rtcOccluded1M(impl_->scene, &context, rays, unsigned(n), sizeof(RTCRay));
    for (size_t i = 0; i < n; ++i) visible[begin + i] = rays[i].tfar < 0 ? 0.0f : 1.0f;
  }
}

void Tracer::closest_fan(Vec3 origin, const Directions& d, Hit* hits) const {
  constexpr size_t batch = 16;
  RTCRayHit16 packet;
  alignas(64) int valid[batch];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (size_t begin = 0; begin < d.count; begin += batch) {
    const size_t n = std::min(batch, d.count - begin);
    for (size_t i = 0; i < batch; ++i) {
      const size_t j = begin + std::min(i, n - 1);
      valid[i] = i < n ? -1 : 0;
      packet.ray.org_x[i] = origin.x, packet.ray.org_y[i] = origin.y, packet.ray.org_z[i] = origin.z;
      packet.ray.dir_x[i] = d.x[j], packet.ray.dir_y[i] = d.y[j], packet.ray.dir_z[i] = d.z[j];
      packet.ray.tnear[i] = 0, packet.ray.tfar[i] = INFINITY, packet.ray.time[i] = 0;
      packet.ray.mask[i] = ~0u, packet.ray.id[i] = 0, packet.ray.flags[i] = 0;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid, impl_->scene, &context, &packet);
    for (size_t i = 0; i < n; ++i) {
      Hit& h = hits[begin + i];
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
        h = Hit{};
        continue;
      }
      const float facing = packet.hit.Ng_x[i] * packet.ray.dir_x[i] + packet.hit.Ng_y[i] * packet.ray.dir_y[i] +
                           packet.hit.Ng_z[i] * packet.ray.dir_z[i];
      h = {packet.hit.primID[i], packet.hit.u[i], packet.hit.v[i], facing < 0, packet.ray.tfar[i]};
    }
  }
}

Hit Tracer::closest(Vec3 origin, Vec3 direction, float from, float to) const {
  RTCRayHit r;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  r.ray.org_x = origin.x, r.ray.org_y = origin.y, r.ray.org_z = origin.z, r.ray.tnear = from;
  r.ray.dir_x = direction.x, r.ray.dir_y = direction.y, r.ray.dir_z = direction.z, r.ray.time = 0;
  r.ray.tfar = to, r.ray.mask = ~0u, r.ray.id = 0, r.ray.flags = 0;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID, r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context, &r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  const float facing = r.hit.Ng_x * direction.x + r.hit.Ng_y * direction.y + r.hit.Ng_z * direction.z;
  return {r.hit.primID, r.hit.u, r.hit.v, facing < 0, r.ray.tfar};
}

}  // namespace lambent

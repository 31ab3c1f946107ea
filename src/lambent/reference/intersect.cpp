// Ray tracing by Embree: one scene, watertight ("robust") traversal, single rays.
#include <lambent/core/embree.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/reference/intersect.h>
#include <lambent/scene/see_through.h>

#include <algorithm>
#include <cstring>

namespace lambent::reference {

struct Intersector::Impl {
  const Scene* scene = nullptr;
  std::vector<uint8_t> see_through;  // by material; empty where all are solid
  RTCDevice device = nullptr;
  RTCScene bvh = nullptr;
  ~Impl() {
    if (bvh) rtcReleaseScene(bvh);
    if (device) rtcReleaseDevice(device);
  }
};

namespace {

// Of 4 million rays off flat meshes of all sizes none steeper than 1e-5 to the plane met the mesh again with half of
// this. At flatter ones the rounding of the direction itself decides.
constexpr float offset_ulps = 16;

struct CameraContext {
  embree::Query query;  // first: embree.h
  const Scene* scene;
  const std::vector<uint32_t>* passed = nullptr;  // triangles that are not there any more
  bool backs = false;
};

// Refuses backs of one-sided triangles, and what was passed. Embree's Ng is cross(v1 - v0, v2 - v0): it points to the
// front.
void skip_backs(const RTCFilterFunctionNArguments* args) {
  const CameraContext& context = *reinterpret_cast<const CameraContext*>(args->context);
  const Scene& scene = *context.scene;
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    if (context.passed && std::find(context.passed->begin(), context.passed->end(),
                                    RTCHitN_primID(args->hit, args->N, i)) != context.passed->end())
      args->valid[i] = 0;
    if (args->valid[i] == 0 || context.backs) continue;
    if (scene.triangles[RTCHitN_primID(args->hit, args->N, i)].two_sided) continue;
    float facing = RTCRayN_dir_x(args->ray, args->N, i) * RTCHitN_Ng_x(args->hit, args->N, i) +
                   RTCRayN_dir_y(args->ray, args->N, i) * RTCHitN_Ng_y(args->hit, args->N, i) +
                   RTCRayN_dir_z(args->ray, args->N, i) * RTCHitN_Ng_z(args->hit, args->N, i);
    if (facing >= 0) args->valid[i] = 0;
  }
}

void set_ray(RTCRay& ray, Vec3 origin, Vec3 d) {
  ray.org_x = origin.x, ray.org_y = origin.y, ray.org_z = origin.z, ray.tnear = 0;
  ray.dir_x = d.x, ray.dir_y = d.y, ray.dir_z = d.z, ray.tfar = INFINITY;
  ray.time = 0, ray.mask = ~0u, ray.id = 0, ray.flags = 0;
}

bool trace(RTCScene bvh, embree::Query& query, Vec3 origin, Vec3 d, Hit& hit, float* distance = nullptr) {
  RTCRayHit r;
  set_ray(r.ray, origin, d);
  if (distance) r.ray.tnear = *distance;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID, r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree::intersect1(bvh, query, r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  hit = {r.hit.primID, r.hit.u, r.hit.v};
  if (distance) *distance = r.ray.tfar;
  return true;
}

}  // namespace

Result<Intersector> Intersector::make(const Scene& scene) {
  if (scene.triangles.empty()) return Error{scene.path, "no triangles to trace"};
  auto impl = std::make_shared<Impl>();
  impl->scene = &scene, impl->see_through = see_through_materials(scene);
  impl->device = rtcNewDevice(nullptr);
  if (!impl->device) return Error{scene.path, "the ray tracer cannot start"};
  impl->bvh = rtcNewScene(impl->device);
  rtcSetSceneFlags(impl->bvh, RTCSceneFlags(RTC_SCENE_FLAG_ROBUST | embree::filtered));
  RTCGeometry mesh = rtcNewGeometry(impl->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  // Embree's own buffers: it reads 16 bytes at the last vertex.
  void* positions =
      rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), scene.positions.size());
  auto* corners = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(uint32_t), scene.triangles.size()));
  if (positions && corners) {
    std::memcpy(positions, scene.positions.data(), scene.positions.size() * sizeof(Vec3));
    for (const Triangle& t : scene.triangles) corners = std::copy(t.v, t.v + 3, corners);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(impl->bvh, mesh);
    // Which of two triangles at the same distance is hit depends on the order in the tree.
    run_serially([&] { rtcJoinCommitScene(impl->bvh); });
  }
  rtcReleaseGeometry(mesh);
  if (rtcGetDeviceError(impl->device) != RTC_ERROR_NONE)
    return Error{scene.path, "not enough memory to trace the scene"};
  Intersector intersector;
  intersector.impl_ = std::move(impl);
  return intersector;
}

bool Intersector::nearest(Vec3 origin, Vec3 d, Hit& hit) const {
  embree::Query query;
  return trace(impl_->bvh, query, origin, d, hit);
}

bool Intersector::nearest_visible(Vec3 origin, Vec3 d, Hit& hit) const {
  CameraContext camera;
  camera.query.filter = skip_backs, camera.scene = impl_->scene;
  return trace(impl_->bvh, camera.query, origin, d, hit);
}

bool Intersector::occluded(Vec3 origin, Vec3 d) const {
  embree::Query query;
  RTCRay ray;
  set_ray(ray, origin, d);
  embree::occluded1(impl_->bvh, query, ray);
  return ray.tfar < 0;
}

// Where a ray has come to, and what it has passed.
struct Intersector::Way {
  float distance = 0;
  std::vector<uint32_t> passed{};
  // Surfaces so near each other, for their distance, are one sheet, passed once: the two sides of a pane that is
  // modelled as two triangles, two triangles that share an edge.
  static constexpr float same_sheet = 1e-6f;
};

bool Intersector::lets_pass() const { return !impl_->see_through.empty(); }

// The next surface along the way, and the way to it; one that is of the same sheet as the last is passed already.
bool Intersector::next(Vec3 origin, Vec3 d, bool camera, Way& way, Hit& hit) const {
  for (;;) {
    CameraContext context;
    context.query.filter = skip_backs, context.scene = impl_->scene, context.passed = &way.passed;
    context.backs = !camera;
    const float last = way.distance;
    float distance = way.distance * (1 - Way::same_sheet);
    if (!trace(impl_->bvh, context.query, origin, d, hit, &distance)) return false;
    const bool solid = !impl_->see_through[impl_->scene->parts[impl_->scene->triangles[hit.triangle].part].material];
    const bool same = !way.passed.empty() && distance <= last * (1 + Way::same_sheet);
    if (solid || !same) return way.distance = distance, true;
    way.passed.push_back(hit.triangle);
  }
}

bool Intersector::met(Vec3 origin, Vec3 d, bool camera, float most, uint64_t key, Hit& hit, Vec3& weight) const {
  weight = Vec3(1);
  Way way;
  while (next(origin, d, camera, way, hit)) {
    const Triangle& t = impl_->scene->triangles[hit.triangle];
    const Material& material = impl_->scene->materials[impl_->scene->parts[t.part].material];
    const float covered = coverage(*impl_->scene, t, hit.u, hit.v);
    const Vec3 pass = transmittance(*impl_->scene, t, hit.u, hit.v);
    float on = largest(pass);
    if (covered > 0) on = std::min(on, largest(material.emissive) > 0 ? 0.5f : most);
    if (to_unit_float(uint32_t(hash64(key, uint64_t(hit.triangle)) >> 32)) >= on) {
      weight *= covered / (1 - on);
      return true;
    }
    weight *= pass / on;
    way.passed.push_back(hit.triangle);
  }
  return false;
}

Vec3 Intersector::transmitted(Vec3 origin, Vec3 d, float distance) const {
  Vec3 product(1);
  Hit hit;
  Way way;
  while (next(origin, d, false, way, hit) && way.distance < distance) {
    product *= transmittance(*impl_->scene, impl_->scene->triangles[hit.triangle], hit.u, hit.v);
    if (product == Vec3(0)) break;
    way.passed.push_back(hit.triangle);
  }
  return product;
}

SurfacePoint surface_point(const Scene& scene, const Hit& hit) {
  const Triangle& t = scene.triangles[hit.triangle];
  Vec3 a = scene.positions[t.v[0]], b = scene.positions[t.v[1]], c = scene.positions[t.v[2]];
  // Double precision: the only rounding left is the last one, to float.
  Vec3d ab = Vec3d(b) - Vec3d(a), ac = Vec3d(c) - Vec3d(a);
  Vec3d p = Vec3d(a) + double(hit.u) * ab + double(hit.v) * ac, n = cross(ab, ac);
  double length = lambent::length(n);
  Vec3 largest = max(max(abs(a), abs(b)), abs(c));
  SurfacePoint s;
  s.position = Vec3(p);
  s.ng = length > 0 ? Vec3(n / length) : Vec3(0, 0, 1);
  s.offset = offset_ulps * 0x1p-24f * std::max({largest.x, largest.y, largest.z});
  return s;
}

}  // namespace lambent::reference

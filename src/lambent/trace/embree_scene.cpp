#include <lambent/core/parallel.h>
#include <lambent/trace/copies.h>
#include <lambent/trace/embree_scene.h>

#include <algorithm>
#include <cstring>
#include <numeric>

namespace lambent {
namespace {

// What Embree takes: a triangle in a tree of high quality with its corners (scripts/bench load prints the tracer's
// bytes), and, at most, a copy with its transformations and its place in the tree over all copies.
constexpr double triangle_bytes = 85, copy_bytes = 1000;
constexpr uint32_t least_triangles = 64;
// Little is not worth the last bits that hits differ by.
constexpr double least_saved = 8e6;

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

double saved(const Scene& scene, const Shape& shape) {
  return double(shape.copies.size() - 1) * scene.parts[shape.part].triangle_count * triangle_bytes -
         double(shape.copies.size()) * copy_bytes;
}

// Whether parts of equal size are so many that it is worth a look.
bool may_save(const Scene& scene) {
  std::vector<uint32_t> sizes;
  for (const Part& part : scene.parts)
    if (part.triangle_count >= least_triangles) sizes.push_back(part.triangle_count);
  std::sort(sizes.begin(), sizes.end());
  double most = 0;
  for (size_t i = 1; i < sizes.size(); ++i)
    if (sizes[i] == sizes[i - 1]) most += sizes[i] * triangle_bytes - copy_bytes;
  return most >= least_saved;
}

std::vector<Shape> choose_shapes(const Scene& scene, Sharing sharing) {
  if (sharing == Sharing::never) return {};
  if (sharing == Sharing::always) return find_shapes(scene, 1);
  if (!may_save(scene)) return {};
  std::vector<Shape> shapes = find_shapes(scene, least_triangles);
  std::erase_if(shapes, [&](const Shape& s) { return saved(scene, s) <= 0; });
  double sum = 0;
  for (const Shape& s : shapes) sum += saved(scene, s);
  return sum >= least_saved ? std::move(shapes) : std::vector<Shape>();
}

}  // namespace

EmbreeScene::~EmbreeScene() {
  if (top_) rtcReleaseScene(top_);
  for (RTCScene shape : shapes_) rtcReleaseScene(shape);
  if (device_) rtcReleaseDevice(device_);
}

// One mesh of some parts, about an origin; of the whole scene where none are named.
bool EmbreeScene::add_mesh(RTCScene scene, const Scene& source, const std::vector<uint32_t>& parts, Vec3d origin) {
  const bool whole = parts.empty();
  size_t vertices = whole ? source.positions.size() : 0, triangles = whole ? source.triangles.size() : 0;
  for (uint32_t p : parts) vertices += source.parts[p].vertex_count, triangles += source.parts[p].triangle_count;
  RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* positions = static_cast<Vec3*>(
      rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3), vertices));
  auto* indices = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), triangles));
  if (!positions || !indices) {
    rtcReleaseGeometry(mesh);
    return false;
  }
  uint32_t placed = 0;
  auto add = [&](size_t first_vertex, size_t vertex_count, size_t first_triangle, size_t triangle_count) {
    for (size_t v = first_vertex; v < first_vertex + vertex_count; ++v)
      *positions++ = Vec3(Vec3d(source.positions[v]) - origin);
    for (size_t t = first_triangle; t < first_triangle + triangle_count; ++t)
      for (uint32_t v : source.triangles[t].v) *indices++ = v - uint32_t(first_vertex) + placed;
    placed += uint32_t(vertex_count);
  };
  if (whole) add(0, vertices, 0, triangles);
  for (uint32_t p : parts) {
    const Part& part = source.parts[p];
    add(part.first_vertex, part.vertex_count, part.first_triangle, part.triangle_count);
  }
  rtcCommitGeometry(mesh);
  rtcAttachGeometry(scene, mesh);
  rtcReleaseGeometry(mesh);
  return true;
}

bool EmbreeScene::add_copies(const Scene& source, const std::vector<Shape>& shapes, bool filters) {
  first_copy_ = apart_.empty() ? 0 : 1;
  for (const Shape& shape : shapes) {
    RTCScene scene = rtcNewScene(device_);
    shapes_.push_back(scene);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    if (filters) rtcSetSceneFlags(scene, embree::filtered);
    if (!add_mesh(scene, source, {shape.part}, shape.middle)) return false;
    rtcCommitScene(scene);
    for (const Copy& c : shape.copies) {
      const float place[12] = {c.turn[0].x, c.turn[0].y, c.turn[0].z, c.turn[1].x, c.turn[1].y, c.turn[1].z,
                               c.turn[2].x, c.turn[2].y, c.turn[2].z, c.at.x,      c.at.y,      c.at.z};
      RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(instance, scene);
      rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, place);
      rtcCommitGeometry(instance);
      const unsigned number = rtcAttachGeometry(top_, instance);
      rtcReleaseGeometry(instance);
      if (number != first_copy_ + copies_.size()) return false;  // only where memory is out
      const float sign = c.flipped ? -1.0f : 1.0f;
      copies_.push_back({source.parts[c.part].first_triangle, c.flipped,
                         Mat3(cross(c.turn[1], c.turn[2]) * sign, cross(c.turn[2], c.turn[0]) * sign,
                              cross(c.turn[0], c.turn[1]) * sign)});
    }
  }
  return true;
}

Result<void> EmbreeScene::build(const Scene& source, bool filters, Sharing sharing, Progress* progress) {
  device_ = rtcNewDevice(nullptr);
  if (!device_) return Error{source.path, "the ray tracer could not start"};
  rtcSetDeviceMemoryMonitorFunction(
      device_,
      [](void* user, ssize_t bytes, bool) {
        static_cast<EmbreeScene*>(user)->bytes_ += bytes;
        return true;
      },
      this);
  top_ = rtcNewScene(device_);
  rtcSetSceneBuildQuality(top_, RTC_BUILD_QUALITY_HIGH);
  if (filters) rtcSetSceneFlags(top_, embree::filtered);
  const std::vector<Shape> shapes = choose_shapes(source, sharing);
  std::vector<bool> shared(source.parts.size());
  for (const Shape& shape : shapes)
    for (const Copy& copy : shape.copies) shared[copy.part] = true;
  std::vector<uint32_t> parts;  // that are not; all of the scene without copies
  for (uint32_t p = 0; p < source.parts.size() && !shapes.empty(); ++p) {
    const Part& part = source.parts[p];
    if (shared[p] || part.triangle_count == 0) continue;
    parts.push_back(p);
    for (uint32_t t = 0; t < part.triangle_count; ++t) apart_.push_back(part.first_triangle + t);
  }
  Build building{{progress, "ray tree", build_units}};
  rtcSetSceneProgressMonitorFunction(top_, Build::advance, &building);
  // A build on many threads may order the leaves differently from run to run, and with them the winner of exact ties.
  bool made = true;
  run_serially([&] {
    const bool has_mesh = shapes.empty() || !parts.empty();
    made = (!has_mesh || add_mesh(top_, source, parts, Vec3d(0))) && add_copies(source, shapes, filters);
    if (made) rtcCommitScene(top_);
  });
  rtcSetSceneProgressMonitorFunction(top_, nullptr, nullptr);
  if (is_cancelled(progress)) return Error{"", "cancelled"};
  if (!made || rtcGetDeviceError(device_) != RTC_ERROR_NONE)
    return Error{source.path, "out of memory for the ray tracer"};
  return {};
}

}  // namespace lambent

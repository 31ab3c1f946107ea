#include <lambent/bake/bake.h>
#include <lambent/bake/features.h>
#include <lambent/core/parallel.h>
#include <lambent/scene/arrays.h>

#include <numbers>

namespace lambent {
namespace {

// The mesh as it is: two-sided, so that no receiver counts as buried.
Scene two_sided_scene(std::span<const Vec3> vertices, std::span<const uint32_t> faces) {
  Scene scene;
  scene.path = "arrays";
  scene.positions.assign(vertices.begin(), vertices.end()), scene.normals.resize(vertices.size(), Vec3(0, 1, 0));
  for (size_t i = 0; i < faces.size(); i += 3)
    scene.triangles.push_back({{faces[i], faces[i + 1], faces[i + 2]}, 0, true});
  Part part;
  part.vertex_count = uint32_t(vertices.size()), part.triangle_count = uint32_t(scene.triangles.size());
  scene.parts.push_back(part);
  scene.materials.emplace_back();
  return scene;
}

}  // namespace

std::vector<Vec3> angle_normals(std::span<const Vec3> vertices, std::span<const uint32_t> faces) {
  std::vector<Vec3d> sums(vertices.size());
  for (size_t i = 0; i + 2 < faces.size(); i += 3) {
    const Vec3d p[3] = {Vec3d(vertices[faces[i]]), Vec3d(vertices[faces[i + 1]]), Vec3d(vertices[faces[i + 2]])};
    const Vec3d normal = cross(p[1] - p[0], p[2] - p[0]);
    if (!(length(normal) > 0)) continue;
    for (size_t k = 0; k < 3; ++k) {
      const Vec3d a = p[(k + 1) % 3] - p[k], b = p[(k + 2) % 3] - p[k];
      sums[faces[i + k]] += normal / length(normal) * std::atan2(length(cross(a, b)), dot(a, b));
    }
  }
  std::vector<Vec3> normals(vertices.size());
  for (size_t v = 0; v < sums.size(); ++v)
    if (length(sums[v]) > 1e-9) normals[v] = Vec3(sums[v] / length(sums[v]));
  return normals;
}

Result<std::vector<float>> prt_features(std::span<const Vec3> vertices, std::span<const uint32_t> faces,
                                        std::span<const Vec3> normals, const FeatureOptions& options,
                                        Progress* progress) {
  if (!(options.offset > 0 && options.offset <= 1)) return Error{"offset", "must lie in (0, 1]", true};
  const std::vector<Vec3d> wide(vertices.begin(), vertices.end());
  if (auto checked = scene_from_arrays({.vertices = wide, .faces = faces, .normals = normals}); !checked)
    return checked.error();
  const Scene scene = two_sided_scene(vertices, faces);
  auto tracer = Tracer::build(scene, progress);
  if (!tracer) return tracer.error();
  const Bounds box = bounds(scene);
  const Vec3 size = box.max - box.min;
  const float lift = options.offset * std::min({size.x, size.y, size.z});
  if (!(lift > 0)) return Error{"vertices", "lie in a plane: there is no least extent to lift rays by", true};
  Receivers receivers;
  std::vector<Vec3> places;
  std::vector<uint32_t> used;
  for (uint32_t v = 0; v < vertices.size(); ++v)
    if (length(normals[v]) > 0) used.push_back(v), places.push_back(vertices[v]);
  std::vector<uint32_t> vertex_of;  // of receivers, along a curve as everywhere
  for (uint32_t i : curve_order(places, box)) {
    const Vec3 n = normalize(normals[used[i]]);
    receivers.origins.push_back(vertices[used[i]] + n * lift), receivers.normals.push_back(n);
    vertex_of.push_back(used[i]);
  }
  const std::vector<uint32_t> any_receiver(vertices.size(), 0);
  receivers.basis = corner_receivers(scene, any_receiver, any_receiver);
  BakeOptions bake_options{.order = options.order, .samples = options.samples};
  bake_options.bounces = 0, bake_options.seed = options.seed, bake_options.precision = Precision::single;
  bake_options.certify = false, bake_options.denoise = false;  // which took half as long again for no less error
  auto transfer = bake(scene, *tracer, receivers, bake_options, nullptr, progress);
  if (!transfer) return transfer.error();
  const size_t columns = transfer->columns();
  std::vector<float> out(vertices.size() * columns);
  parallel_for(receivers.count(), 1024, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      const std::vector<float> row = load_receiver(*transfer, r);
      for (size_t k = 0; k < columns; ++k) out[vertex_of[r] * columns + k] = row[k] * float(std::numbers::pi);
    }
  });
  return out;
}

}  // namespace lambent

// Follows: locally-adaptive-products, section 5 (vertices are culled before they are shaded).
#include <lambent/render/products.h>

#include <map>

namespace lambent {

ProductReceivers make_product_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                        const std::vector<uint32_t>& back, size_t count, const Reflection& reflection,
                                        const Cube& cube, const Sampling& sampling) {
  ProductReceivers out;
  out.positions.assign(count, Vec3(0)), out.frames.assign(count, Mat3(1.0f)), out.material_of.assign(count, 0);
  std::vector<Vec3> face_normal(scene.positions.size(), Vec3(0));
  for (const Triangle& t : scene.triangles)
    for (uint32_t v : t.v) face_normal[v] += area_normal(scene, t);
  const bool varied = !reflection.everywhere || !reflection.named.empty();
  // One for all that it is named for, or that nothing is: those do not vary.
  std::map<const Reflection::Named*, ProductMaterial> same;
  out.materials.resize(varied ? count : 1);
  if (!varied) out.materials[0] = make_product_material(*reflection.everywhere, cube, sampling);
  std::vector<uint8_t> done(count, 0);
  for (const Triangle& t : scene.triangles)
    for (int k = 0; k < 3; ++k)
      for (const auto* side : {&front, &back}) {
        if (side->empty()) continue;
        const uint32_t v = t.v[k], r = (*side)[v];
        if (r == none || done[r]) continue;
        done[r] = 1;
        Vec3 n = scene.normals[v];
        if ((dot(n, face_normal[v]) < 0) != (side == &back)) n = -n;
        out.positions[r] = scene.positions[v], out.frames[r] = shading_frame(scene, t, n);
        if (!varied) continue;
        out.material_of[r] = r;
        const Reflection::Named* named = named_for(reflection, scene, t);
        auto make = [&] {
          return make_product_material(surface_brdf(scene, reflection, t, k == 1, k == 2), cube, sampling);
        };
        if (named ? named->textured : !reflection.everywhere) {
          out.materials[r] = make();
          continue;
        }
        auto known = same.find(named);
        if (known == same.end()) known = same.emplace(named, make()).first;
        out.materials[r] = known->second;
      }
  return out;
}

std::vector<uint32_t> seen_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                     const std::vector<uint32_t>& back, size_t count, const Camera& camera, int width,
                                     int height) {
  const CameraRays rays(camera, width, height);
  // Planes through the eye and the picture's sides, inward.
  const Vec3 right = rays.dx * float(width), down = rays.dy * float(height), corner = rays.corner;
  const Vec3 forward = corner + 0.5f * (right + down);
  Vec3 planes[4] = {cross(corner, down), cross(corner + right, down), cross(corner, right),
                    cross(corner + down, right)};
  for (Vec3& p : planes)
    if (dot(p, forward) < 0) p = -p;
  std::vector<uint8_t> wanted(count, 0);
  for (const Triangle& t : scene.triangles) {
    const Vec3 a = scene.positions[t.v[0]] - rays.eye, b = scene.positions[t.v[1]] - rays.eye,
               c = scene.positions[t.v[2]] - rays.eye;
    const bool is_front = dot(area_normal(scene, t), a) < 0;
    const auto& side = is_front ? front : back;
    if (side.empty()) continue;
    bool outside = false;
    for (const Vec3& p : planes) outside |= std::max({dot(p, a), dot(p, b), dot(p, c)}) < 0;
    if (outside) continue;
    for (uint32_t v : t.v)
      if (side[v] != none) wanted[side[v]] = 1;
  }
  std::vector<uint32_t> seen;
  for (size_t r = 0; r < count; ++r)
    if (wanted[r]) seen.push_back(uint32_t(r));
  return seen;
}

}  // namespace lambent

// glTF 2.0, section 3.9.2 and appendix B: the material model. Tangents by the gradient of a texture coordinate.
#include <lambent/scene/reflection.h>

namespace lambent {
namespace {

// Direction of growing first texture coordinate, zero where there is none: solves [ab ac] = [t b] [uv_ab uv_ac] for t, up to scale.
Vec3 texture_tangent(const Scene& scene, const Triangle& triangle) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return Vec3(0);
  const Vec3 a = scene.positions[triangle.v[0]];
  const Vec3 ab = scene.positions[triangle.v[1]] - a, ac = scene.positions[triangle.v[2]] - a;
  const Vec2 p = uv[triangle.v[1]] - uv[triangle.v[0]], q = uv[triangle.v[2]] - uv[triangle.v[0]];
  const float area = p.x * q.y - p.y * q.x;
  return area == 0 ? Vec3(0) : (ab * q.y - ac * p.y) * std::copysign(1.0f, area);
}

// The part of v that is square to n, as a unit vector; zero where v is (nearly) along n.
Vec3 square_to(Vec3 v, Vec3 n) {
  constexpr float least_sine = 0.01f;  // below it rounding would turn the frame askew
  const float length = glm::length(v);
  if (!(length > 0 && std::isfinite(length))) return Vec3(0);
  v /= length;
  const Vec3 t = v - n * glm::dot(v, n);
  const float sine = glm::length(t);
  return sine > least_sine ? t / sine : Vec3(0);
}

}  // namespace

Brdf surface_brdf(const Scene& scene, const Reflection& reflection, const Triangle& triangle, float u, float v) {
  if (reflection.everywhere) return *reflection.everywhere;
  const Vec3 color = albedo(scene, triangle, u, v);
  if (reflection.model == Reflection::Model::diffuse) return Lambert{color};
  const Vec2 m = metallic_roughness(scene, triangle, u, v);
  return MetallicRoughness{color, m.x, m.y};
}

Mat3 shading_frame(const Scene& scene, const Triangle& triangle, Vec3 n) {
  Vec3 t = square_to(texture_tangent(scene, triangle), n);
  if (t == Vec3(0)) t = square_to(glm::cross(Vec3(0, 1, 0), n), n);
  if (t == Vec3(0)) t = square_to(Vec3(1, 0, 0), n);
  return {t, glm::cross(n, t), n};
}

}  // namespace lambent

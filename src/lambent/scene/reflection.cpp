// glTF 2.0, section 3.9.2 and appendix B: the material model. Tangents by the gradient of a texture coordinate.
#include <lambent/scene/reflection.h>

namespace lambent {
namespace {

// Direction of growing first texture coordinate, zero where there is none: solves [ab ac] = [t b] [uv_ab uv_ac] for t,
// up to scale. w: 1 where the front shows the picture as it is, v pointing down; -1 where it shows it mirrored.
Vec4 texture_tangent(const Scene& scene, const Triangle& triangle, int set = 0,
                     const std::array<float, 6>& transform = {1, 0, 0, 0, 1, 0}) {
  if (scene.texcoords[size_t(set)].empty()) return Vec4(0);
  const Vec2 uv = texture_place(scene, triangle, 0, 0, set, transform);
  const Vec2 p = texture_place(scene, triangle, 1, 0, set, transform) - uv,
             q = texture_place(scene, triangle, 0, 1, set, transform) - uv;
  const Vec3 a = scene.positions[triangle.v[0]];
  const Vec3 ab = scene.positions[triangle.v[1]] - a, ac = scene.positions[triangle.v[2]] - a;
  const float area = p.x * q.y - p.y * q.x;
  return area == 0 ? Vec4(0) : Vec4((ab * q.y - ac * p.y) * std::copysign(1.0f, area), area < 0 ? 1 : -1);
}

// The part of v that is square to n, as a unit vector; zero where v is (nearly) along n.
Vec3 square_to(Vec3 v, Vec3 n) {
  constexpr float least_sine = 0.01f;  // below it rounding would turn the frame askew
  const float length = lambent::length(v);
  if (!(length > 0 && std::isfinite(length))) return Vec3(0);
  v /= length;
  const Vec3 t = v - n * dot(v, n);
  const float sine = lambent::length(t);
  return sine > least_sine ? t / sine : Vec3(0);
}

Brdf tinted(Brdf brdf, Vec3 color) {
  std::visit(
      [&](auto& b) {
        using T = std::remove_cvref_t<decltype(b)>;
        if constexpr (std::is_same_v<T, Lambert>) b.albedo *= color;
        else if constexpr (std::is_same_v<T, Ggx>) b.f0 *= color;
        else if constexpr (std::is_same_v<T, MetallicRoughness>) b.base_color *= color;
        else if constexpr (!std::is_same_v<T, Measured>) b.diffuse *= color;
      },
      brdf);
  return brdf;
}

}  // namespace

const Reflection::Named* named_for(const Reflection& reflection, const Scene& scene, const Triangle& triangle) {
  if (reflection.named.empty()) return nullptr;
  const std::string& name = scene.materials[scene.parts[triangle.part].material].name;
  for (const Reflection::Named& n : reflection.named)
    if (n.material == name) return &n;
  return nullptr;
}

Brdf surface_brdf(const Scene& scene, const Reflection& reflection, const Triangle& triangle, float u, float v) {
  if (const Reflection::Named* n = named_for(reflection, scene, triangle))
    return n->textured ? tinted(n->brdf, albedo(scene, triangle, u, v)) : n->brdf;
  if (reflection.everywhere) return *reflection.everywhere;
  const Vec3 color = albedo(scene, triangle, u, v);
  if (reflection.model == Reflection::Model::diffuse) return Lambert{color};
  const Vec2 m = metallic_roughness(scene, triangle, u, v);
  const Material& material = scene.materials[scene.parts[triangle.part].material];
  return MetallicRoughness{color, m.x, m.y, material.dielectric_f0, material.dielectric_f90};
}

Mat3 shading_frame(const Scene& scene, const Triangle& triangle, Vec3 n) {
  Vec3 t = square_to(Vec3(texture_tangent(scene, triangle)), n);
  if (t == Vec3(0)) t = square_to(cross(Vec3(0, 1, 0), n), n);
  if (t == Vec3(0)) t = square_to(Vec3(1, 0, 0), n);
  return {t, cross(n, t), n};
}

Vec3 mapped_normal(const Scene& scene, const Triangle& triangle, float u, float v, Vec3 n) {
  const Material& m = scene.materials[scene.parts[triangle.part].material];
  if (m.normal_texture < 0) return n;
  Vec4 along = scene.tangents.empty() ? Vec4(0) : interpolate(scene.tangents, triangle, u, v);
  Vec3 t = square_to(Vec3(along), n);
  if (t == Vec3(0) || along.w == 0)
    along = texture_tangent(scene, triangle, m.normal_set, m.normal_transform), t = square_to(Vec3(along), n);
  if (t == Vec3(0)) return n;
  const Vec3 texel = sample_linear_texture(scene.textures[size_t(m.normal_texture)],
                                           texture_place(scene, triangle, u, v, m.normal_set, m.normal_transform));
  const Vec3 bent = (2.0f * texel - Vec3(1)) * Vec3(m.normal_scale, m.normal_scale, 1);
  const Vec3 b = cross(n, t) * (along.w > 0 ? 1.0f : -1.0f);
  return normalize_or(t * bent.x + b * bent.y + n * bent.z, n);
}

}  // namespace lambent

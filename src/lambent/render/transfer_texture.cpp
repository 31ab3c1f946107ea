// Follows: local-deformable-prt, section 5, pixel by pixel.
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/render/transfer_texture.h>

namespace lambent {
namespace {

// Equation 13 for one receiver turned by R; channels of light and transfer as everywhere.
Vec3 exit_radiance(const ZonalTransfer& t, std::span<const float> values, const Mat3& R, std::span<const Vec3> light) {
  const size_t exact = size_t(t.exact_bands()), exact_count = exact * exact, bands = size_t(t.order) - exact;
  Vec3 sum(0.0f);
  for (int c = 0; c < 3; ++c) {
    const float* f = values.data() + (t.channels == 3 ? size_t(c) * exact_count : 0);
    sum[c] = f[0] * light[0][c];
    if (exact == 2) sum[c] += glm::dot(R * Vec3(-f[3], -f[1], f[2]), Vec3(-light[3][c], -light[1][c], light[2][c]));
  }
  float y[sh_count(max_sh_order)];
  for (int i = 0; i < t.lobes; ++i) {
    evaluate_sh(t.order, normalize_or(R * lobe_axis(t, values, i), {0, 0, 1}), y);
    const float* g = values.data() + t.exact_values() + size_t(i) * t.lobe_values() + 3;
    for (size_t l = exact; l < size_t(t.order); ++l) {
      Vec3 band(0.0f);
      for (size_t k = l * l; k < (l + 1) * (l + 1); ++k) band += y[k] * light[k];
      for (int c = 0; c < 3; ++c) sum[c] += g[(t.channels == 3 ? size_t(c) * bands : 0) + l - exact] * band[c];
    }
  }
  return sum;
}

}  // namespace

Mat3 texture_frame(const Scene& scene, const Triangle& t, Vec3 normal) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return frame_about(normal);
  const Vec3 e1 = scene.positions[t.v[1]] - scene.positions[t.v[0]], e2 = scene.positions[t.v[2]] - scene.positions[t.v[0]];
  const Vec2 d1 = uv[t.v[1]] - uv[t.v[0]], d2 = uv[t.v[2]] - uv[t.v[0]];
  const float area = d1.x * d2.y - d2.x * d1.y;
  if (!(std::abs(area) > 0) || !std::isfinite(area)) return frame_about(normal);
  // dP/du across the normal; the sign of the area says whether +u, -v and the normal are right-handed.
  Vec3 along = (e1 * d2.y - e2 * d1.y) / area;
  along -= normal * glm::dot(normal, along);
  if (!(glm::dot(along, along) > 0)) return frame_about(normal);
  along = normalize_or(along, frame_about(normal)[0]);
  Vec3 up = glm::cross(normal, along);
  const Vec3 dv = (e2 * d1.x - e1 * d2.x) / area;
  if (glm::dot(up, dv) > 0) up = -up;
  return {along, up, normal};
}

Result<Image> render_transfer_texture(const Scene& scene, const Tracer& tracer, const ZonalTexture& texture, Vec2 tile, std::span<const Vec3> light,
                                      const Camera& camera, const RenderOptions& options, Progress* progress) {
  LAMBENT_CHECK(light.size() >= size_t(sh_count(texture.transfer.order)));
  return render_surfaces(scene, tracer, camera, options, [&]() -> SurfaceShade {
    return [&, values = std::vector<float>(texture.transfer.receiver_values())](const Hit& hit, Vec3) mutable {
      const Triangle& t = scene.triangles[hit.triangle];
      Vec3 normal = normalize_or(interpolate(scene.normals, t, hit.u, hit.v), {0, 0, 1});
      if (!hit.front) normal = -normal;
      const Vec2 uv = scene.texcoords[0].empty() ? Vec2(0.0f) : interpolate(scene.texcoords[0], t, hit.u, hit.v);
      sample_zonal_texture(texture, uv * tile, values);
      const Vec3 white = exit_radiance(texture.transfer, values, texture_frame(scene, t, normal), light);
      return options.albedo ? albedo(scene, t, hit.u, hit.v) * white : white;
    };
  }, progress);
}

}  // namespace lambent

// Follows: local-deformable-prt, section 5, pixel by pixel.
#include <lambent/relight/zonal.h>
#include <lambent/render/transfer_texture.h>

namespace lambent {
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
  return render_surfaces(scene, tracer, camera, options, [&]() -> SurfaceShade {
    return [&, values = std::vector<float>(texture.transfer.receiver_values())](const Hit& hit, Vec3) mutable {
      const Triangle& t = scene.triangles[hit.triangle];
      Vec3 normal = normalize_or(interpolate(scene.normals, t, hit.u, hit.v), {0, 0, 1});
      if (!hit.front) normal = -normal;
      const Vec2 uv = scene.texcoords[0].empty() ? Vec2(0.0f) : interpolate(scene.texcoords[0], t, hit.u, hit.v);
      sample_zonal_texture(texture, uv * tile, values);
      const Vec3 white = shade_zonal(texture.transfer, values, texture_frame(scene, t, normal), light);
      if (options.show == RenderOptions::Show::radiosity) return white;
      const Vec3 colour = albedo(scene, t, hit.u, hit.v);
      return options.show == RenderOptions::Show::albedo ? colour : colour * white;
    };
  }, progress);
}

}  // namespace lambent

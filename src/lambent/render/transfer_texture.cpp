// Follows: local-deformable-prt, section 5, pixel by pixel.
#include <lambent/relight/dering.h>
#include <lambent/relight/zonal.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/core/sampling.h>

namespace lambent {
Mat3 texture_frame(const Scene& scene, const Triangle& t, Vec3 normal) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return frame_about(normal);
  const Vec3 e1 = scene.positions[t.v[1]] - scene.positions[t.v[0]],
             e2 = scene.positions[t.v[2]] - scene.positions[t.v[0]];
  const Vec2 d1 = uv[t.v[1]] - uv[t.v[0]], d2 = uv[t.v[2]] - uv[t.v[0]];
  const float area = d1.x * d2.y - d2.x * d1.y;
  if (!(std::abs(area) > 0) || !std::isfinite(area)) return frame_about(normal);
  // dP/du across the normal; the sign of the area says whether +u, -v and the normal are right-handed.
  Vec3 along = (e1 * d2.y - e2 * d1.y) / area;
  along -= normal * dot(normal, along);
  if (!(dot(along, along) > 0)) return frame_about(normal);
  along = normalize_or(along, frame_about(normal)[0]);
  Vec3 up = cross(normal, along);
  const Vec3 dv = (e2 * d1.x - e1 * d2.x) / area;
  if (dot(up, dv) > 0) up = -up;
  return {along, up, normal};
}

Mat3 groove_frame(const Scene& scene, const Triangle& t, Vec2 tile, Vec3 normal) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  if (uv.empty()) return frame_about(normal);
  // Doubles: edges and coordinates of any size, to the fourth power.
  const Vec3d p(scene.positions[t.v[0]]), e1 = Vec3d(scene.positions[t.v[1]]) - p,
                                          e2 = Vec3d(scene.positions[t.v[2]]) - p, a = cross(e1, e2);
  const Vec2d d1(uv[t.v[1]] - uv[t.v[0]]), d2(uv[t.v[2]] - uv[t.v[0]]);
  // The gradient of tile . uv over the triangle, in the plane of the normal.
  Vec3d across = dot(Vec2d(tile), d1) * cross(e2, a) - dot(Vec2d(tile), d2) * cross(e1, a);
  across -= Vec3d(normal) * dot(Vec3d(normal), across);
  const double length = lambent::length(across);
  if (!(length > 0 && std::isfinite(length))) return frame_about(normal);
  const Vec3 x(across / length);
  return {x, cross(normal, x), normal};
}

namespace {

// At a place on a triangle, as many coefficients as `out` has.
void arriving_here(const ArrivingLight& light, const Corners& corners, const Hit& hit, std::span<Vec3> out) {
  const size_t n = size_t(sh_count(light.order)), count = std::min(n, out.size());
  const float weights[3] = {1 - hit.u - hit.v, hit.u, hit.v};
  const Vec3* from[3];
  for (size_t i = 0; i < 3; ++i) from[i] = light.light.data() + size_t(corners.receiver[i]) * n;
  for (size_t k = 0; k < count; ++k)
    out[k] = weights[0] * from[0][k] + weights[1] * from[1][k] + weights[2] * from[2][k];
  std::fill(out.begin() + ptrdiff_t(count), out.end(), Vec3(0.0f));
}

constexpr size_t most_views = 16;

// What is looked up of a texture at a hit: rows of it, and what each counts for.
struct ReliefValues {
  std::vector<float> values;  // [row][value]
  std::array<float, most_views> weights{1};
  size_t rows = 1;
  Vec3 shade(const ZonalTransfer& transfer, const Mat3& frame, std::span<const Vec3> light) const {
    Vec3 sum(0.0f);
    const size_t n = transfer.row_values();
    for (size_t k = 0; k < rows; ++k)
      if (weights[k] != 0) sum += weights[k] * shade_zonal(transfer, std::span(values).subspan(k * n, n), frame, light);
    // Of few views the cubic overshoots beside a bright one.
    return rows == 1 ? sum : max(sum, Vec3(0.0f));
  }
};

// The nodes of a grid of views that a direction is made of, and their weights: Catmull and Rom's cubic each way, since
// a highlight is bent between views, and straight lines between them lie above it (docs/zonal.md).
struct SmoothViewMix {
  std::array<size_t, most_views> nodes;
  std::array<float, most_views> weights;
};
SmoothViewMix mix_views_smoothly(int grid, Vec3 wo) {
  const float z = std::clamp(wo.z, 0.0f, 1.0f);
  const Vec2 flat(normalize_or(Vec3(wo.x, wo.y, 0), Vec3(0)));
  const Vec2 square = disk_to_square(flat * std::sqrt(1 - z)) * float(grid - 1);
  int node[2][4];
  float weight[2][4];
  for (int axis = 0; axis < 2; ++axis) {
    const int first = std::min(int(square[axis]), grid - 2);
    const float f = square[axis] - float(first), f2 = f * f, f3 = f2 * f;
    const float w[4] = {(-f + 2 * f2 - f3) / 2, (2 - 5 * f2 + 3 * f3) / 2, (f + 4 * f2 - 3 * f3) / 2, (f3 - f2) / 2};
    for (int k = 0; k < 4; ++k) node[axis][k] = std::clamp(first + k - 1, 0, grid - 1), weight[axis][k] = w[k];
  }
  SmoothViewMix mix;
  for (size_t k = 0; k < most_views; ++k) {
    const size_t x = k % 4, y = k / 4;
    mix.nodes[k] = size_t(node[1][y]) * size_t(grid) + size_t(node[0][x]), mix.weights[k] = weight[0][x] * weight[1][y];
  }
  return mix;
}

// As seen from the unit direction `view`, in the texture's frame.
void sample_views(const ZonalTexture& texture, Vec2 uv, Vec3 view, ReliefValues& out) {
  const size_t n = texture.transfer.row_values();
  if (texture.views == 0) return sample_zonal_texture(texture, uv, std::span(out.values).first(n));
  const SmoothViewMix mix = mix_views_smoothly(texture.views, view);
  out.rows = most_views, out.weights = mix.weights;
  for (size_t k = 0; k < most_views; ++k)
    if (mix.weights[k] != 0) sample_zonal_texture(texture, uv, std::span(out.values).subspan(k * n, n), mix.nodes[k]);
}

// What leaves the relief, white, at a hit, given its values there; `here` and `near` are scratch.
Vec3 shade_relief(const ZonalTransfer& transfer, const ReliefValues& values, const Mat3& frame, const Hit& hit,
                  Vec3 place, const LocalLight& light, const ArrivingAt* arriving, std::vector<Vec3>& here,
                  std::vector<Vec3>& near) {
  if (!arriving) {
    if (!light.lamps.empty()) light_at(light, place, here);
    return values.shade(transfer, frame, here);
  }
  const Corners* corners = arriving->corners.find(hit.triangle, hit.front);
  if (!corners) return Vec3(0.0f);
  arriving_here(arriving->light, *corners, hit, here);
  if (!light.lamps.empty()) {
    near.resize(here.size());
    light_at(light, place, near);
    for (size_t k = 0; k < here.size(); ++k) here[k] += near[k] - light.distant[k];
  }
  const Vec3 white = values.shade(transfer, frame, here);
  if (!arriving->peaks) return white;
  arriving_here(*arriving->peaks, *corners, hit, here);
  return dering(white, values.shade(transfer, frame, here));
}

}  // namespace

std::function<SurfaceShade()> transfer_texture_shade(const Scene& scene, const ZonalTexture& texture,
                                                     const TextureUse& use, const LocalLight& light,
                                                     RenderOptions::Show show, const ArrivingAt* arriving) {
  return [&, show, arriving]() -> SurfaceShade {
    return [&, show, arriving, values = ReliefValues{std::vector<float>(most_views * texture.transfer.row_values())},
            here = light.distant, near = std::vector<Vec3>()](const Hit& hit, Vec3 direction) mutable {
      const Triangle& t = scene.triangles[hit.triangle];
      Vec3 normal = normalize_or(interpolate(scene.normals, t, hit.u, hit.v), {0, 0, 1});
      if (!hit.front) normal = -normal;
      const bool placed = !scene.texcoords[0].empty();
      const Vec2 uv = placed ? interpolate(scene.texcoords[0], t, hit.u, hit.v) : Vec2(0.0f);
      Mat3 frame;
      if (texture.groove_depth > 0) {
        const Vec2 tile = use.pressed_tile.empty() ? use.tile : use.pressed_tile[hit.triangle];
        const float phase = dot(uv, tile), x = (phase - std::floor(phase) - 0.5f) / use.groove_width,
                    depth = use.pressed_depth.empty() ? use.groove_depth
                                                      : interpolate(use.pressed_depth, t, hit.u, hit.v);
        sample_groove(texture, placed ? x : 1, depth * (use.groove_map ? use.groove_map(uv) : 1),
                      std::span(values.values).first(texture.transfer.row_values()));
        frame = groove_frame(scene, t, tile, normal);
      } else {
        frame = texture_frame(scene, t, normal);
        sample_views(texture, uv * use.tile, -direction * frame, values);
      }
      const Vec3 white = shade_relief(texture.transfer, values, frame, hit,
                                      interpolate(scene.positions, t, hit.u, hit.v), light, arriving, here, near);
      if (show == RenderOptions::Show::radiosity) return white;
      const Vec3 colour = albedo(scene, t, hit.u, hit.v);
      return show == RenderOptions::Show::albedo ? colour : colour * white;
    };
  };
}

Result<Image> render_transfer_texture(const Scene& scene, const Tracer& tracer, const ZonalTexture& texture,
                                      const TextureUse& use, const LocalLight& light, const Camera& camera,
                                      const RenderOptions& options, Progress* progress, const ArrivingAt* arriving) {
  return render_surfaces(scene, tracer, camera, options,
                         transfer_texture_shade(scene, texture, use, light, options.show, arriving), progress);
}

}  // namespace lambent

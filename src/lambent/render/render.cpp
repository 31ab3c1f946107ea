#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/render/render.h>
#include <lambent/scene/lights.h>
#include <lambent/scene/reflection.h>

namespace lambent {
namespace {

// The first surface that shows itself to the camera.
Hit first_visible(const Scene& scene, const Tracer& tracer, Vec3 eye, Vec3 direction) {
  float from = 0;
  for (int skipped = 0; skipped < 64; ++skipped) {
    const Hit hit = tracer.closest(eye, direction, from);
    if (hit.triangle == none || hit.front || scene.triangles[hit.triangle].two_sided) return hit;
    from = std::nextafter(hit.distance * (1 + 1e-6f), INFINITY);
  }
  return {};
}

}  // namespace

Result<Image> render_surfaces(const Scene& scene, const Tracer& tracer, const Camera& camera, const RenderOptions& options,
                              const std::function<SurfaceShade()>& make_shade, Progress* progress) {
  Image image(options.width, options.height);
  if (!options.background) image.alpha.assign(image.rgb.size(), 0.0f);
  const CameraRays rays(camera, options.width, options.height);
  ProgressStage stage(progress, "rendering", size_t(options.height));
  parallel_for(size_t(options.height), 1, [&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    const SurfaceShade shade = make_shade();
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < options.width; ++x) {
        Vec3 sum(0.0f);
        int covered = 0;
        const uint32_t key = uint32_t(hash64(uint64_t(y) << 32 | uint64_t(x), 0xf11));
        for (int s = 0; s < options.samples; ++s) {
          const Vec2 jitter = sobol_owen(uint32_t(s), key);
          const Vec3 direction = rays.direction(float(x) + jitter.x, float(y) + jitter.y);
          const Hit hit = first_visible(scene, tracer, rays.eye, direction);
          if (hit.triangle == none) {
            if (options.background) sum += radiance_bilinear(*options.background, direction);
            continue;
          }
          ++covered;
          sum += shade(hit, direction);
        }
        image.at(x, y) = sum / float(options.samples);
        if (!options.background) image.alpha[size_t(y) * size_t(options.width) + size_t(x)] = float(covered) / float(options.samples);
      }
    stage.advance(end - begin);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return image;
}

Result<Image> render(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Relit& relit,
                     const Camera& camera, const RenderOptions& options, Progress* progress) {
  LAMBENT_CHECK(options.outgoing ? relit.rows == options.outgoing->rows() : relit.rows == directional_rows(options.directional));
  return render_surfaces(scene, tracer, camera, options, [&]() -> SurfaceShade {
    return [&, weights = std::vector<ViewWeights>(size_t(relit.rows))](const Hit& hit, Vec3 direction) mutable {
      const Triangle& triangle = scene.triangles[hit.triangle];
      if (options.show == RenderOptions::Show::albedo) return albedo(scene, triangle, hit.u, hit.v);
      Vec3 sum(0.0f);
      if (!options.emission.empty() && emits(scene, triangle, hit.front))
        sum += options.emission[scene.parts[triangle.part].material] * emission_texel(scene, triangle, hit.u, hit.v);
      const Vec3 colour = options.show == RenderOptions::Show::product ? albedo(scene, triangle, hit.u, hit.v) : Vec3(1);
      std::array<Vec3, 9> rows{};
      std::visit([&](const auto& b) {
        const auto* at = b.find(hit.triangle, hit.front);
        if (!at) return;
        b.spread(*at, hit.u, hit.v, [&](uint32_t receiver, float weight) {
          if (options.outgoing) {  // each receiver reflects in its own frame
            evaluate_outgoing(*options.outgoing, receiver, -direction, weights);
            sum += weight * reflect_rows(weights, colour, [&](size_t row) { return relit.at(receiver, int(row)); });
            return;
          }
          for (int row = 0; row < relit.rows; ++row) rows[size_t(row)] += weight * relit.at(receiver, row);
        });
      }, basis);
      if (options.directional == DirectionalKind::none) return sum + colour * rows[0];
      const float side = hit.front ? 1.0f : -1.0f;
      const Vec3 face = normalize_or(area_normal(scene, triangle), Vec3(0, 1, 0));
      Vec3 n = normalize_or(interpolate(scene.normals, triangle, hit.u, hit.v), face);
      if (glm::dot(n, face) < 0) n = -n;
      const Vec3 bent = mapped_normal(scene, triangle, hit.u, hit.v, n);
      return sum + colour * evaluate_directional_light(options.directional, rows, receiver_frame(side * n), side * bent);
    };
  }, progress);
}

}  // namespace lambent

#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/render/render.h>

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

Result<Image> render(const Scene& scene, const Tracer& tracer, const CornerReceivers& corners, const Relit& relit,
                     const Camera& camera, const RenderOptions& options, Progress* progress) {
  return render_surfaces(scene, tracer, camera, options, [&]() -> SurfaceShade {
    return [&, weights = std::vector<ViewWeights>(options.outgoing ? size_t(relit.rows) : 0)](const Hit& hit, Vec3 direction) mutable {
      const auto* corner = corners.find(hit.triangle, hit.front);
      if (!corner) return Vec3(0.0f);
      const auto& r = corner->receiver;
      const float b[3] = {1 - hit.u - hit.v, hit.u, hit.v};
      const Vec3 colour = options.albedo ? albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v) : Vec3(1);
      if (!options.outgoing) return colour * (b[0] * relit.at(r[0]) + b[1] * relit.at(r[1]) + b[2] * relit.at(r[2]));
      Vec3 sum(0.0f);
      for (int k = 0; k < 3; ++k) {
        evaluate_outgoing(*options.outgoing, r[k], -direction, weights);
        sum += b[k] * reflect_rows(weights, colour, [&](size_t row) { return relit.at(r[k], int(row)); });
      }
      return sum;
    };
  }, progress);
}

}  // namespace lambent

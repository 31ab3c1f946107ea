// Pictures and single receivers of the reference: averages of path estimates (integrator.h), with their variance.
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/reference/integrator.h>
#include <lambent/reference/path_tracer.h>

namespace lambent {
namespace reference {
namespace {

// Sums in double precision, so that a million paths in a bright sun lose nothing.
struct Moments {
  Vec3d sum{0.0}, squares{0.0};
  void add(Vec3d x) { sum += x, squares += x * x; }
  void add(const Moments& m) { sum += m.sum, squares += m.squares; }
  Vec3 mean(int n) const { return Vec3(sum / double(n)); }
  // Of the mean of n independent numbers.
  Vec3 variance(int n) const {
    if (n < 2) return Vec3(INFINITY);
    Vec3d m = sum / double(n);
    return Vec3(max(squares / double(n) - m * m, 0.0) / double(n - 1));
  }
};

constexpr size_t tile = 8;  // pixels, square: neighbours in the picture are neighbours in the caches

}  // namespace

Result<ReferenceImage> render(const Integrator& integrator, const Camera& camera, const ReferenceOptions& options,
                              Progress* progress) {
  const size_t width = size_t(options.width), height = size_t(options.height);
  const CameraRays rays(camera, options.width, options.height);
  const uint64_t seed = hash64(options.seed);
  ReferenceImage result{Image(options.width, options.height), std::vector<Vec3>(width * height)};
  result.image.coverage.resize(width * height);

  auto render_pixel = [&](size_t x, size_t y) {
    const size_t pixel = y * width + x;
    Moments moments;
    float covered = 0;
    for (int i = 0; i < options.spp; ++i) {
      if (i % 256 == 0 && is_cancelled(progress)) return;
      PathSamples samples(hash64(seed, pixel), uint32_t(i), uint32_t(options.spp));
      Vec2 jitter = samples.pair(0);
      Vec3 d = rays.direction(float(x) + jitter.x, float(y) + jitter.y), value(0), weight;
      Hit hit;
      PathVertex vertex;
      if (meets(integrator, rays.eye, d, true, samples, 0, hit, weight)) {
        ++covered;
        if (integrator.lamps && integrator.direct) value += emitted(*integrator.scene, hit, d);
        if (make_vertex(integrator, hit, d, vertex)) value += exit_radiance_estimate(integrator, vertex, samples);
      } else if (options.background) {
        value = radiance_bilinear(*integrator.environment, d);
      } else {
        covered += 1 - (weight.x + weight.y + weight.z) / 3;
      }
      value *= weight;
      moments.add(Vec3d(value));
    }
    result.image.rgb[pixel] = moments.mean(options.spp);
    result.variance[pixel] = moments.variance(options.spp);
    result.image.coverage[pixel] = std::clamp(covered / float(options.spp), 0.0f, 1.0f);
  };

  const size_t across = (width + tile - 1) / tile, down = (height + tile - 1) / tile;
  ProgressStage stage(progress, "path tracing", across * down);
  parallel_for(across * down, 1, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
      size_t x0 = i % across * tile, y0 = i / across * tile;
      for (size_t y = y0; y < std::min(y0 + tile, height); ++y)
        for (size_t x = x0; x < std::min(x0 + tile, width); ++x) render_pixel(x, y);
      stage.advance();
    }
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  if (!options.background) result.image.alpha = result.image.coverage;
  return result;
}

}  // namespace reference

Result<ReferenceImage> path_trace(const Scene& scene, const Environment& env, const Camera& camera,
                                  const ReferenceOptions& options, Progress* progress) {
  if (options.width < 1 || options.height < 1 || size_t(options.width) * size_t(options.height) > size_t{1} << 28)
    return Error{"", "the picture's size must be between 1 and 2^28 pixels"};
  if (options.spp < 1 || options.spp > 1 << 20) return Error{"", "paths a pixel must be between 1 and 2^20"};
  if (options.bounces < 0 || options.bounces > 64) return Error{"", "bounces must be between 0 and 64"};
  Result<reference::Integrator> integrator = reference::make_integrator(
      scene, env, options.bounces, reference::Strategy::combined, options.reflection, options.lamps);
  if (!integrator) return integrator.error();
  integrator->direct = options.direct;
  return reference::render(*integrator, camera, options, progress);
}

std::vector<ExitRadiance> exit_radiances(const Scene& scene, const Environment& env, std::span<const Vec3> origins,
                                         std::span<const Vec3> normals, int bounces, int paths, uint32_t seed,
                                         const Reflection& reflection, bool lamps) {
  LAMBENT_CHECK(origins.size() == normals.size() && paths >= 1 && bounces >= 0);
  Result<reference::Integrator> integrator =
      reference::make_integrator(scene, env, bounces, reference::Strategy::combined, reflection, lamps);
  LAMBENT_CHECK(bool(integrator));
  // Blocks of paths, summed in order afterwards: one point keeps all cores busy, and the sum does not depend on them.
  constexpr size_t block = 1024;
  const size_t total = size_t(paths), blocks = (total + block - 1) / block;
  std::vector<reference::Moments> moments(origins.size() * blocks);
  parallel_for(moments.size(), 1, [&](size_t begin, size_t end) {
    for (size_t m = begin; m < end; ++m) {
      const size_t point = m / blocks, first = m % blocks * block;
      const reference::PathVertex receiver = reference::white_vertex(origins[point], normals[point]);
      const uint64_t key = hash64(hash64(seed), point);
      for (size_t i = first; i < std::min(first + block, total); ++i)
        moments[m].add(Vec3d(reference::exit_radiance_estimate(
            *integrator, receiver, reference::PathSamples(key, uint32_t(i), uint32_t(paths)))));
    }
  });
  std::vector<ExitRadiance> results;
  for (size_t point = 0; point < origins.size(); ++point) {
    reference::Moments sum;
    for (size_t b = 0; b < blocks; ++b) sum.add(moments[point * blocks + b]);
    results.push_back({sum.mean(paths), sum.variance(paths)});
  }
  return results;
}

Vec3 exit_radiance(const Scene& scene, const Environment& env, Vec3 origin, Vec3 n, int bounces, int paths,
                   uint32_t seed, bool lamps) {
  return exit_radiances(scene, env, {&origin, 1}, {&n, 1}, bounces, paths, seed, {}, lamps)[0].mean;
}

}  // namespace lambent

#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/dering.h>
#include <lambent/render/render.h>
#include <lambent/scene/lights.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/see_through.h>

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

// What a ray shows, nearest first: surfaces that let light pass, and what is behind them.
void see_through(const Scene& scene, const Tracer& tracer, Vec3 eye, Vec3 direction, std::vector<ViewRay>& out) {
  thread_local std::vector<Hit> layers;
  Vec3 through(1);
  float from = 0;
  for (int skipped = 0; skipped < 64; ++skipped) {
    tracer.layers(eye, direction, from, layers);
    for (const Hit& h : layers) {
      const Triangle& t = scene.triangles[h.triangle];
      if (!h.front && !t.two_sided) continue;
      const float there = tracer.lets_pass(h.triangle) ? coverage(scene, t, h.u, h.v) : 1.0f;
      if (there > 0) out.push_back({h, direction, there * through});
      through *= tracer.lets_pass(h.triangle) ? transmittance(scene, t, h.u, h.v) : Vec3(0);
      if (through == Vec3(0)) return;
    }
    if (layers.empty() || tracer.lets_pass(layers.back().triangle)) break;
    from = std::nextafter(layers.back().distance * (1 + 1e-6f), INFINITY);
  }
  out.push_back({{}, direction, through});
}

// What samples [first, first + count) of a pixel show, added to `out`.
void trace_pixel(const Scene& scene, const Tracer& tracer, const CameraRays& camera, int x, int y, int first, int count,
                 std::vector<ViewRay>& out) {
  const uint32_t key = uint32_t(hash64(uint64_t(y) << 32 | uint64_t(x), 0xf11));
  for (int s = first; s < first + count; ++s) {
    const Vec2 jitter = sobol_owen(uint32_t(s), key);
    const Vec3 direction = camera.direction(float(x) + jitter.x, float(y) + jitter.y);
    if (tracer.lets_pass()) see_through(scene, tracer, camera.eye, direction, out);
    else out.push_back({first_visible(scene, tracer, camera.eye, direction), direction});
  }
}

// Calls a visitor with every pixel, row by row from the top, and what its rays show. `make_visit` is called once for
// each row of the picture, on the thread that draws it.
using VisitPixel = std::function<void(size_t pixel, std::span<const ViewRay> rays)>;
Result<void> trace_pixels(const Scene& scene, const Tracer& tracer, const Camera& camera, const RenderOptions& options,
                          const std::function<VisitPixel()>& make_visit, Progress* progress) {
  const CameraRays camera_rays(camera, options.width, options.height);
  ProgressStage stage(progress, "rendering", size_t(options.height));
  parallel_for(size_t(options.height), 1, [&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    const VisitPixel visit = make_visit();
    std::vector<ViewRay> rays;
    for (int y = int(begin); y < int(end); ++y)
      for (int x = 0; x < options.width && !stage.cancelled(); ++x) {
        rays.clear();
        trace_pixel(scene, tracer, camera_rays, x, y, 0, options.samples, rays);
        visit(size_t(y) * size_t(options.width) + size_t(x), rays);
      }
    stage.advance(end - begin);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return {};
}

float mean(Vec3 v) { return v.x == v.y && v.y == v.z ? v.x : (v.x + v.y + v.z) / 3; }

// What the light at a hit is multiplied by.
Vec3 shown_colour(const Scene& scene, const RenderOptions& options, const Hit& hit) {
  return options.show == RenderOptions::Show::product ? albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v)
                                                      : Vec3(1);
}

// O(view) at a hit, as what it is, a row of numbers: radiance is the sum over all add(receiver, row, weight) of weight
// times that row of T . light. `weights` is scratch, a value a row.
template <class Add>
void reflect_at(const SpatialBasis& basis, const RenderOptions& options, const Hit& hit, Vec3 direction, Vec3 colour,
                std::span<ViewWeights> weights, Add add) {
  std::visit(
      [&](const auto& b) {
        const auto* at = b.find(hit.triangle, hit.front);
        if (!at) return;
        b.spread(*at, hit.u, hit.v, [&](uint32_t receiver, float weight) {
          if (!options.outgoing) return add(receiver, 0, weight * colour);
          evaluate_outgoing(*options.outgoing, receiver, -direction,
                            weights);  // each receiver reflects in its own frame
          for (size_t row = 0; row < weights.size(); ++row)
            if (weights[row] != ViewWeights(0.0f))  // of compact lobes a view meets a few
              add(receiver, int(row), weight * (Vec3(weights[row]) + colour * weights[row].w));
        });
      },
      basis);
}

}  // namespace

Result<Image> render_surfaces(const Scene& scene, const Tracer& tracer, const Camera& camera,
                              const RenderOptions& options, const std::function<SurfaceShade()>& make_shade,
                              Progress* progress) {
  Image image(options.width, options.height);
  image.coverage.assign(image.rgb.size(), 0.0f);
  auto traced = trace_pixels(
      scene, tracer, camera, options,
      [&]() -> VisitPixel {
        return [&, shade = make_shade()](size_t pixel, std::span<const ViewRay> rays) {
          Vec3 sum(0.0f);
          const float samples = float(options.samples);
          float open = 0;
          for (const ViewRay& ray : rays) {
            if (ray.hit.triangle != none) {
              sum += ray.weight * shade(ray.hit, ray.direction);
              continue;
            }
            open += mean(ray.weight);
            if (options.background) sum += ray.weight * radiance_bilinear(*options.background, ray.direction);
          }
          image.rgb[pixel] = sum / samples;
          image.coverage[pixel] = std::max(samples - open, 0.0f) / samples;
        };
      },
      progress);
  if (!traced) return traced.error();
  if (!options.background) image.alpha = image.coverage;
  return image;
}

namespace {

// Directional rows at a hit, under the normal there; peaks are held above 0 apart.
Vec3 directional_light(const Scene& scene, const SpatialBasis& basis, const Relit& relit, const RenderOptions& options,
                       const Hit& hit) {
  std::array<Vec3, 9> rows{}, peak_rows{};
  std::visit(
      [&](const auto& b) {
        const auto* at = b.find(hit.triangle, hit.front);
        if (!at) return;
        b.spread(*at, hit.u, hit.v, [&](uint32_t receiver, float weight) {
          for (int row = 0; row < relit.rows; ++row) {
            rows[size_t(row)] += weight * relit.at(receiver, row);
            if (options.peaks) peak_rows[size_t(row)] += weight * options.peaks->at(receiver, row);
          }
        });
      },
      basis);
  const Triangle& triangle = scene.triangles[hit.triangle];
  const float side = hit.front ? 1.0f : -1.0f;
  const Vec3 face = unit_normal(scene, triangle, Vec3(0, 1, 0));
  Vec3 n = normalize_or(interpolate(scene.normals, triangle, hit.u, hit.v), face);
  if (dot(n, face) < 0) n = -n;
  const Vec3 bent = mapped_normal(scene, triangle, hit.u, hit.v, n);
  auto light = [&](const std::array<Vec3, 9>& of) {
    return evaluate_directional_light(options.directional, of, receiver_frame(side * n), side * bent);
  };
  if (!options.peaks) return light(rows);
  for (size_t k = 0; k < rows.size(); ++k) rows[k] -= peak_rows[k];
  return light(rows) + light(peak_rows);  // each is held at 0 by what evaluates it
}

// Radiance at a hit; colour(): what the light there is multiplied by. `weights` is scratch, a value a row.
template <class Colour>
Vec3 relit_at(const Scene& scene, const SpatialBasis& basis, const Relit& relit, const RenderOptions& options,
              const Hit& hit, Vec3 direction, std::span<ViewWeights> weights, Colour colour) {
  const Triangle& triangle = scene.triangles[hit.triangle];
  if (options.show == RenderOptions::Show::albedo) return albedo(scene, triangle, hit.u, hit.v);
  Vec3 sum(0.0f);
  if (!options.emission.empty() && emits(scene, triangle, hit.front))
    sum += options.emission[scene.parts[triangle.part].material] * emission_texel(scene, triangle, hit.u, hit.v);
  if (options.directional != DirectionalKind::none)
    return sum + colour() * directional_light(scene, basis, relit, options, hit);
  Vec3 whole(0.0f), peaks(0.0f);
  reflect_at(basis, options, hit, direction, colour(), weights, [&](uint32_t receiver, int row, Vec3 weight) {
    whole += weight * relit.at(receiver, row);
    if (options.peaks) peaks += weight * options.peaks->at(receiver, row);
  });
  return sum + (options.peaks ? dering(whole, peaks) : whole);
}

void check_rows(const Relit& relit, const RenderOptions& options) {
  LAMBENT_CHECK(options.outgoing ? relit.rows == options.outgoing->rows()
                                 : relit.rows == directional_rows(options.directional));
}

}  // namespace

std::function<SurfaceShade()> relit_shade(const Scene& scene, const SpatialBasis& basis, const Relit& relit,
                                          const RenderOptions& options) {
  check_rows(relit, options);
  return [&]() -> SurfaceShade {
    return [&, weights = std::vector<ViewWeights>(size_t(relit.rows))](const Hit& hit, Vec3 direction) mutable {
      return relit_at(scene, basis, relit, options, hit, direction, weights,
                      [&] { return shown_colour(scene, options, hit); });
    };
  };
}

std::function<RayShade()> relit_shade(const ViewRays& view, const Scene& scene, const SpatialBasis& basis,
                                      const Relit& relit, const RenderOptions& options) {
  if (view.colours.empty() || options.show != RenderOptions::Show::product)
    return by_number(view, relit_shade(scene, basis, relit, options));
  check_rows(relit, options);
  return [&]() -> RayShade {
    return [&, weights = std::vector<ViewWeights>(size_t(relit.rows))](size_t ray) mutable {
      const ViewRay& r = view.rays[ray];
      return relit_at(scene, basis, relit, options, r.hit, r.direction, weights, [&] { return view.colours[ray]; });
    };
  };
}

void find_colours(const Scene& scene, ViewRays& view) {
  view.colours.assign(view.rays.size(), Vec3(0.0f));
  parallel_for(view.rays.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      if (const Hit& hit = view.rays[i].hit; hit.triangle != none)
        view.colours[i] = albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v);
  });
}

Result<Image> render(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Relit& relit,
                     const Camera& camera, const RenderOptions& options, Progress* progress) {
  return render_surfaces(scene, tracer, camera, options, relit_shade(scene, basis, relit, options), progress);
}

Result<ViewRays> trace_view(const Scene& scene, const Tracer& tracer, const Camera& camera, int width, int height,
                            int first, int count, Progress* progress) {
  const CameraRays camera_rays(camera, width, height);
  ProgressStage stage(progress, "tracing the view", size_t(height));
  std::vector<std::vector<ViewRay>> rows(static_cast<size_t>(height));
  ViewRays out{width, height, count, {}, {0}};
  out.begin.resize(size_t(width) * size_t(height) + 1);
  parallel_for(size_t(height), 1, [&](size_t y, size_t) {
    if (stage.cancelled()) return;
    rows[y].reserve(size_t(width) * size_t(count));
    for (int x = 0; x < width; ++x) {
      trace_pixel(scene, tracer, camera_rays, x, int(y), first, count, rows[y]);
      out.begin[y * size_t(width) + size_t(x) + 1] = uint32_t(rows[y].size());
    }
    stage.advance();
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  uint32_t before = 0;
  for (size_t y = 0; y < size_t(height); ++y) {
    for (size_t x = 0; x < size_t(width); ++x) out.begin[y * size_t(width) + x + 1] += before;
    before += uint32_t(rows[y].size());
    out.rays.insert(out.rays.end(), rows[y].begin(), rows[y].end());
    rows[y] = {};
  }
  return out;
}

void shade_rays(const ViewRays& view, const std::function<RayShade()>& make_shade,
                const std::function<Vec3(Vec3)>& background, ViewSums& sums, int first, int last) {
  const size_t width = size_t(view.width), pixels = width * size_t(view.height);
  if (sums.samples == 0 && first == 0) sums.rgb.assign(pixels, Vec3(0.0f)), sums.open.assign(pixels, 0.0f);
  LAMBENT_CHECK(sums.rgb.size() == pixels && first <= last && last <= view.height);
  parallel_for(size_t(last - first), 4, [&](size_t begin, size_t end) {
    const RayShade shade = make_shade();
    for (size_t pixel = (size_t(first) + begin) * width; pixel < (size_t(first) + end) * width; ++pixel)
      for (uint32_t i = view.begin[pixel]; i < view.begin[pixel + 1]; ++i) {
        const ViewRay& ray = view.rays[i];
        if (ray.hit.triangle != none) {
          sums.rgb[pixel] += ray.weight * shade(i);
          continue;
        }
        sums.open[pixel] += mean(ray.weight);
        if (background) sums.rgb[pixel] += ray.weight * background(ray.direction);
      }
  });
  if (last == view.height) sums.samples += view.samples;
}

std::function<RayShade()> by_number(const ViewRays& view, std::function<SurfaceShade()> make_shade) {
  return [&view, make_shade = std::move(make_shade)]() -> RayShade {
    return [&view, shade = make_shade()](size_t ray) { return shade(view.rays[ray].hit, view.rays[ray].direction); };
  };
}

void shade_rays(const ViewRays& view, const std::function<SurfaceShade()>& make_shade,
                const std::function<Vec3(Vec3)>& background, ViewSums& sums) {
  shade_rays(view, by_number(view, make_shade), background, sums, 0, view.height);
}

Image mean_of(const ViewSums& sums, int width, int height) {
  Image image(width, height);
  image.coverage.resize(sums.rgb.size());
  const float samples = float(sums.samples);
  for (size_t i = 0; i < sums.rgb.size(); ++i) {
    image.rgb[i] = sums.rgb[i] / samples;
    image.coverage[i] = std::max(samples - sums.open[i], 0.0f) / samples;
  }
  return image;
}

namespace {

// What a pixel's rays ask of a receiver, row by row.
using Asked = std::pair<uint32_t, std::vector<Vec3>>;
using TakeAsked = std::function<void(size_t pixel, std::span<const Asked> asked, float coverage)>;

// Calls a taker with every pixel; many of its rays meet the same receivers. `make_take` as of trace_pixels().
Result<void> ask_pixels(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Camera& camera,
                        const RenderOptions& options, size_t rows, const std::function<TakeAsked()>& make_take,
                        Progress* progress) {
  return trace_pixels(
      scene, tracer, camera, options,
      [&]() -> VisitPixel {
        return [&, rows, take = make_take(), asked = std::vector<Asked>(), weights = std::vector<ViewWeights>(rows)](
                   size_t pixel, std::span<const ViewRay> rays) mutable {
          asked.clear();
          const float samples = float(options.samples);
          float open = 0;
          for (const ViewRay& ray : rays) {
            if (ray.hit.triangle == none) {
              open += mean(ray.weight);
              continue;
            }
            reflect_at(basis, options, ray.hit, ray.direction, shown_colour(scene, options, ray.hit), weights,
                       [&](uint32_t receiver, int r, Vec3 weight) {
                         auto place = std::find_if(asked.begin(), asked.end(),
                                                   [&](const Asked& a) { return a.first == receiver; });
                         if (place == asked.end())
                           place = asked.insert(asked.end(), {receiver, std::vector<Vec3>(rows, Vec3(0.0f))});
                         place->second[size_t(r)] += ray.weight * weight / samples;
                       });
          }
          take(pixel, asked, std::max(samples - open, 0.0f) / samples);
        };
      },
      progress);
}

}  // namespace

Result<FixedViewTransfer> fix_view(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis,
                                   const Transfer& transfer, const Camera& camera, const RenderOptions& options,
                                   Progress* progress) {
  LAMBENT_CHECK(transfer.rows == (options.outgoing ? options.outgoing->rows() : 1));
  const size_t pixels = size_t(options.width) * size_t(options.height), C = transfer.columns(),
               channels = size_t(transfer.channels);
  FixedViewTransfer out;
  out.coverage.assign(pixels, 0.0f);
  const WritableTransfer fixed = make_transfer(transfer.light, 1, 3, pixels, transfer.precision);
  auto traced = ask_pixels(
      scene, tracer, basis, camera, options, size_t(transfer.rows),
      [&]() -> TakeAsked {
        return
            [&, row = std::vector<float>(3 * C)](size_t pixel, std::span<const Asked> asked, float coverage) mutable {
              std::fill(row.begin(), row.end(), 0.0f);
              for (const auto& [receiver, of_rows] : asked) {
                const std::vector<float> values = load_receiver(transfer, receiver);  // [row][channel][column]
                for (size_t r = 0; r < of_rows.size(); ++r)
                  for (size_t c = 0; c < 3; ++c) {
                    const float* v = values.data() + (r * channels + std::min(c, channels - 1)) * C;
                    for (size_t k = 0; k < C; ++k) row[c * C + k] += of_rows[r][int(c)] * v[k];
                  }
              }
              store_receiver(fixed, pixel, row);
              out.coverage[pixel] = coverage;
            };
      },
      progress);
  if (!traced) return traced.error();
  out.transfer = fixed.transfer;
  return out;
}

Result<PixelMix> mix_of_view(const Scene& scene, const Tracer& tracer, const SpatialBasis& basis, const Camera& camera,
                             const RenderOptions& options, Progress* progress) {
  LAMBENT_CHECK(!options.outgoing);
  const size_t pixels = size_t(options.width) * size_t(options.height);
  PixelMix out{std::vector<size_t>(pixels + 1), {}, {}, std::vector<float>(pixels)};
  std::vector<std::vector<std::pair<uint32_t, Vec3>>> of_pixels(pixels);
  auto traced = ask_pixels(
      scene, tracer, basis, camera, options, 1,
      [&]() -> TakeAsked {
        return [&](size_t pixel, std::span<const Asked> asked, float coverage) {
          for (const auto& [receiver, of_rows] : asked) of_pixels[pixel].emplace_back(receiver, of_rows[0]);
          out.begin[pixel + 1] = asked.size(), out.coverage[pixel] = coverage;
        };
      },
      progress);
  if (!traced) return traced.error();
  for (size_t p = 0; p < pixels; ++p) out.begin[p + 1] += out.begin[p];
  out.receivers.reserve(out.begin[pixels]), out.weights.reserve(out.begin[pixels]);
  for (const auto& of_pixel : of_pixels)
    for (const auto& [receiver, weight] : of_pixel) out.receivers.push_back(receiver), out.weights.push_back(weight);
  return out;
}

Image pixels_image(const Relit& relit, const std::vector<float>& coverage, const Camera& camera, int width, int height,
                   const Environment* background) {
  Image image(width, height);
  const CameraRays rays(camera, width, height);
  for (size_t i = 0; i < image.rgb.size(); ++i) {
    image.rgb[i] = relit.at(i);
    if (!background || coverage[i] >= 1) continue;
    const Vec3 direction = rays.direction(float(i % size_t(width)) + 0.5f, float(i / size_t(width)) + 0.5f);
    image.rgb[i] += (1 - coverage[i]) * radiance_bilinear(*background, direction);
  }
  image.coverage = coverage;
  if (!background) image.alpha = coverage;
  return image;
}

}  // namespace lambent

// Follows: general-prt. T0 holds direct light with shadows; X_{k+1} = T0 + B X_k sums the Neumann series term by term,
// so X_k is the transfer of up to k bounces. It is also the radiosity equation's Jacobi step.
#include <lambent/bake/bake.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/lobes.h>
#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>

#include <chrono>

namespace lambent {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

size_t row_width(size_t coefficients, int channels) { return pad_lanes(coefficients * size_t(channels)); }

// Solution vectors: T0, X and the next X; T0 of half the rays at the checked receivers.
size_t solution_bytes(size_t receivers, size_t coefficients, int channels, int sky_channels = 1) {
  const size_t sky = coefficients * size_t(sky_channels);
  return 4 * (receivers * (sky + 2 * row_width(coefficients, channels)) + checked_count(receivers) * sky);
}

// Direction tables, corner maps and the scratch of every thread; an upper estimate.
size_t table_bytes(size_t receivers, size_t triangles, size_t coefficients, size_t samples) {
  const size_t entries = gather_block * std::min(3 * samples, receivers);
  return 8 * pad_lanes(samples) * 4 * (coefficients + 3) + 32 * triangles +
         size_t(thread_count()) * (48 * receivers + 48 * entries + 100 * samples);
}

struct Baker {
  const Scene& scene;
  const Receivers& receivers;
  const BakeOptions& options;
  const GatherSetup setup;
  Progress* progress;
  BakeReport& report;
  const LobeSets lobes = make_lobe_sets(options.lobe_kind, options.lobes, options.samples, options.seed);
  Pool<LobeRays> lobe_rays{[this] { return std::make_unique<LobeRays>(make_lobe_rays(lobes, setup.sky_channels)); }};
  Pool<GatherScratch, DeleteScratch> scratch{[this] { return make_gather_scratch(setup); }};

  size_t n() const { return receivers.count(); }
  size_t harmonics() const { return setup.coefficients(); }
  size_t coefficients() const { return harmonics() + lobes.count(); }
  size_t sky_width() const { return coefficients() * size_t(setup.sky_channels); }
  size_t rays_each() const { return size_t(options.samples) + size_t(lobes.rays) * lobes.sharp.size(); }
  bool has_halves() const { return setup.sets.half < size_t(setup.sets.samples); }

  // The columns of the sharp lobes, beside those that the fan has filled.
  void trace_sharp_lobes(size_t first, size_t count, const GatherSky& sky) {
    if (lobes.sharp.empty()) return;
    auto rays = lobe_rays.borrow();
    for (size_t r = first; r < first + count && !is_cancelled(progress); ++r) {
      float* half = checked_row(sky, first, r);
      trace_lobes(lobes, setup.tracer, receivers.origins[r], receivers.normals[r], r, *rays,
                  sky.rows + (r - first) * sky.stride + harmonics(), half ? half + harmonics() : nullptr,
                  coefficients());
    }
  }

  Result<Transfer> unshadowed() {
    WritableTransfer out = make_transfer(options.light(), 1, 1, n(), options.precision);
    std::vector<std::vector<double>> irradiance;
    for (const Lobe& lobe : options.lobes) irradiance.push_back(lobe_irradiance(options.lobe_kind, lobe.sharpness));
    parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
      std::vector<float> row(coefficients());
      for (size_t r = begin; r < end; ++r) {
        // An open plane: the clamped cosine, convolved (pi, 2 pi/3, pi/4, ...), over pi.
        evaluate_sh(options.order, receivers.normals[r], row);
        for (size_t k = 0; k < harmonics(); ++k) row[k] *= float(clamped_cosine(sh_band(int(k))) / std::numbers::pi);
        for (size_t k = 0; k < irradiance.size(); ++k) {
          const Vec3d axis = normalize(Vec3d(options.lobes[k].axis));
          row[harmonics() + k] =
              float(evaluate_legendre(irradiance[k], dot(axis, Vec3d(receivers.normals[r]))) / std::numbers::pi);
        }
        store_receiver(out, r, row);
      }
    });
    report.error = 0;
    return std::move(out.transfer);
  }

  Result<Transfer> direct() {
    const auto start = std::chrono::steady_clock::now();
    WritableTransfer out = make_transfer(options.light(), 1, setup.sky_channels, n(), options.precision);
    std::vector<uint8_t> buried(n());
    ErrorSums errors(n());
    {
      ProgressStage stage(progress, "tracing", n());
      const KeptPieces kept(progress, "tracing", n() / gather_block);
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        std::vector<float> rows((end - begin) * sky_width()), half_rows(checked_count(end - begin) * sky_width());
        const GatherSky sky{rows.data(), half_rows.data(), sky_width(), &lobes, buried.data() + begin};
        const std::span<float> full(rows), half(half_rows);
        const std::span<uint8_t> inside(buried.data() + begin, end - begin);
        if (!kept.load(begin / gather_block, full, half, inside)) {
          trace_sky(setup, *scratch.borrow(), begin, end - begin, sky);
          trace_sharp_lobes(begin, end - begin, sky);
          kept.save(begin / gather_block, full, half, inside);
        }
        for (size_t r = begin; r < end; ++r) {
          const float* row = rows.data() + (r - begin) * sky_width();
          store_receiver(out, r, {row, sky_width()});
          if (r % check_every == 0 && !buried[r])
            errors.add(r, half_rows.data() + (r - begin) / check_every * sky_width(), row, sky_width());
        }
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    for (const FillStep& step : make_fill_steps(scene, receivers.basis, buried)) {
      std::vector<float> mean(sky_width());
      for (uint32_t s : step.sources) {
        const std::vector<float> value = load_receiver(out.transfer, s);
        for (size_t k = 0; k < mean.size(); ++k) mean[k] += value[k] / float(step.sources.size());
      }
      store_receiver(out, step.receiver, mean);
    }
    for (uint8_t b : buried) report.buried += b;
    report.error = has_halves() ? errors.relative() : -1;
    report.trace_seconds = seconds_since(start), report.rays = n() * rays_each();
    return std::move(out.transfer);
  }

  Result<Transfer> bounced() {
    const size_t C = coefficients(), channels = size_t(setup.channels), width = row_width(C, setup.channels);
    const size_t W = sky_width();
    std::vector<float> T0(n() * W), T0_half(checked_count(n()) * W);
    const size_t fixed = solution_bytes(n(), C, setup.channels, setup.sky_channels) +
                         table_bytes(n(), scene.triangles.size(), C, size_t(options.samples)) +
                         lobe_set_bytes(options.samples, lobes.count());
    auto B = GatherOperator::trace(
        setup,
        {.sky = {T0.data(), T0_half.data(), W, &lobes, nullptr},
         .more = [&](size_t first, size_t count, const GatherSky& sky) { trace_sharp_lobes(first, count, sky); },
         .halves = true,
         .memory = options.memory > fixed ? options.memory - fixed : 0},
        progress);
    if (!B) return B.error();
    report.trace_seconds = B->report().seconds, report.buried = B->report().buried;
    report.operator_bytes = B->report().bytes, report.operator_kept = B->report().kept;
    report.working_memory = fixed + report.operator_bytes;

    // T0 is the same in every channel but for coloured glass; x is [receiver][coefficient][channel].
    const auto start = std::chrono::steady_clock::now();
    auto expand = [&](const float* t, float* x) {
      for (size_t k = 0; k < C; ++k)
        for (size_t c = 0; c < channels; ++c) x[k * channels + c] = t[setup.sky_channel(c) * C + k];
      std::fill(x + C * channels, x + width, 0.0f);
    };
    Source source{[&](size_t r, float* x) { expand(T0.data() + r * W, x); }};
    if (has_halves()) source.set_half = [&](size_t r, float* x) { expand(T0_half.data() + r / check_every * W, x); };
    auto solution = bounce(*B, source, width, options.bounces, progress);
    if (!solution) return solution.error();
    auto store = [&](const AlignedVector<float>& x) {
      return store_columns(options.light(), x.data(), 1, setup.channels, n(), width, options.precision);
    };
    Transfer result = store(solution->x);
    report.error = solution->error;
    if (options.keep_terms) {
      solution->x = {};
      auto ok = bounce_terms(*B, source, width, options.bounces, progress, [&](int, const auto& x) -> Result<void> {
        report.terms.push_back(store(x));
        return {};
      });
      if (!ok) return ok.error();
    }
    report.rays = n() * (rays_each() - size_t(options.samples)) + B->report().rays;
    report.bounce_seconds = seconds_since(start);
    return result;
  }
};

Result<void> check_options(const BakeOptions& o) {
  if (auto ok = check_light_basis(o, o.lobes.empty() ? 1 : 0); !ok) return ok;
  if (o.samples < 1 || o.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(o.samples)};
  if (o.bounces < 0 || o.bounces > 64)
    return Error{"bounces", "must lie between 0 and 64, not " + std::to_string(o.bounces)};
  return {};
}

}  // namespace

Result<void> check_light_basis(const BakeOptions& o, int least_order) {
  if (o.order < least_order || o.order > max_sh_order)
    return Error{"order", "must lie between " + std::to_string(least_order) + " and " + std::to_string(max_sh_order) +
                              ", not " + std::to_string(o.order)};
  if (o.light().count() > max_columns)
    return Error{"lobes", "at most " + std::to_string(max_columns) + " columns of light are possible"};
  for (const Lobe& lobe : o.lobes)
    if (!is_lobe(o.lobe_kind, lobe)) return Error{"lobes", "a lobe has no unit axis, or a sharpness out of range"};
  return {};
}

size_t least_memory(size_t receivers, bool coloured, const BakeOptions& options) {
  const size_t coefficients = options.light().count();
  const size_t tables = table_bytes(options.bounces > 0 ? receivers : 0, 0, coefficients, size_t(options.samples)) +
                        lobe_set_bytes(options.samples, options.lobes.size());
  if (!options.shadows) return 0;
  return tables + (options.bounces > 0 ? solution_bytes(receivers, coefficients, coloured ? 3 : 1) : 0);
}

Result<Transfer> bake(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const BakeOptions& options,
                      BakeReport* report, Progress* progress) {
  if (auto ok = check_options(options); !ok) return ok.error();
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  BakeReport unwanted;
  BakeReport& r = report ? *report : unwanted;
  r = {};
  Baker baker{scene,
              receivers,
              options,
              make_gather_setup(scene, tracer, receivers, options.order, options.shadows ? options.samples : 1,
                                options.seed, square_to_cosine_hemisphere, progress),
              progress,
              r};
  const size_t least = least_memory(receivers.count(), baker.setup.channels == 3, options);
  if (options.memory < least)
    return Error{scene.path, "baking needs at least " + std::to_string(least) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  auto result = !options.shadows ? baker.unshadowed() : options.bounces > 0 ? baker.bounced() : baker.direct();
  if (!result) return result;
  if (options.keep_terms && r.terms.empty()) r.terms = {*result};
  r.receivers = receivers.count(), r.bytes = result->bytes();
  return result;
}

}  // namespace lambent

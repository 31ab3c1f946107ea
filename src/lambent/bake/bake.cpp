// Follows: general-prt. T0 holds direct light with shadows; X_{k+1} = T0 + B X_k sums the Neumann series term by term,
// so X_k is the transfer of up to k bounces. It is also the radiosity equation's Jacobi step.
#include <lambent/bake/bake.h>
#include <lambent/bake/gather.h>
#include <lambent/bake/kept_rows.h>
#include <lambent/bake/lobes.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>

#include <chrono>

namespace lambent {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

size_t row_width(size_t coefficients, int channels) { return pad_lanes(coefficients * size_t(channels)); }

size_t checked_count(size_t receivers) { return (receivers + check_every - 1) / check_every; }

// Solution vectors: T0, X and the next X; T0 of half the rays at the checked receivers.
size_t solution_bytes(size_t receivers, size_t coefficients, int channels) {
  return 4 *
         (receivers * (coefficients + 2 * row_width(coefficients, channels)) + checked_count(receivers) * coefficients);
}

// Direction tables, corner maps and the scratch of every thread; an upper estimate.
size_t table_bytes(size_t receivers, size_t triangles, size_t coefficients, size_t samples) {
  const size_t entries = gather_block * std::min(3 * samples, receivers);
  return 8 * pad_lanes(samples) * 4 * (coefficients + 3) + 32 * triangles +
         size_t(thread_count()) * (48 * receivers + 48 * entries + 100 * samples);
}

// Luminance-free measure of how far `part` of the rays is from all of them.
struct ErrorSum {
  double difference = 0, total = 0;
  void add(const float* half, const float* full, size_t n) {
    for (size_t k = 0; k < n; ++k) {
      difference += double(half[k] - full[k]) * (half[k] - full[k]);
      total += double(full[k]) * full[k];
    }
  }
  double relative() const { return total > 0 ? std::sqrt(difference / total) : 0.0; }
};

struct Baker {
  const Scene& scene;
  const Receivers& receivers;
  const BakeOptions& options;
  const GatherSetup setup;
  Progress* progress;
  BakeReport& report;
  const LobeSets lobes = make_lobe_sets(options.lobe_kind, options.lobes, options.samples, options.seed);
  Pool<LobeRays> lobe_rays{[this] { return std::make_unique<LobeRays>(make_lobe_rays(lobes)); }};
  Pool<GatherScratch, DeleteScratch> scratch{[this] { return make_gather_scratch(setup); }};
  Pool<GatherBlock> gathered{[] { return std::make_unique<GatherBlock>(); }};

  size_t n() const { return receivers.count(); }
  size_t harmonics() const { return setup.coefficients(); }
  size_t coefficients() const { return harmonics() + lobes.count(); }
  size_t rays_each() const { return size_t(options.samples) + size_t(lobes.rays) * lobes.sharp.size(); }
  bool has_halves() const { return setup.sets.half < size_t(setup.sets.samples); }

  // The columns of the sharp lobes, beside those that the fan has filled.
  void trace_sharp_lobes(size_t first, size_t count, const GatherSky& sky) {
    if (lobes.sharp.empty()) return;
    auto rays = lobe_rays.borrow();
    for (size_t r = first; r < first + count; ++r) {
      float* half = checked_row(sky, first, r);
      trace_lobes(lobes, setup.tracer, receivers.origins[r], receivers.normals[r], r, *rays,
                  sky.rows + (r - first) * sky.stride + harmonics(), half ? half + harmonics() : nullptr);
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
    WritableTransfer out = make_transfer(options.light(), 1, 1, n(), options.precision);
    std::vector<uint8_t> buried(n());
    std::vector<ErrorSum> errors((n() + gather_block - 1) / gather_block);
    {
      ProgressStage stage(progress, "tracing", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        std::vector<float> rows((end - begin) * coefficients()), half_rows(checked_count(end - begin) * coefficients());
        const GatherSky sky{rows.data(), half_rows.data(), coefficients(), &lobes, buried.data() + begin};
        trace_sky(setup, *scratch.borrow(), begin, end - begin, sky);
        trace_sharp_lobes(begin, end - begin, sky);
        for (size_t r = begin; r < end; ++r) {
          const float* row = rows.data() + (r - begin) * coefficients();
          store_receiver(out, r, {row, coefficients()});
          if (r % check_every == 0 && !buried[r])
            errors[begin / gather_block].add(half_rows.data() + (r - begin) / check_every * coefficients(), row,
                                             coefficients());
        }
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    for (const FillStep& step : make_fill_steps(scene, receivers.basis, buried)) {
      std::vector<float> mean(coefficients());
      for (uint32_t s : step.sources) {
        const std::vector<float> value = load_receiver(out.transfer, s);
        for (size_t k = 0; k < mean.size(); ++k) mean[k] += value[k] / float(step.sources.size());
      }
      store_receiver(out, step.receiver, mean);
    }
    finish_report(buried, errors, start);
    report.rays = n() * rays_each();
    return std::move(out.transfer);
  }

  Result<Transfer> bounced() {
    auto start = std::chrono::steady_clock::now();
    const size_t C = coefficients(), channels = size_t(setup.channels), width = row_width(C, setup.channels);
    const size_t blocks = (n() + gather_block - 1) / gather_block;
    std::vector<float> T0(n() * C), T0_half(checked_count(n()) * C);
    std::vector<uint8_t> buried(n());
    const size_t fixed = solution_bytes(n(), C, setup.channels) +
                         table_bytes(n(), scene.triangles.size(), C, size_t(options.samples)) +
                         lobe_set_bytes(options.samples, lobes.count());
    const size_t budget = options.memory > fixed ? options.memory - fixed : 0;
    KeptRows kept(blocks, budget, most_bytes(size_t(options.samples), n(), setup.channels));

    auto sky_of = [&](size_t begin) {
      return GatherSky{T0.data() + begin * C, T0_half.data() + begin / check_every * C, C, &lobes,
                       buried.data() + begin};
    };
    {
      ProgressStage stage(progress, "tracing", n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        auto block = gathered.borrow();
        const GatherSky sky = sky_of(begin);
        trace_gather(setup, *scratch.borrow(), begin, end - begin, block.get(), &sky);
        trace_sharp_lobes(begin, end - begin, sky);
        kept.keep(begin / gather_block, *block);
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
    }
    report.rays = n() * rays_each();
    report.operator_bytes = kept.bytes(), report.operator_kept = kept.fraction();
    const auto fill = make_fill_steps(scene, receivers.basis, buried);
    fill_buried(fill, T0.data(), C, C);
    report.trace_seconds = seconds_since(start);
    start = std::chrono::steady_clock::now();

    // X = T0, the same in every channel, [receiver][coefficient][channel].
    AlignedVector<float> X(n() * width, 0.0f), next(n() * width, 0.0f);
    auto add_T0 = [&](const float* t, float* x) {
      for (size_t k = 0; k < C; ++k)
        for (size_t c = 0; c < channels; ++c) x[k * channels + c] += t[k];
    };
    parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r) add_T0(T0.data() + r * C, X.data() + r * width);
    });

    std::vector<ErrorSum> errors(blocks);
    for (int bounce = 1; bounce <= options.bounces; ++bounce) {
      const bool last = bounce == options.bounces;
      ProgressStage stage(progress, "bounce " + std::to_string(bounce), n());
      parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        const size_t b = begin / gather_block;
        const KeptRows::Block* found = kept.find(b);
        auto again = gathered.borrow();
        if (!found) trace_gather(setup, *scratch.borrow(), begin, end - begin, again.get(), nullptr);
        const KeptRows::Block block = found ? *found : KeptRows::Block{again->rows.view(), again->half_rows.view()};
        multiply_rows(block.rows, setup.channels, X.data(), width, setup.row_scale(size_t(options.samples)),
                      next.data() + begin * width);
        for (size_t r = begin; r < end; ++r) add_T0(T0.data() + r * C, next.data() + r * width);
        if (last && has_halves()) {
          AlignedVector<float> half(block.half_rows.row_count * width);
          multiply_rows(block.half_rows, setup.channels, X.data(), width, setup.row_scale(setup.sets.half),
                        half.data());
          for (size_t r = begin, i = 0; r < end; r += check_every, ++i) {
            add_T0(T0_half.data() + r / check_every * C, half.data() + i * width);
            if (!buried[r]) errors[b].add(half.data() + i * width, next.data() + r * width, width);
          }
        }
        stage.advance(end - begin);
      });
      if (stage.cancelled()) return Error{"", "cancelled"};
      report.rays += size_t(double(n()) * (1 - report.operator_kept) + 0.5) * size_t(options.samples);
      fill_buried(fill, next.data(), width, width);
      std::swap(X, next);
    }

    WritableTransfer out = make_transfer(options.light(), 1, setup.channels, n(), options.precision);
    parallel_for(n(), gather_block, [&](size_t begin, size_t end) {
      std::vector<float> row(C * channels);
      for (size_t r = begin; r < end; ++r) {
        for (size_t c = 0; c < channels; ++c)
          for (size_t k = 0; k < C; ++k) row[c * C + k] = X[r * width + k * channels + c];
        store_receiver(out, r, row);
      }
    });
    report.bounce_seconds = seconds_since(start);
    report.working_memory = fixed + kept.bytes();
    const double trace_seconds = report.trace_seconds;
    finish_report(buried, errors, start);
    report.trace_seconds = trace_seconds;
    return std::move(out.transfer);
  }

  void finish_report(const std::vector<uint8_t>& buried, const std::vector<ErrorSum>& errors,
                     std::chrono::steady_clock::time_point start) {
    for (uint8_t b : buried) report.buried += b;
    report.trace_seconds = seconds_since(start);
    ErrorSum all;
    for (const ErrorSum& e : errors) all.difference += e.difference, all.total += e.total;
    report.error = has_halves() ? all.relative() : -1;
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
  Baker baker{
      scene,
      receivers,
      options,
      make_gather_setup(scene, tracer, receivers, options.order, options.shadows ? options.samples : 1, options.seed),
      progress,
      r};
  const size_t least = least_memory(receivers.count(), baker.setup.channels == 3, options);
  if (options.memory < least)
    return Error{scene.path, "baking needs at least " + std::to_string(least) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  auto result = !options.shadows ? baker.unshadowed() : options.bounces > 0 ? baker.bounced() : baker.direct();
  if (!result) return result;
  r.receivers = receivers.count(), r.bytes = result->bytes();
  return result;
}

}  // namespace lambent

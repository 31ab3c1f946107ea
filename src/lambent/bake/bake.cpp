// Follows: general-prt. T0 holds direct light with shadows; X_{k+1} = T0 + B X_k sums the Neumann series term by term,
// so X_k is the transfer of up to k bounces. It is also the radiosity equation's Jacobi step.
#include <lambent/bake/asked_rows.h>
#include <lambent/bake/bake.h>
#include <lambent/bake/certify_field.h>
#include <lambent/bake/columns.h>
#include <lambent/bake/denoise.h>
#include <lambent/bake/gather_ahead.h>
#include <lambent/bake/lobes.h>
#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/bake/stand_in.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace lambent {
namespace {

// Some 4 % of the error, where it is spread as in our scenes.
constexpr size_t certified_places = 1024;
constexpr double least_noise_left = 0.2;  // 1 / sqrt of denoise()'s neighbours

// Direction tables, corner maps and the scratch of every thread; an upper estimate.
size_t table_bytes(size_t receivers, size_t triangles, size_t coefficients, size_t samples) {
  const size_t entries = gather_block * std::min(3 * samples, receivers), columns = std::min(entries, receivers);
  return 8 * pad_lanes(samples) * 4 * (coefficients + 3) + 32 * triangles +
         size_t(thread_count()) * (140 * columns + 60 * entries + 100 * samples);
}

struct Baker {
  const Scene& scene;
  const Receivers& all;
  const StandIns& stand_ins;
  const Receivers& receivers;  // that are traced
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
  // Of the result: without bounces, surfaces' colours tell nothing.
  int channels() const { return options.bounces > 0 ? setup.channels : setup.sky_channels; }
  size_t width() const { return pad_lanes(coefficients() * size_t(channels())); }
  // Ranks have rows of solutions that are their own, and others as they ask for them.
  bool is_parted() const {
    return this_ranks().count() > 1 && stand_ins.all() && options.shadows && options.bounces > 0 &&
           lobes.count() == 0 && !options.keep_terms && std::holds_alternative<CornerReceivers>(receivers.basis);
  }
  size_t vector_ranks() const { return is_parted() ? size_t(this_ranks().count()) : 1; }
  Shares shares() const { return Shares(n(), gather_block); }
  void ask(const std::vector<uint8_t>& asked, ZeroPages& x) const {
    const uint64_t by_bounces = this_ranks().asked_bytes;
    AskedRows(shares(), asked).fetch(x.data(), width());
    this_ranks().asked_bytes = by_bounces;
  }
  size_t rays_each() const { return size_t(options.samples) + size_t(lobes.rays) * lobes.sharp.size(); }

  // The columns of the sharp lobes, beside those that the fan has filled.
  void trace_sharp_lobes(size_t first, size_t count, const GatherSky& sky) {
    if (lobes.sharp.empty()) return;
    auto rays = lobe_rays.borrow();
    for (size_t r = first; r < first + count && !is_cancelled(progress); ++r) {
      trace_lobes(lobes, setup.tracer, receivers.origins[r], receivers.normals[r], r, *rays,
                  sky.rows + (r - first) * sky.stride + harmonics(), nullptr, coefficients());
    }
  }

  Result<Transfer> unshadowed() {
    report.error = 0;
    return unshadowed_transfer(options.light(), receivers.normals, options.precision);
  }

  // A row of T0, the same in every channel but for coloured glass, as one of X: [coefficient][channel].
  void expand(const float* t, float* x) const {
    const size_t C = coefficients(), n = size_t(channels());
    for (size_t k = 0; k < C; ++k)
      for (size_t c = 0; c < n; ++c) x[k * n + c] = t[setup.sky_channel(c) * C + k];
    std::fill(x + C * n, x + width(), 0.0f);
  }
  Transfer store(const float* x) const {
    return store_columns(options.light(), x, 1, channels(), n(), width(), options.precision);
  }
  Transfer store_own(const float* x) const {
    return store_own_columns(shares(), options.light(), x, channels(), n(), width(), options.precision);
  }
  // A stored row as one of X.
  void load_row(const Transfer& stored, size_t r, float* x) const {
    const std::vector<float> values = load_receiver(stored, r);
    const size_t C = coefficients(), n = size_t(channels());
    for (size_t k = 0; k < C; ++k)
      for (size_t c = 0; c < n; ++c) x[k * n + c] = values[c * C + k];
    std::fill(x + C * n, x + width(), 0.0f);
  }
  // Of all receivers. `guide`: the solution.
  Transfer store_all(const float* x, const float* guide, const std::vector<uint8_t>& buried) const {
    return stand_ins.all() ? store(x) : spread_transfer(all, stand_ins, buried, guide, x, width(), channels(), options);
  }

  Result<Transfer> direct() {
    const auto start = Clock::now();
    const size_t W = sky_width();
    ZeroPages x(n() * width());
    std::vector<uint8_t> buried(n());
    const Shares shares(n(), gather_block);
    {
      ProgressStage stage(progress, "tracing", shares.own());
      const KeptPieces kept(progress, "tracing", n() / gather_block);
      shares.for_own([&](size_t begin, size_t end) {
        if (stage.cancelled()) return;
        std::vector<float> rows((end - begin) * W);
        const GatherSky sky{rows.data(), nullptr, W, &lobes, buried.data() + begin};
        const std::span<float> full(rows);
        const std::span<uint8_t> inside(buried.data() + begin, end - begin);
        if (!kept.load(begin / gather_block, full, inside)) {
          trace_sky(setup, *scratch.borrow(), begin, end - begin, sky);
          trace_sharp_lobes(begin, end - begin, sky);
          kept.save(begin / gather_block, full, inside);
        }
        for (size_t r = begin; r < end; ++r) expand(rows.data() + (r - begin) * W, x.data() + r * width());
        if (!stage.cancelled()) stage.advance(end - begin);
      });
      if (!none_cancelled(progress)) return Error{"", "cancelled"};
    }
    shares.gather(x.data(), width()), shares.gather(buried.data());
    fill_buried(make_fill_steps(scene, receivers.basis, buried), x.data(), width(), width());
    for (uint8_t b : buried) report.buried += b;
    report.trace_seconds = seconds_since(start), report.rays = n() * rays_each();
    return finish({std::move(x), {}}, buried, {});
  }

  Result<Transfer> bounced() {
    const size_t W = sky_width();
    const bool parted = is_parted();
    ZeroPages T0(n() * W);
    const size_t fixed =
        solution_bytes(n(), coefficients(), setup.channels, setup.sky_channels, options, vector_ranks()) +
        table_bytes(n(), scene.triangles.size(), coefficients(), size_t(options.samples)) +
        lobe_set_bytes(options.samples, lobes.count());
    auto B = GatherOperator::trace(
        setup,
        {.sky = {T0.data(), nullptr, W, &lobes, nullptr},
         .more = [&](size_t first, size_t count, const GatherSky& sky) { trace_sharp_lobes(first, count, sky); },
         .hits = options.bounces > 0,
         .memory = options.memory > fixed ? options.memory - fixed : 0},
        progress);
    if (!B) return B.error();
    report.trace_seconds = B->report().seconds, report.buried = B->report().buried;
    report.operator_bytes = B->report().bytes, report.operator_kept = B->report().kept;
    report.operator_file_bytes = B->report().file_bytes;
    report.working_memory = fixed + report.operator_bytes;

    const auto start = Clock::now();
    const Source source{[&](size_t r, float* x) { expand(T0.data() + r * W, x); }};
    // The last step beside the one before it, which is what measuring gathers find on the surfaces that they meet.
    ZeroPages last(n() * width()), now(n() * width()), next(options.bounces > 1 ? n() * width() : 0);
    auto before = bounce_in(now, next, *B, source, width(), options.bounces, progress,
                            [&](size_t first, size_t count, const float* y) {
                              std::copy_n(y, count * width(), last.data() + first * width());
                            });
    if (!before) return before.error();
    ZeroPages met = std::move(**before);
    now = {}, next = {};
    B->fill(last.data(), width());
    const Shares shares = B->shares();
    if (!parted) shares.gather(last.data(), width()), shares.gather(met.data(), width());
    std::vector<AlignedVector<float>> terms;
    if (options.keep_terms) {
      auto ok = bounce_terms(*B, source, width(), options.bounces, progress, [&](int, auto& x) -> Result<void> {
        shares.gather(x.data(), width());
        if (options.denoise) terms.push_back(x);
        else report.terms.push_back(store_all(x.data(), met.data(), B->buried()));
        return {};
      });
      if (!ok) return ok.error();
    }
    report.rays = n() * (rays_each() - size_t(options.samples)) + B->report().rays;
    report.bounce_seconds = seconds_since(start);
    const std::vector<uint8_t> buried = B->buried();
    B = Error{}, T0 = {};  // what comes has need of their memory
    // Without bounces surfaces are black.
    if (options.bounces == 0) return finish({std::move(met), {}}, buried, std::move(terms));
    return finish({std::move(last), std::move(met)}, buried, std::move(terms));
  }

  struct Solved {
    ZeroPages x, met;  // `met`: of one bounce less, on the surfaces that rays meet; empty: black
  };

  // Rows by rays of their own, at any place.
  Result<Transfer> finish(Solved solved, const std::vector<uint8_t>& buried, std::vector<AlignedVector<float>> terms) {
    const bool measures = options.denoise || options.certify, parted = is_parted();
    const uint32_t seed = uint32_t(hash64(options.seed, 0x6e6f6973));
    std::optional<GatherSetup> other;
    if (measures)
      other.emplace(make_gather_setup(scene, setup.tracer, receivers, options.order, options.samples, seed,
                                      square_to_cosine_hemisphere, progress));
    if (is_cancelled(progress)) return Error{"", "cancelled"};
    Pool<GatherScratch, DeleteScratch> others([&] { return make_gather_scratch(*other); });
    GathersAhead ahead(parted ? n() : 0);
    const GatherAt gather = [&](Vec3 origin, Vec3 normal, uint64_t key, float* row) {
      std::optional<GathersAhead::Traced> at;
      if (parted) at = ahead.take(key);
      if (!at) {
        at.emplace().row.resize(sky_width());
        const GatherSky sky{at->row.data(), nullptr, sky_width(), &lobes, nullptr};
        at->clear =
            trace_point(*other, *others.borrow(), origin, normal, key, sky, solved.met.empty() ? nullptr : &at->met);
        if (!lobes.sharp.empty())
          trace_lobes(lobes, setup.tracer, origin, normal, size_t(key), *lobe_rays.borrow(),
                      at->row.data() + harmonics(), nullptr, coefficients());
        if (parted) return ahead.put(key, std::move(*at));
      }
      std::vector<float> met(width());
      add_up(at->met, size_t(setup.channels), solved.met.data(), width(), met.data());
      expand(at->row.data(), row);
      for (size_t k = 0; k < width(); ++k) row[k] += met[k];
      return at->clear;
    };
    const AskForRows asks{[&](const auto& asked) { ask(asked, solved.x); }, [&] { ask(ahead.asked(), solved.met); }};
    if (parted) forget_others(shares(), solved.met, width());
    if (measures)
      if (auto ok = measure_noise(solved.x, buried, terms, gather, parted ? &asks : nullptr); !ok) return ok.error();
    if (parted && !options.own_part) shares().gather(solved.x.data(), width());
    Transfer result = parted && options.own_part ? store_own_columns(shares(), options.light(), solved.x.data(),
                                                                     channels(), n(), width(), options.precision)
                                                 : store_all(solved.x.data(), solved.x.data(), buried);
    for (AlignedVector<float>& term : terms)
      report.terms.push_back(store_all(term.data(), solved.x.data(), buried)), term = {};
    if (options.certify) {
      const auto start = Clock::now();
      const FieldRow field = [&](uint32_t r, float* row) {
        if (stand_ins.all()) std::copy_n(solved.x.data() + size_t(r) * width(), width(), row);
        else load_row(result, r, row);
      };
      const ReflectedErrors reflected{*other, solved.met.empty() ? 0 : options.bounces};
      auto certificate = certify_field(scene, all, field, width(), gather, certified_places, seed, progress, &reflected,
                                       nullptr, nullptr, parted ? &asks : nullptr);
      if (!certificate) return certificate.error();
      report.certificate = std::move(*certificate), report.error = report.certificate.error;
      // As much less by denoising as at the receivers, but no less than a mean of neighbours can have.
      report.noise = report.certificate.noise;
      if (options.denoise && report.noise_of_rays > 0)
        report.noise *= std::max(report.denoised / report.noise_of_rays, least_noise_left);
      report.noise = std::min(report.noise, report.error);
      report.certify_seconds = seconds_since(start);
    }
    return result;
  }

  // Second gathers at one receiver in 16 tell the noise; with it, it is taken away, and they tell what is left.
  Result<void> measure_noise(ZeroPages& x, const std::vector<uint8_t>& buried, std::vector<AlignedVector<float>>& terms,
                             const GatherAt& gather, const AskForRows* asks) {
    const auto start = Clock::now();
    std::vector<uint32_t> measured, own;
    const Shares of = shares();
    for (uint32_t r = 0; r < n(); r += check_every)
      if (!buried[r]) measured.push_back(r);
    for (uint32_t r : measured)
      if (of.owner(r) == of.ranks().rank()) own.push_back(r);
    AlignedVector<float> again(own.size() * width());
    struct Told {
      float variance = 0;
      double left = 0, total = 0;
    };
    std::vector<Told> told(checked_count(n()));  // of receivers that are measured
    {
      // As many at a time as what their rays met has room for.
      const size_t each = asks ? size_t(options.samples) * 3 * sizeof(MetRow) : 1,
                   room = std::max(options.memory / 4, size_t{1} << 24),
                   batches = std::max<size_t>(measured.size() / size_t(of.ranks().count()) * each / room, 1);
      ProgressStage stage(progress, "measuring the noise", own.size());
      for (size_t b = 0; b < batches; ++b) {
        const size_t first = own.size() * b / batches, count = own.size() * (b + 1) / batches - first;
        const auto gather_all = [&](auto take) {
          parallel_for(count, 4, [&](size_t begin, size_t end) {
            for (size_t i = first + begin; i < first + end && !stage.cancelled(); ++i) {
              const uint32_t r = own[i];
              gather(receivers.origins[r], receivers.normals[r], r, again.data() + i * width());
              take(r, again.data() + i * width());
            }
          });
        };
        if (asks) gather_all([](uint32_t, const float*) {}), asks->met();
        gather_all([&](uint32_t r, const float* row) {
          told[r / check_every].variance = float(0.5 * squared_difference(row, x.data() + size_t(r) * width()));
          if (!stage.cancelled()) stage.advance(1);
        });
        if (!none_cancelled(progress)) return Error{"", "cancelled"};
      }
    }
    of.gather_each(check_every, told.data());
    std::vector<float> variance;
    for (uint32_t r : measured) variance.push_back(told[r / check_every].variance);
    ZeroPages out(options.denoise ? n() * width() : 0);
    if (options.denoise) {
      NoisyPlaces noisy{receivers.origins, receivers.normals, buried, measured, variance};
      if (asks) noisy.ask = asks->field;
      if (auto ok = denoise_harmonics(noisy, x, out, terms); !ok) return ok;
    }
    for (size_t i = 0; i < own.size(); ++i) {
      const size_t at = size_t(own[i]) * width();
      const float* row = again.data() + i * width();
      Told& t = told[own[i] / check_every];
      if (options.denoise) t.left = squared_difference(row, out.data() + at) - double(t.variance);
      for (size_t k = 0; k < harmonics() * size_t(channels()); ++k)
        t.total += double(row[k]) * double(x.data()[at + k]);
    }
    of.gather_each(check_every, told.data());
    double noise = 0, left = 0, total = 0;
    for (const Told& t : told) noise += double(t.variance), left += t.left, total += t.total;
    if (total > 0) report.noise_of_rays = std::sqrt(noise / total);
    if (options.denoise) {
      if (total > 0) report.denoised = std::sqrt(std::max(0.0, left) / total);
      x = std::move(out);
    }
    report.denoise_seconds = seconds_since(start);
    return {};
  }
  // All by the weights of x's noise. Lobes are left alone: sharp ones have rays of their own, and shadows that
  // harmonics do not tell of.
  Result<void> denoise_harmonics(const NoisyPlaces& noisy, const ZeroPages& x, ZeroPages& out,
                                 std::vector<AlignedVector<float>>& terms) {
    const size_t values = harmonics() * size_t(channels()), w = lobes.count() ? pad_lanes(values) : width();
    auto copy_values = [&](const auto& from, size_t from_width, auto& to, size_t to_width) {
      for (size_t r = 0; r < n(); ++r) std::copy_n(from.data() + r * from_width, values, to.data() + r * to_width);
    };
    std::vector<AlignedVector<float>> apart;  // where rows hold lobes, too: the harmonics of x, of out, of each term
    if (lobes.count()) {
      apart.assign(2 + terms.size(), AlignedVector<float>(n() * w, 0.0f));
      copy_values(x, width(), apart[0], w);
      for (size_t t = 0; t < terms.size(); ++t) copy_values(terms[t], width(), apart[2 + t], w);
    }
    std::vector<float*> more;
    for (size_t t = 0; t < terms.size(); ++t) more.push_back(apart.empty() ? terms[t].data() : apart[2 + t].data());
    auto ok = denoise(noisy, apart.empty() ? x.data() : apart[0].data(), w,
                      apart.empty() ? out.data() : apart[1].data(), more, progress);
    if (!ok || apart.empty()) return ok;
    std::copy_n(x.data(), n() * width(), out.data());
    copy_values(apart[1], w, out, width());
    for (size_t t = 0; t < terms.size(); ++t) copy_values(apart[2 + t], w, terms[t], width());
    return {};
  }
  // Of the harmonics.
  double squared_difference(const float* a, const float* b) const {
    double sum = 0;
    for (size_t k = 0; k < harmonics() * size_t(channels()); ++k) sum += double(a[k] - b[k]) * double(a[k] - b[k]);
    return sum;
  }
};

size_t least_memory_of(size_t receivers, bool coloured, const BakeOptions& options, size_t ranks) {
  const size_t coefficients = options.light().count();
  const size_t tables = table_bytes(options.bounces > 0 ? receivers : 0, 0, coefficients, size_t(options.samples)) +
                        lobe_set_bytes(options.samples, options.lobes.size());
  if (!options.shadows) return 0;
  return tables + solution_bytes(receivers, coefficients, coloured && options.bounces > 0 ? 3 : 1, 1, options, ranks);
}

Result<void> check_options(const BakeOptions& o) {
  if (auto ok = check_light_basis(o, o.lobes.empty() ? 1 : 0); !ok) return ok;
  if (o.samples < 1 || o.samples > 1 << 20)
    return Error{"samples", "must lie between 1 and 1048576, not " + std::to_string(o.samples)};
  if (!(o.error >= 0 && o.error <= 1))
    return Error{"error", "must lie between 0 and 1, not " + std::to_string(o.error)};
  if (o.bounces < 0 || o.bounces > 64)
    return Error{"bounces", "must lie between 0 and 64, not " + std::to_string(o.bounces)};
  if (o.projection == Projection::collocation) return {};
  if (!o.lobes.empty() || o.denoise || o.error > 0 || !o.shadows || o.meshless)
    return Error{"projection", "least squares are of harmonics, with samples, and neither denoised nor meshless"};
  return check_projection_ranks();
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
  return least_memory_of(receivers, coloured, options, 1);
}

namespace {

Result<Transfer> bake_with_samples(const Scene& scene, const Tracer& tracer, const Receivers& all,
                                   const StandIns& stand_ins, const BakeOptions& options, BakeReport& r,
                                   Progress* progress) {
  const Receivers& receivers = stand_ins.all() ? all : stand_ins.own;
  const std::optional<LeastSquares> projection =
      least_squares_of(scene, receivers, options.projection, options.samples, options.seed);
  GatherSetup setup = make_gather_setup(scene, tracer, receivers, options.order, options.shadows ? options.samples : 1,
                                        options.seed, square_to_cosine_hemisphere, progress);
  setup.projection = projection ? &*projection : nullptr;
  Baker baker{scene, all, stand_ins, receivers, options, std::move(setup), progress, r};
  const size_t least = least_memory_of(receivers.count(), baker.setup.channels == 3, options, baker.vector_ranks());
  if (options.memory < least)
    return Error{scene.path, "baking needs at least " + std::to_string(least) +
                                 " bytes of working memory, and was allowed " + std::to_string(options.memory)};
  const bool by_operator = options.bounces > 0 || projection;
  auto result = !options.shadows ? baker.unshadowed() : by_operator ? baker.bounced() : baker.direct();
  if (!result) return result;
  if (options.keep_terms && r.terms.empty()) r.terms = {*result};
  r.receivers = all.count(), r.traced = receivers.count(), r.bytes = result->bytes(), r.samples = options.samples;
  return result;
}

// Rounds, each from the start: one with few rays tells how many it takes.
Result<Transfer> bake_to_error(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                               const BakeOptions& asked, BakeReport& r, Progress* progress) {
  constexpr int first = 128, most = 1 << 16;
  constexpr double slope = 0.75;  // denoised noise falls as rays to about this power
  const auto start = Clock::now();
  BakeOptions options = asked;
  options.certify = true, options.samples = first;
  auto stand_ins = choose_stand_ins(scene, tracer, receivers, options, progress);
  if (!stand_ins) return stand_ins.error();
  size_t rays = stand_ins->rays;
  double traced = seconds_since(start), bounced = 0;
  for (;;) {
    const auto round = Clock::now();
    r = {};
    auto transfer = bake_with_samples(scene, tracer, receivers, *stand_ins, options, r, progress);
    if (!transfer) return transfer;
    rays += r.rays, traced += r.trace_seconds, bounced += r.bounce_seconds;
    r.rays = rays, r.trace_seconds = traced, r.bounce_seconds = bounced;
    const double target = options.error, error = r.certificate.error, noise = r.noise,
                 between = std::sqrt(std::max(0.0, error * error - noise * noise));
    // Where little is lost between receivers, noise may take the rest. Else half of what is lost there: less would
    // hardly be seen beside it, an eighth of the whole. But in the shade of a sun noise is what is seen.
    const double wanted = between < 0.5 * target ? 0.9 * std::sqrt(target * target - between * between)
                                                 : std::clamp(0.5 * between, 0.3 * target, 1.5 * target);
    const double ratio = std::clamp(std::pow(noise / wanted, 1 / slope), 1.5, 16.0);
    const bool late = this_ranks().from_first(options.seconds >= 0 &&
                                              seconds_since(start) + seconds_since(round) * ratio > options.seconds);
    if (!(noise > wanted && error > target) || options.samples == most || late) return transfer;
    options.samples = std::min(most, int(std::lround(double(options.samples) * ratio / 64)) * 64);
  }
}

// With so many samples as the options say.
Result<Transfer> bake_on_receivers(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                   const BakeOptions& options, BakeReport& r, Progress* progress) {
  StandIns stand_ins{keep_all(receivers.count()), {}};
  if (options.meshless) {
    auto points = choose_stand_ins(scene, tracer, receivers, options, progress);
    if (!points) return points.error();
    stand_ins = std::move(*points);
  }
  return bake_with_samples(scene, tracer, receivers, stand_ins, options, r, progress);
}

}  // namespace

Result<Transfer> bake(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const BakeOptions& options,
                      BakeReport* report, Progress* progress) {
  if (auto ok = check_options(options); !ok) return ok.error();
  if (receivers.count() == 0) return Error{scene.path, "nothing to bake: no triangle has an area"};
  BakeReport unwanted;
  BakeReport& r = report ? *report : unwanted;
  r = {};
  if (options.order == 0 && options.lobe_kind == LobeKind::band_limited) {
    BakeOptions harmonics = options;
    harmonics.lobes.clear(), harmonics.precision = Precision::single;
    for (const Lobe& lobe : options.lobes) harmonics.order = std::max(harmonics.order, int(lobe.sharpness));
    auto baked = bake(scene, tracer, receivers, harmonics, &r, progress);
    if (!baked) return baked;
    for (Transfer& term : r.terms) term = add_up_lobes(term, options.light(), options.precision);
    Transfer result = add_up_lobes(*baked, options.light(), options.precision);
    r.bytes = result.bytes();
    return result;
  }
  return options.error > 0 && options.shadows ? bake_to_error(scene, tracer, receivers, options, r, progress)
                                              : bake_on_receivers(scene, tracer, receivers, options, r, progress);
}

}  // namespace lambent

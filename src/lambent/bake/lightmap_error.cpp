#include <lambent/bake/certify_field.h>
#include <lambent/bake/denoise.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/lightmap_error.h>
#include <lambent/bake/thin.h>
#include <lambent/bake/unbury.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace lambent {
namespace {

constexpr size_t fewest_places = 1024, most_places = 4096;  // of the certificate
constexpr double noise_slope = 0.75;                        // denoised noise falls as rays to about this power
constexpr double spread_part = 0.3;  // of the error that choosing receivers may lose, for direct light and bounces
constexpr double noise_part = 0.5;   // and noise of each
constexpr int most_samples = 1 << 13, pilot_samples = 24, first_bounced = 96;
constexpr int most_reflected = 8;  // bounces of which certificates look for errors
constexpr size_t piece = 16;

double squares(const float* a, const float* b, size_t width) {
  double sum = 0;
  for (size_t k = 0; k < width; ++k) sum += double(a[k] - b[k]) * double(a[k] - b[k]);
  return sum;
}

// Light that arrives anywhere, from lamps and from surfaces that send x, by rays of its own.
struct Gatherer {
  const Lamps& lamps;
  int lamp_samples;  // 0: bounces alone
  GatherSetup setup;
  size_t width;
  Pool<GatherScratch, DeleteScratch> scratch{[this] { return make_gather_scratch(setup); }};

  Gatherer(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Lamps& l, int towards, int rays,
           uint32_t seed, Progress* progress)
      : lamps(l),
        lamp_samples(towards),
        setup(make_gather_setup(scene, tracer, receivers, 1, rays, seed, square_to_cosine_hemisphere, progress)),
        width(pad_lanes(3 * l.groups())) {}

  // Sets `row`; false: inside something.
  bool operator()(Vec3 origin, Vec3 normal, uint64_t key, const float* x, float* row) {
    float unwanted[3];
    std::vector<float> lit(lamp_samples > 0 ? width : 0, 0.0f);
    const GatherSky sky{unwanted, nullptr, setup.sky_width(), nullptr, nullptr};
    const GatherDirect direct{lamps, lamp_samples, lit.data(), width};
    const bool clear = gather_point(setup, *scratch.borrow(), origin, normal, key, sky, x, width, row,
                                    lamp_samples > 0 ? &direct : nullptr);
    for (size_t k = 0; k < lit.size(); ++k) row[k] += lit[k];
    return clear;
  }
};

// Rows of some receivers into `rows`, [i][width], of all ranks; x: what surfaces send, or null. inside: may be null.
Result<void> gather_all(const char* name, const Receivers& receivers, std::span<const uint32_t> which, Gatherer& gather,
                        const float* x, float* rows, uint8_t* inside, Progress* progress) {
  const Shares shares(which.size(), piece);
  ProgressStage stage(progress, name, shares.own());
  shares.for_own([&](size_t begin, size_t end) {
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
      const uint32_t r = which[i];
      const bool clear = gather(receivers.origins[r], receivers.normals[r], r, x, rows + i * gather.width);
      if (inside) inside[i] = !clear;
    }
    if (!stage.cancelled()) stage.advance(end - begin);
  });
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  shares.gather(rows, gather.width);
  if (inside) shares.gather(inside);
  return {};
}

// Rows of some receivers, their noise taken away, and of all.
struct Stage {
  Thinned thinned;
  AlignedVector<float> rows;      // [chosen][width]
  std::vector<uint8_t> buried;    // of the chosen
  double noise2 = 0, total2 = 0;  // mean squares over all receivers: of noise that is left, of the rows
};

struct LightmapSolver {
  const Scene& scene;
  const Tracer& tracer;
  const Receivers& receivers;
  const Lamps& lamps;
  const LightmapOptions& o;
  LightmapReport& report;
  Progress* progress;
  size_t width = pad_lanes(3 * lamps.groups());
  bool coloured_sky = false;
  int direct_samples = o.lamp_samples, samples = first_bounced;
  Stage direct{}, bounced{};
  AlignedVector<float> lit{};                 // direct light of all receivers
  AlignedVector<float> met{};                 // of the chosen of `bounced`: what rays find on surfaces, less a bounce
  std::optional<Receivers> cells{};           // those, and what stands for what
  std::vector<AlignedVector<float>> terms{};  // of all receivers

  bool bounces() const { return o.converge > 0 || o.bounces > 0; }
  int fan_of(int towards) const { return lamps.sky || !lamps.area.empty() ? towards : 16; }

  Result<Thinned> choose(const char* name, int towards, int rays, const float* x, double square) {
    const PilotRows pilot = [&](std::span<const uint32_t> which, uint32_t pass, float* rows, uint8_t* inside) {
      Gatherer gather(scene, tracer, receivers, lamps, towards, rays, uint32_t(hash64(o.seed, 0x6c + pass)), progress);
      return gather_all(name, receivers, which, gather, x, rows, inside, progress);
    };
    auto thinned = thin(scene, receivers, width, pilot, {.error = spread_part * o.error, .square = square});
    if (thinned) report.rays += thinned->tried * size_t(rays + towards);
    return thinned;
  }

  // Takes noise away, and tells how much is left, by second gathers at one of the chosen in 16.
  // `more`: terms of the rows, changed alike.
  Result<void> clean(Stage& s, Gatherer& other, const float* x, std::vector<AlignedVector<float>>& more) {
    const std::vector<uint32_t>& chosen = s.thinned.chosen;
    std::vector<uint32_t> measured, which;
    for (uint32_t c = 0; c < chosen.size(); c += uint32_t(check_every))
      if (!s.buried[c]) measured.push_back(c), which.push_back(chosen[c]);
    AlignedVector<float> again(measured.size() * width);
    if (auto ok = gather_all("measuring the noise", receivers, which, other, x, again.data(), nullptr, progress); !ok)
      return ok;
    std::vector<float> variance(measured.size());
    for (size_t i = 0; i < measured.size(); ++i)
      variance[i] = float(0.5 * squares(again.data() + i * width, s.rows.data() + size_t(measured[i]) * width, width));
    AlignedVector<float> out(s.rows.size());
    std::vector<Vec3> places, normals;
    for (uint32_t r : chosen) places.push_back(receivers.origins[r]), normals.push_back(receivers.normals[r]);
    if (o.denoise) {
      std::vector<float*> others;
      for (AlignedVector<float>& term : more) others.push_back(term.data());
      auto ok =
          denoise({places, normals, s.buried, measured, variance}, s.rows.data(), width, out.data(), others, progress);
      if (!ok) return ok;
    }
    std::vector<double> members(chosen.size(), 0.0);
    for (uint32_t c : s.thinned.of) members[c] += 1;
    double all = 0;
    s.noise2 = s.total2 = 0;
    for (size_t i = 0; i < measured.size(); ++i) {
      const size_t c = measured[i];
      const float *row = again.data() + i * width, *first = s.rows.data() + c * width;
      s.noise2 += members[c] *
                  (o.denoise ? squares(row, out.data() + c * width, width) - double(variance[i]) : double(variance[i]));
      for (size_t k = 0; k < width; ++k) s.total2 += members[c] * double(row[k]) * double(first[k]);
      all += members[c];
    }
    if (all > 0) s.noise2 = std::max(0.0, s.noise2 / all), s.total2 /= all;
    if (o.denoise) s.rows = std::move(out);
    return {};
  }

  // All receivers' rows from the chosen ones'.
  void spread(const Stage& s, const AlignedVector<float>& rows, AlignedVector<float>& out, bool add) {
    const Spread of(receivers, s.thinned, s.buried, s.rows.data(), width);
    if (!add) out.assign(receivers.count() * width, 0.0f);
    const Shares shares(receivers.count(), 64);
    shares.for_own([&](size_t begin, size_t end) {
      AlignedVector<float> row(width);
      for (size_t r = begin; r < end; ++r) {
        of.row(r, rows.data(), width, row.data());
        for (size_t k = 0; k < width; ++k) out[r * width + k] += row[k];
      }
    });
    shares.gather(out.data(), width);
  }

  Result<void> solve_direct() {
    Stage& s = direct;
    const size_t n = s.thinned.chosen.size();
    Gatherer gather(scene, tracer, receivers, lamps, direct_samples, fan_of(direct_samples), o.seed, progress),
        other(scene, tracer, receivers, lamps, direct_samples, fan_of(direct_samples), uint32_t(hash64(o.seed, 0x61)),
              progress);
    s.rows.assign(n * width, 0.0f), s.buried.assign(n, 0);
    if (auto ok = gather_all("tracing direct light", receivers, s.thinned.chosen, gather, nullptr, s.rows.data(),
                             s.buried.data(), progress);
        !ok)
      return ok;
    report.rays += n * size_t(direct_samples + fan_of(direct_samples));
    std::vector<AlignedVector<float>> none_apart;
    if (auto ok = clean(s, other, nullptr, none_apart); !ok) return ok;
    const Receivers own = s.thinned.all() ? Receivers() : thinned_receivers(receivers, s.thinned);
    fill_buried(make_fill_steps(scene, (s.thinned.all() ? receivers : own).basis, s.buried), s.rows.data(), width,
                width);
    spread(s, s.rows, lit, false);
    return {};
  }

  // Direct light as cells of the chosen receivers have it in the mean.
  AlignedVector<float> cell_means() const {
    const Thinned& t = bounced.thinned;
    AlignedVector<float> mean(t.chosen.size() * width, 0.0f);
    std::vector<float> members(t.chosen.size(), 0.0f);
    for (size_t r = 0; r < t.of.size(); ++r) {
      members[t.of[r]] += 1;
      for (size_t k = 0; k < width; ++k) mean[size_t(t.of[r]) * width + k] += lit[r * width + k];
    }
    for (size_t c = 0; c < members.size(); ++c)
      for (size_t k = 0; k < width; ++k) mean[c * width + k] /= members[c];
    return mean;
  }

  Result<void> solve_bounced() {
    const auto start = Clock::now();
    Stage& s = bounced;
    const GatherSetup setup =
        make_gather_setup(scene, tracer, *cells, 1, samples, o.seed, square_to_cosine_hemisphere, progress);
    auto op = GatherOperator::trace(
        setup, nullptr, nullptr, true,
        o.memory - std::min(o.memory, least_lightmap_memory(receivers.count(), lamps.groups(), o)), progress);
    if (!op) return op.error();
    report.trace_seconds += seconds_since(start);
    const auto solving = Clock::now();
    AlignedVector<float> e = cell_means();
    s.buried = op->buried();
    const Shares shares = op->shares();
    op->fill(e.data(), width), shares.gather(e.data(), width);
    AlignedVector<float> x(e.size());
    if (o.converge > 0) {
      report.solve = {};
      auto solved = solve(*op, e.data(), width, {o.solver, o.converge, 200}, &report.solve, progress);
      if (!solved) return solved.error();
      x = std::move(*solved), shares.gather(x.data(), width), met = x;
    } else {
      auto solved = bounce(
          *op, source_of(e.data(), width), width, o.bounces, progress,
          [&](size_t first, size_t count, const float* y) { std::copy_n(y, count * width, x.data() + first * width); });
      if (!solved) return solved.error();
      met = std::move(solved->x), shares.gather(met.data(), width);
      op->fill(x.data(), width), shares.gather(x.data(), width);
    }
    for (size_t i = 0; i < x.size(); ++i) x[i] -= e[i];
    s.rows = std::move(x);
    report.bounce_seconds += seconds_since(solving);
    report.rays += op->report().rays, report.buried = op->report().buried;
    report.operator_bytes = op->report().bytes, report.operator_kept = op->report().kept;
    report.operator_file_bytes = op->report().file_bytes;
    std::vector<AlignedVector<float>> apart;  // the terms, but for direct light
    if (o.keep_terms) {
      auto take = [&](int k, AlignedVector<float>& term) -> Result<void> {
        shares.gather(term.data(), width);
        if (k > 0) apart.push_back(term);
        return {};
      };
      if (auto ok = bounce_terms(*op, source_of(e.data(), width), width, o.bounces, progress, take); !ok) return ok;
    }
    Gatherer other(scene, tracer, *cells, lamps, 0, samples, uint32_t(hash64(o.seed, 0x62)), progress);
    if (auto ok = clean(s, other, met.data(), apart); !ok) return ok;
    terms.assign(o.keep_terms ? 1 : 0, lit);
    for (const AlignedVector<float>& term : apart) terms.emplace_back(), spread(s, term, terms.back(), false);
    return {};
  }

  Result<void> measure(const AlignedVector<float>& all, const Receivers& basis) {
    const auto start = Clock::now();
    const int towards = std::max(direct_samples, 64), rays = std::max(fan_of(towards), std::min(samples, 512));
    Gatherer gather(scene, tracer, basis, lamps, towards, rays, uint32_t(hash64(o.seed, 0x63)), progress);
    const GatherAt at = [&](Vec3 origin, Vec3 normal, uint64_t key, float* row) {
      return gather(origin, normal, key, bounces() ? met.data() : nullptr, row);
    };
    const FieldRow field = [&](uint32_t r, float* row) { std::copy_n(all.data() + size_t(r) * width, width, row); };
    const ReflectedErrors reflected{gather.setup, !bounces() ? 0 : o.converge > 0 ? most_reflected : o.bounces};
    const size_t places = std::clamp(receivers.count() / 8, fewest_places, most_places);
    auto certificate =
        certify_field(scene, receivers, field, width, at, places, uint32_t(hash64(o.seed, 0x64)), progress, &reflected);
    if (!certificate) return certificate.error();
    report.certificate = std::move(*certificate);
    report.certify_seconds += seconds_since(start);
    return {};
  }

  // Rounds: of each kind of light as many rays as bring its noise to its part of the error.
  Result<SolvedLightmap> run() {
    const auto start = Clock::now();
    auto chosen = choose("looking where light changes", pilot_samples, fan_of(pilot_samples), nullptr, 0);
    if (!chosen) return chosen.error();
    direct.thinned = std::move(*chosen);
    bool direct_is_new = true, bounced_is_new = bounces();
    AlignedVector<float> all;
    for (int round = 0;; ++round) {
      const auto begun = Clock::now();
      if (direct_is_new) {
        if (auto ok = solve_direct(); !ok) return ok.error();
        report.trace_seconds += seconds_since(begun);
      }
      if (bounces() && !cells) {
        double square = 0;
        for (float v : lit) square += double(v) * double(v);
        auto few =
            choose("looking where reflected light changes", 0, 64, lit.data(), square / double(receivers.count()));
        if (!few) return few.error();
        bounced.thinned = std::move(*few);
        cells = bounced.thinned.all() ? receivers : thinned_receivers(receivers, bounced.thinned);
      }
      if (bounced_is_new || (bounces() && direct_is_new))
        if (auto ok = solve_bounced(); !ok) return ok.error();
      all = lit;
      if (bounces()) spread(bounced, bounced.rows, all, true);
      if (auto ok = measure(all, cells ? *cells : receivers); !ok) return ok.error();
      double total = 0;
      for (float v : all) total += double(v) * double(v);
      total /= double(receivers.count());
      report.direct_noise = total > 0 ? std::sqrt(direct.noise2 / total) : 0;
      report.bounced_noise = total > 0 && bounces() ? std::sqrt(bounced.noise2 / total) : 0;
      auto more = [&](double noise, int now) {
        const double ratio = std::clamp(std::pow(noise / (noise_part * o.error), 1 / noise_slope), 1.0, 16.0);
        return ratio < 1.3 ? now : std::min(most_samples, int(std::lround(double(now) * ratio / 8)) * 8);
      };
      const int next_direct = more(report.direct_noise, direct_samples), next = more(report.bounced_noise, samples);
      direct_is_new = next_direct > direct_samples, bounced_is_new = bounces() && next > samples;
      const double growth = std::max(double(next_direct) / direct_samples, double(next) / samples);
      const bool late =
          this_ranks().from_first(o.seconds >= 0 && seconds_since(start) + seconds_since(begun) * growth > o.seconds);
      if (round == 2 || late || !(direct_is_new || bounced_is_new) || report.certificate.error <= o.error) break;
      direct_samples = next_direct, samples = bounced_is_new ? next : samples;
    }
    if (o.keep_terms && !bounces()) terms.assign(1, lit);
    report.direct_samples = direct_samples, report.samples = bounces() ? samples : 0;
    report.direct_traced = direct.thinned.chosen.size(), report.bounced_traced = bounced.thinned.chosen.size();
    return SolvedLightmap{std::move(all), std::move(lit), std::move(terms)};
  }
};

// By how much denser than at the second look texels must be to lose no more than `error`, where the first, half as
// dense, lost `first`: the square is a part 1/x, of shadows' edges, and a part 1/x^4, of light that look-ups take as
// linear.
double denser(double first, double second, double error) {
  const double all = second * second, edges = std::clamp((16 * all - first * first) / 14, 0.0, all);
  double low = 0.5, high = 1e6;
  while (high > 1.001 * low) {
    const double x = std::sqrt(low * high);
    (edges / x + (all - edges) / (x * x * x * x) > error * error ? low : high) = x;
  }
  return high;
}

}  // namespace

Result<SolvedLightmap> solve_lightmap_to_error(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                               const Lamps& lamps, const LightmapOptions& options,
                                               LightmapReport& report, Progress* progress) {
  return LightmapSolver{scene, tracer, receivers, lamps, options, report, progress}.run();
}

Result<float> lightmap_density(const Scene& scene, const Lamps& lamps, double error, size_t most, uint32_t seed,
                               std::string* remark, Progress* progress) {
  constexpr size_t first_texels = 10'000, places = 1024;
  constexpr int rays = 32;
  constexpr double part = 0.7;  // of the error, for what look-ups lose
  double area = 0;
  for (const Triangle& t : scene.triangles)
    area += 0.5 * double(area_length(area_normal(scene, t))) * (t.two_sided ? 2 : 1);
  if (!(area > 0)) return Error{scene.path, "nothing to bake: no triangle has an area"};
  const double limit = std::sqrt(double(most) / area);
  double density = std::min(limit, std::sqrt(double(first_texels) / area)), lost[2] = {0, 0};
  const size_t width = pad_lanes(3 * lamps.groups());
  for (int k = 0; k < 2; ++k) {
    if (k == 1) density = std::min(limit, 2 * density);
    Scene copy = scene;
    auto atlas = make_atlas(copy, {.texels_per_unit = float(density), .reuse = false}, progress);
    if (!atlas) return atlas.error();
    Receivers receivers = make_texel_receivers(copy, *atlas);
    auto tracer = Tracer::build(copy, progress);
    if (!tracer) return tracer.error();
    move_buried_texels(copy, *tracer, *atlas, receivers, progress);
    std::vector<float> rows[2];
    std::vector<uint32_t> every(receivers.count());
    std::iota(every.begin(), every.end(), 0u);
    for (uint32_t pass = 0; pass < 2; ++pass) {
      Gatherer gather(copy, *tracer, receivers, lamps, rays, rays, uint32_t(hash64(seed, 0x70 + pass)), progress);
      rows[pass].resize(receivers.count() * width);
      auto ok = gather_all("looking how finely light varies", receivers, every, gather, nullptr, rows[pass].data(),
                           nullptr, progress);
      if (!ok) return ok.error();
    }
    Gatherer measuring(copy, *tracer, receivers, lamps, 4 * rays, 4 * rays, uint32_t(hash64(seed, 0x72)), progress);
    const GatherAt at = [&](Vec3 origin, Vec3 normal, uint64_t key, float* row) {
      return measuring(origin, normal, key, nullptr, row);
    };
    auto field = [&](const std::vector<float>& of) {
      return FieldRow([&of, width](uint32_t r, float* row) { std::copy_n(of.data() + size_t(r) * width, width, row); });
    };
    const FieldRow one = field(rows[0]), two = field(rows[1]);
    auto certificate = certify_field(copy, receivers, one, width, at, places, seed, progress, nullptr, &two);
    if (!certificate) return certificate.error();
    lost[k] = std::max(certificate->error, 0.0);
  }
  const double wanted = density * denser(lost[0], lost[1], part * error);
  const double taken = std::min(wanted, limit);
  if (remark)
    *remark = fmt::format("{:.3g} texels a unit, {} (at {:.3g} look-ups lose {:.1f}%)", taken,
                          wanted > limit
                              ? fmt::format("all that --quality and --memory allow; light asks for {:.3g}", wanted)
                              : "as light asks for",
                          density, 100 * lost[1]);
  return float(taken);
}

}  // namespace lambent

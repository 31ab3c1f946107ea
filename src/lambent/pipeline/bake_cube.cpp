// Follows: Ng, Ramamoorthi, Hanrahan 2003 (wavelets); general-prt (bounces as a linear operator on the rows).
#include <lambent/pipeline/bake_cube.h>

#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/compress/haar_rows.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>
#include <lambent/pipeline/text.h>
#include <lambent/transfer/haar_columns.h>

#include <fmt/format.h>

#include <algorithm>

namespace lambent {
namespace {

// Columns of the light that bounce together: widths are multiples of lane_multiple for one channel and three.
constexpr size_t columns_together = 48;

// What rows are made of, so that what they leave out is little beside what the rows made of them leave out.
HaarFitOptions finer(const HaarFitOptions& o) { return {.error = o.keep > 0 ? 0.005 : o.error / 4}; }

struct HaarOutcome {
  HaarTransfer transfer;
  HaarFitReport fit;
};

// X = T0 + B X after so many bounces. No bounce makes light of a column that direct light has not.
Result<HaarOutcome> bounce_rows(const LinearOperator& op, int bounces, size_t channels, const HaarTransfer& direct,
                                double error, const HaarFitOptions& fit, size_t memory, Progress* progress) {
  const size_t n = direct.receivers, width = columns_together * channels;
  AlignedVector<float> x0(n * width), x;
  const Source source{[&](size_t r, float* y) { std::copy_n(x0.data() + r * width, width, y); }};
  HaarColumnsMaker maker{direct.size, int(channels), n, columns_together, haar_squares(direct), error, {}};
  for (double& s : maker.squares) s *= double(channels);
  maker.make = [&](size_t first, size_t count) -> Result<std::span<const float>> {
    std::fill(x0.begin(), x0.end(), 0.0f);
    if (!load_columns(direct, first, count, width, channels, x0.data())) return std::span<const float>();
    for (size_t i = 0; i < x0.size() && channels > 1; i += channels) x0[i + 1] = x0[i + 2] = x0[i];
    auto solved = bounce(op, source, width, bounces);
    if (!solved) return solved.error();
    op.shares().gather(solved->x.data(), width);
    x = std::move(solved->x);
    return std::span<const float>(x);
  };
  HaarFitReport report;
  auto stored = store_haar_columns(maker, fit, memory, &report, progress, "bouncing wavelets");
  if (!stored) return stored.error();
  return HaarOutcome{std::move(*stored), report};
}

Result<HaarOutcome> bounce_haar(const BakePlan& plan, const HaarFitOptions& options, const Visibility& seen,
                                const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Job& job,
                                BakeReport& report) {
  HaarFitReport fit;
  auto direct = fit_haar(seen, receivers.normals, finer(options), &fit, job.progress);
  if (!direct) return direct.error();
  const GatherSetup setup = make_gather_setup(scene, tracer, receivers, 1, plan.bake.samples, plan.bake.seed,
                                              square_to_cosine_hemisphere, job.progress);
  const size_t half = plan.bake.memory / 2;  // rows of the operator, and rows in wavelets
  auto B = GatherOperator::trace(setup, nullptr, nullptr, true, half, job.progress);
  if (!B) return B.error();
  report.rays += B->report().rays, report.trace_seconds += B->report().seconds, report.buried = B->report().buried;
  report.operator_bytes = B->report().bytes, report.operator_kept = B->report().kept;
  const auto start = Clock::now();
  auto bounced =
      bounce_rows(*B, plan.bake.bounces, size_t(setup.channels), *direct, fit.error, options, half, job.progress);
  report.bounce_seconds = seconds_since(start);
  return bounced;
}

// Of each pixel, no more than its row's sum of squares: rows are shares of light, and none takes from another.
std::vector<double> least_squares_of(const PixelMix& mix, const HaarTransfer& t, bool coloured) {
  const std::vector<double> of_receivers = haar_squares(t);
  std::vector<double> squares(mix.coverage.size());
  for (size_t p = 0; p < squares.size(); ++p)
    for (size_t i = mix.begin[p]; i < mix.begin[p + 1]; ++i) {
      const Vec3d w(mix.weights[i]);
      const double least = std::min({w.x * w.x, w.y * w.y, w.z * w.z});
      squares[p] += of_receivers[mix.receivers[i]] * (t.channels == 3 ? least : coloured ? dot(w, w) : w.x * w.x);
    }
  return squares;
}

bool is_coloured(const PixelMix& mix) {
  return std::any_of(mix.weights.begin(), mix.weights.end(), [](Vec3 w) { return w.x != w.y || w.y != w.z; });
}

// Receivers' values [receiver][column][channel of those] to pixels' [pixel][column][channel].
void mix_columns(const PixelMix& mix, const std::vector<float>& x, size_t from, size_t channels, size_t columns,
                 std::vector<float>& y) {
  parallel_for(mix.coverage.size(), 64, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      float* out = y.data() + p * columns * channels;
      std::fill_n(out, columns * channels, 0.0f);
      for (size_t i = mix.begin[p]; i < mix.begin[p + 1]; ++i) {
        const float* v = x.data() + mix.receivers[i] * columns * from;
        const Vec3 w = mix.weights[i];
        for (size_t k = 0; k < columns; ++k)
          for (size_t c = 0; c < channels; ++c) out[k * channels + c] += w[int(c)] * v[k * from + (from == 3 ? c : 0)];
      }
    }
  });
}

}  // namespace

Result<HaarTransfer> haar_of_view(const HaarTransfer& t, const PixelMix& mix, const HaarFitOptions& options,
                                  size_t memory, HaarFitReport& report, Progress* progress) {
  const bool coloured = t.channels == 3 || is_coloured(mix);
  const size_t pixels = mix.coverage.size(), from = size_t(t.channels), channels = coloured ? 3 : 1;
  const size_t each = sizeof(float) * (t.receivers * from + pixels * channels);  // a column of the light
  const size_t together = std::clamp<size_t>(memory / 2 / std::max<size_t>(each, 1), 1, columns_together);
  std::vector<float> x(t.receivers * together * from), y(pixels * together * channels);
  HaarColumnsMaker maker{t.size, int(channels), pixels, together, least_squares_of(mix, t, coloured), t.error, {}};
  maker.make = [&](size_t first, size_t count) -> Result<std::span<const float>> {
    std::fill(x.begin(), x.end(), 0.0f);
    size_t entries = 0;
    for (size_t c = 0; c < from; ++c)
      entries += load_columns(t, c * t.light_columns() + first, count, together * from, from, x.data() + c);
    if (entries == 0) return std::span<const float>();
    mix_columns(mix, x, from, channels, together, y);
    return std::span<const float>(y);
  };
  return store_haar_columns(maker, options, memory / 2, &report, progress, "pixels' wavelets");
}

Result<Visibility> bake_visibility_of_plan(const BakePlan& plan, const Scene& scene, const Tracer& tracer,
                                           const Receivers& receivers, const Job& job, BakeReport& report,
                                           Summary& summary) {
  VisibilityReport seen;
  VisibilityOptions options = plan.visibility;
  options.scene = &scene;
  auto visibility = bake_visibility(tracer, receivers, options, &seen, job.progress);
  if (!visibility) return visibility;
  if (tracer.lets_pass() && visibility->bits == 1)
    job.warn("binary visibility holds what lets light pass as seen or not (--visibility bits:N holds shares)");
  if (tracer.colours()) job.warn("visibility has no colour: coloured glass is kept grey");
  report.receivers = receivers.count(), report.rays = seen.rays, report.trace_seconds = seen.seconds;
  const VisibilityStatistics s = visibility_statistics(*visibility);
  summary.json.update({{"blocked", s.blocked},
                       {"clear", s.clear},
                       {"mixed", s.mixed},
                       {"changes_per_mixed_block", s.changes},
                       {"certain_rays", seen.certain}});
  summary.lines.emplace_back(
      "blocks", fmt::format("{:.1f} % blocked, {:.1f} % clear, {:.1f} % mixed with {:.1f} changes each; cube {}, {} "
                            "bit{}",
                            100 * s.blocked, 100 * s.clear, 100 * s.mixed, s.changes, visibility->size,
                            visibility->bits, visibility->bits == 1 ? "" : "s"));
  return visibility;
}

Result<HaarTransfer> fit_haar_of_plan(const BakePlan& plan, bool for_view, const Visibility& seen, const Scene& scene,
                                      const Tracer& tracer, const Receivers& receivers, const Job& job,
                                      BakeReport& report, HaarFitReport& fit) {
  const HaarFitOptions options = for_view ? finer(plan.haar) : plan.haar;
  if (plan.bake.bounces == 0) return fit_haar(seen, receivers.normals, options, &fit, job.progress);
  auto bounced = bounce_haar(plan, options, seen, scene, tracer, receivers, job, report);
  if (!bounced) return bounced.error();
  fit = bounced->fit;
  return std::move(bounced->transfer);
}

Result<void> check_haar_of_view(const BakePlan& plan, const std::string& size, const Scene& scene, const Tracer& tracer,
                                const Receivers& receivers, const View& view) {
  constexpr double most = double(size_t{1} << 32);
  constexpr size_t sampled = 64;
  constexpr int side = 64;
  const double pixels = double(view.width) * double(view.height);
  // At most, of three channels and two bytes an entry.
  if (6 * pixels * double(cube_texels(plan.visibility.size)) < most || receivers.count() == 0) return {};
  Receivers few;
  const size_t step = std::max<size_t>(1, receivers.count() / sampled);
  for (size_t r = step / 2; r < receivers.count(); r += step)
    few.origins.push_back(receivers.origins[r]), few.normals.push_back(receivers.normals[r]);
  VisibilityOptions options = plan.visibility;
  options.scene = &scene;
  auto seen = bake_visibility(tracer, few, options);
  if (!seen) return seen.error();
  HaarFitReport report;
  if (auto fit = fit_haar(*seen, few.normals, plan.haar, &report); !fit) return fit.error();
  const CameraRays rays(view.camera, view.width, view.height);
  size_t met = 0;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      met += tracer
                 .closest(rays.eye, rays.direction((float(x) + 0.5f) / side * float(view.width),
                                                   (float(y) + 0.5f) / side * float(view.height)))
                 .triangle != none;
  const double bytes = report.entries * pixels * double(met) / (side * side);
  if (bytes < most) return {};
  return Error{"--size",
               fmt::format("{} pixels in wavelets would take about {}, and a .glb holds 4 GiB: write a .gltf", size,
                           human_bytes(bytes)),
               true};
}

void tell_wavelets(const HaarTransfer& transfer, const HaarFitReport& fit, const char* of, Summary& summary,
                   nlohmann::json& told) {
  told["wavelets"] = {{"per_receiver", fit.entries}, {"error", fit.error}};
  summary.json["wavelets"].update(told["wavelets"]);
  summary.lines.emplace_back("wavelets", fmt::format("{:.0f} of {} a {}, with an error of {:.2f}% RMS", fit.entries,
                                                     human_count(transfer.columns()), of, 100 * fit.error));
}

}  // namespace lambent

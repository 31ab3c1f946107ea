// Follows: Ng, Ramamoorthi, Hanrahan 2003 (wavelets); general-prt (bounces as a linear operator on the rows).
#include <lambent/pipeline/bake_cube.h>

#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/compress/haar_rows.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <chrono>
#include <cmath>

namespace lambent {
namespace {

using HaarRows = std::vector<std::vector<HaarEntry>>;

// Columns of the light that bounce together: widths are multiples of lane_multiple for one channel and three.
constexpr size_t columns_together = 48;

// Rows by column: entries of column c from first[c] on.
struct HaarColumns {
  std::vector<size_t> first;
  std::vector<uint32_t> receiver;
  std::vector<float> value;
};
HaarColumns by_column(const HaarRows& rows, size_t columns) {
  HaarColumns out{std::vector<size_t>(columns + 1), {}, {}};
  for (const auto& row : rows)
    for (const HaarEntry& e : row) ++out.first[e.column + 1];
  for (size_t c = 0; c < columns; ++c) out.first[c + 1] += out.first[c];
  out.receiver.resize(out.first[columns]), out.value.resize(out.first[columns]);
  std::vector<size_t> at(out.first.begin(), out.first.end() - 1);
  for (uint32_t r = 0; r < rows.size(); ++r)
    for (const HaarEntry& e : rows[r]) out.receiver[at[e.column]] = r, out.value[at[e.column]++] = e.value;
  return out;
}

struct BouncedRows {
  HaarRows rows;             // columns are [channel][column]
  double all = 0, left = 0;  // sums of squares: of the whole rows, and of what is not in them
};

// What of a receiver's row may be left out one by one, so that all of it is an eighth of what the options leave out.
std::vector<float> least_entries(const HaarRows& direct, size_t columns, const HaarFitOptions& o) {
  std::vector<double> squares(direct.size());
  double mean = 0;
  for (size_t r = 0; r < direct.size(); ++r) {
    for (const HaarEntry& e : direct[r]) squares[r] += double(e.value) * double(e.value);
    mean += squares[r] / double(direct.size());
  }
  const double error = o.keep > 0 ? 1e-3 : o.error;
  std::vector<float> least;
  for (double s : squares) least.push_back(float(error * std::sqrt(std::max(s, 1e-3 * mean) / (8 * double(columns)))));
  return least;
}

// X = T0 + B X after so many bounces, a few columns at a time. No bounce makes light of a column that direct light has
// not. Errors: cancelled.
Result<BouncedRows> bounce_rows(const LinearOperator& op, int bounces, size_t channels, const HaarRows& direct,
                                size_t columns, const HaarFitOptions& fit, Progress* progress) {
  const size_t n = direct.size(), width = columns_together * channels;
  const HaarColumns of_light = by_column(direct, columns);
  const std::vector<float> least = least_entries(direct, columns, fit);
  BouncedRows out{HaarRows(n), 0, 0};
  std::vector<double> all(n), left(n);
  AlignedVector<float> x0(n * width);
  ProgressStage stage(progress, "bouncing wavelets", columns);
  for (size_t first = 0; first < columns && !stage.cancelled(); first += columns_together) {
    const size_t count = std::min(columns_together, columns - first);
    stage.advance(count);
    if (of_light.first[first] == of_light.first[first + count]) continue;
    std::fill(x0.begin(), x0.end(), 0.0f);
    for (size_t k = 0; k < count; ++k)
      for (size_t i = of_light.first[first + k]; i < of_light.first[first + k + 1]; ++i)
        std::fill_n(x0.data() + of_light.receiver[i] * width + k * channels, channels, of_light.value[i]);
    const Source source{[&](size_t r, float* y) { std::copy_n(x0.data() + r * width, width, y); }};
    auto solved = bounce(op, source, width, bounces);
    if (!solved) return solved.error();
    op.shares().gather(solved->x.data(), width);
    parallel_for(n, 64, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r)
        for (size_t c = 0; c < channels; ++c)
          for (size_t k = 0; k < count; ++k) {
            const float value = solved->x[r * width + k * channels + c];
            const double square = double(value) * double(value);
            all[r] += square;
            if (std::abs(value) > least[r]) out.rows[r].push_back({uint32_t(c * columns + first + k), value});
            else left[r] += square;
          }
    });
  }
  if (stage.cancelled()) return Error{"", "cancelled"};
  parallel_for(n, 64, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      std::vector<HaarEntry> kept = largest_entries(out.rows[r], fit, channels * columns);
      for (const HaarEntry& e : out.rows[r]) left[r] += double(e.value) * double(e.value);
      for (const HaarEntry& e : kept) left[r] -= double(e.value) * double(e.value);
      out.rows[r] = std::move(kept);
    }
  });
  for (size_t r = 0; r < n; ++r) out.all += all[r], out.left += std::max(left[r], 0.0);
  return out;
}

Result<HaarTransfer> bounce_haar(const BakePlan& plan, const Visibility& seen, const Scene& scene, const Tracer& tracer,
                                 const Receivers& receivers, const Job& job, BakeReport& report, HaarFitReport& fit) {
  auto direct = haar_rows(seen, receivers.normals, plan.haar, job.progress);
  if (!direct) return direct.error();
  const GatherSetup setup = make_gather_setup(scene, tracer, receivers, 1, plan.bake.samples, plan.bake.seed,
                                              square_to_cosine_hemisphere, job.progress);
  auto B = GatherOperator::trace(setup, nullptr, nullptr, true, plan.bake.memory, job.progress);
  if (!B) return B.error();
  report.rays += B->report().rays, report.trace_seconds += B->report().seconds, report.buried = B->report().buried;
  report.operator_bytes = B->report().bytes, report.operator_kept = B->report().kept;
  const auto start = std::chrono::steady_clock::now();
  const size_t columns = cube_texels(seen.size), channels = size_t(setup.channels);
  auto bounced = bounce_rows(*B, plan.bake.bounces, channels, *direct, columns, plan.haar, job.progress);
  if (!bounced) return bounced.error();
  report.bounce_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return store_haar_rows(seen.size, int(channels), bounced->rows, bounced->all, bounced->left, &fit);
}

}  // namespace

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

Result<HaarTransfer> fit_haar_of_plan(const BakePlan& plan, const Visibility& seen, const Scene& scene,
                                      const Tracer& tracer, const Receivers& receivers, const Job& job,
                                      BakeReport& report, Summary& summary, nlohmann::json& told) {
  HaarFitReport fit;
  auto transfer = plan.bake.bounces > 0 ? bounce_haar(plan, seen, scene, tracer, receivers, job, report, fit)
                                        : fit_haar(seen, receivers.normals, plan.haar, &fit, job.progress);
  if (!transfer) return transfer;
  summary.json["wavelets"] = {{"per_receiver", fit.entries}, {"error", fit.error}, {"blocks_bytes", seen.bytes()}};
  told["wavelets"] = {{"per_receiver", fit.entries}, {"error", fit.error}};
  summary.lines.emplace_back("wavelets", fmt::format("{:.0f} of {} a receiver, with an error of {:.2f}% RMS",
                                                     fit.entries, human_count(transfer->columns()), 100 * fit.error));
  return transfer;
}

}  // namespace lambent

#include <lambent/pipeline/bake_cube.h>

#include <lambent/pipeline/text.h>

#include <fmt/format.h>

namespace lambent {

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

Result<HaarTransfer> fit_haar_of_plan(const BakePlan& plan, const Visibility& seen, const Receivers& receivers,
                                      const Job& job, Summary& summary, nlohmann::json& told) {
  HaarFitReport fit;
  auto transfer = fit_haar(seen, receivers.normals, plan.haar, &fit, job.progress);
  if (!transfer) return transfer;
  summary.json["wavelets"] = {{"per_receiver", fit.entries}, {"error", fit.error}, {"blocks_bytes", seen.bytes()}};
  told["wavelets"] = {{"per_receiver", fit.entries}, {"error", fit.error}};
  summary.lines.emplace_back("wavelets", fmt::format("{:.0f} of {} a receiver, with an error of {:.2f}% RMS",
                                                     fit.entries, human_count(transfer->columns()), 100 * fit.error));
  return transfer;
}

}  // namespace lambent

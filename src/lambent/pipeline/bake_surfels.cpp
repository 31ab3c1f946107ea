#include <lambent/pipeline/bake_surfels.h>

#include <lambent/pipeline/text.h>

#include <fmt/format.h>

namespace lambent {
namespace {

// What the store's parts take in a file.
nlohmann::json bytes_of_parts(const IndirectTransfer& t) {
  const IndirectTransfer::Bytes b = t.bytes_of_parts();
  return {{"surfels", b.surfels}, {"rows", b.gather}, {"kernels", b.kernels}, {"lattice", b.lattice}};
}

void tell_lattice(const IndirectTransfer& t, const IndirectReport& report, Summary& summary) {
  const IndirectLattice& f = *t.lattice;
  const size_t points = f.lattice.count();
  summary.json["lattice"] = {{"points", points}, {"invalid", report.invalid}, {"entries", f.rows.nodes.size()}};
  const std::string invalid =
      report.invalid ? "; " + human_count(report.invalid) + " inside something, filled from neighbours" : "";
  summary.lines.emplace_back("lattice",
                             fmt::format("{} points, order {}, of {:.0f} entries each{}", human_count(points), f.order,
                                         double(f.rows.nodes.size()) / double(points), invalid));
}

}  // namespace

Result<IndirectOptions> indirect_options(const BakeRequest& request, const BakePlan& plan, const Scene& scene) {
  IndirectOptions options = plan.indirect;
  if (request.lattice.empty()) return options;
  auto lattice = lattice_of_request(request, scene);
  if (!lattice) return lattice.error();
  options.lattice = *lattice, options.lattice_order = request.lattice_order;
  return options;
}

Result<IndirectTransfer> bake_indirect_of_request(const BakeRequest& request, const BakePlan& plan, const Scene& scene,
                                                  const Tracer& tracer, const Receivers& receivers, const Job& job,
                                                  BakeReport& told, Summary& summary) {
  auto options = indirect_options(request, plan, scene);
  if (!options) return options.error();
  IndirectReport report;
  auto baked = bake_indirect(scene, tracer, receivers, *options, &report, job.progress);
  if (!baked) return baked;
  if (tracer.colours()) job.warn("bounces know no coloured glass: its light is kept grey");
  if (report.strays > report.rays / 50)
    job.warn(
        fmt::format("{:.1f} % of the rays met surfaces too small for a surfel of their own, and are lost: more "
                    "--surfels find them",
                    100 * double(report.strays) / double(report.rays)));
  told.receivers = receivers.count(), told.rays = report.rays, told.buried = report.buried;
  told.trace_seconds = report.trace_seconds;
  const size_t entries = baked->gather.nodes.size(), rows = baked->gathering();
  summary.json["indirect"] = {{"surfels", baked->surfels.count()},
                              {"gathering", rows},
                              {"entries", entries},
                              {"compression_error", baked->error},
                              {"strays", report.strays},
                              {"unread", report.unread},
                              {"bytes", bytes_of_parts(*baked)},
                              {"surfel_seconds", report.surfel_seconds},
                              {"kernel_seconds", report.reader_seconds}};
  summary.lines.emplace_back(
      "surfels",
      fmt::format("{} in {} levels, placed in {}; {} gather by {:.0f} entries each, to {:.2g} % RMS",
                  human_count(baked->surfels.count()), baked->surfels.levels(), human_seconds(report.surfel_seconds),
                  human_count(rows), double(entries) / double(std::max<size_t>(rows, 1)), 100 * baked->error));
  if (report.unread)
    summary.lines.emplace_back(
        "", human_count(report.unread) + " receivers and all their neighbours see no surfel, and stay dark");
  if (baked->lattice) tell_lattice(*baked, report, summary);
  return baked;
}

}  // namespace lambent

#include <lambent/core/ranks.h>
#include <lambent/core/clock.h>
#include <lambent/image/image.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/durable.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

namespace lambent {
namespace {

// The pictures, the rule of make and the baked file, whole or not at all; the names of the pictures.
Result<std::vector<std::string>> write_outputs(const std::string& path, const BakeOutcome& outcome, size_t bin_limit,
                                               const BakeRequest* request, const DurableBake* durable) {
  const std::string stem = path.substr(0, path.find_last_of('.'));
  std::vector<std::string> written;
  FileSet set;
  for (const auto& [name, picture] : outcome.pictures) {
    written.push_back(stem + name);
    if (auto ok = save_image(written.back(), picture); !ok) return ok.error();
  }
  if (request && !request->depfile.empty()) {
    std::vector<std::string> all = written;
    all.insert(all.begin(), path);
    if (auto ok = write_file_atomically(request->depfile, depfile_text(all, durable->inputs())); !ok) return ok.error();
  }
  if (auto ok = save_baked(path, outcome.baked, outcome.look ? &*outcome.look : nullptr, bin_limit); !ok)
    return ok.error();
  if (auto ok = set.commit(); !ok) return ok.error();
  return written;
}

// What ranks there were, and what went between them.
void summarize_ranks(Ranks& ranks, Summary& summary) {
  const double receivers = summary.json.value("receivers", 0.0), times = double(ranks.asks);
  const double asked = double(ranks.sum(ranks.asked_bytes)), all = double(ranks.sum(ranks.received));
  const double each = receivers > 0 && times > 0 ? asked / receivers / times : 0;
  summary.json["ranks"] = {
      {"count", ranks.count()}, {"exchanges", ranks.asks}, {"bytes_per_receiver_per_bounce", each}, {"bytes", all}};
  summary.lines.emplace_back("ranks", fmt::format("{}; {} a receiver a bounce came from others, {} in all",
                                                  ranks.count(), human_bytes(each), human_bytes(all)));
}

// Why a bake gains nothing by ranks; "": it does.
std::string done_by_one_rank(const BakeRequest& request) {
  if (kind_of(request) == BakeKind::membrane) return "--membrane";
  if (kind_of(request) == BakeKind::indirect) return "--transfer indirect";
  if (kind_of(request) == BakeKind::lightmap && request.solver == "southwell")
    return "--solver southwell, one receiver after the other";
  return request.subsurface.empty() ? "" : "--subsurface";
}

}  // namespace

Result<nlohmann::json> save_outcome(const std::string& path, const BakeOutcome& outcome, size_t bin_limit) {
  auto written = write_outputs(path, outcome, bin_limit, nullptr, nullptr);
  if (!written) return written.error();
  return nlohmann::json(*written);
}

Result<Summary> bake_to_file(const BakeRequest& asked, const Job& job) {
  if (auto ok = check_output(asked.output, {"glb", "gltf"}); !ok) return ok.error();
  auto request = resolved(asked);
  if (!request) return request.error();
  Ranks alone;
  std::optional<WithRanks> own;
  if (const std::string why = done_by_one_rank(*request); !why.empty() && this_ranks().count() > 1) {
    if (this_ranks().rank() > 0) return Summary{};
    job.warn(why + ": done by rank 0 alone, the others wait");
    own.emplace(alone);
  }
  Ranks& ranks = this_ranks();
  DurableBake durable(*request, job);
  auto outcome = bake_with_summary(asked, durable.job());
  if (!outcome) return durable.explained(outcome.error());
  const auto start = Clock::now();
  const WriteTogether together(ranks);
  Summary& summary = outcome->summary;
  auto pictures = write_outputs(request->output, *outcome, request->bin_limit, &*request, &durable);
  if (!pictures) return durable.explained(pictures.error());
  if (!pictures->empty()) summary.json["pictures"] = *pictures;
  durable.finish();
  summary.json["output"] = request->output;
  summary.json["seconds"]["save"] = seconds_since(start);
  if (const size_t taken = durable.taken()) {
    summary.json["resumed"] = taken;
    summary.lines.emplace_back("resumed", fmt::format("{} pieces of work were there already", human_count(taken)));
  }
  if (ranks.count() > 1) summarize_ranks(ranks, summary);
  return std::move(summary);
}

}  // namespace lambent

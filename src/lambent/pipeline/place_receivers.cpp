#include <lambent/pipeline/place_receivers.h>

#include <lambent/bake/enclosure.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/version.h>

#include <fmt/format.h>

#include <filesystem>

namespace lambent {

Result<PlacedReceivers> place_receivers(Scene& scene, const BakeRequest& request, const Job& job) {
  if (request.receivers == "vertices" || request.receivers == "meshless")
    return PlacedReceivers{make_vertex_receivers(scene), std::nullopt};
  if (request.receivers == "patches") return PlacedReceivers{make_patch_receivers(scene), std::nullopt};
  AtlasOptions options{.texels_per_unit = request.texels_per_unit};
  if (!request.atlas.empty()) {
    auto size = parse_size(request.atlas, "--atlas");
    if (!size) return size.error();
    options.width = (*size)[0], options.height = (*size)[1];
  }
  auto atlas = make_atlas(scene, options, job.progress);
  if (!atlas) return atlas.error();
  if (!atlas->remark.empty()) job.warn(atlas->remark);
  Receivers receivers = make_texel_receivers(scene, *atlas);
  return PlacedReceivers{std::move(receivers), std::move(*atlas)};
}

void warn_if_enclosed(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Job& job) {
  const Enclosure shell = find_enclosure(scene, tracer, receivers, job.progress);
  const std::vector<uint32_t>& parts = shell.parts;
  if (parts.empty()) return;
  constexpr size_t named = 3;
  std::string names;
  for (size_t k = 0; k < std::min(parts.size(), named); ++k) names += (k ? ", " : "") + scene.parts[parts[k]].name;
  if (parts.size() > named) names += fmt::format(" and {} others", parts.size() - named);
  job.warn(fmt::format("no receiver sees the environment{}: {} {} around all of it; --exclude leaves parts out",
                       shell.has_outside ? " but its own" : "", names, parts.size() == 1 ? "is" : "are"));
}

std::string provenance_of(const BakeRequest& request, const Scene& scene, nlohmann::json report) {
  nlohmann::json out{{"generator", std::string("lambent ") + version},
                     {"input", {{"name", without_folder(scene.path)}, {"xxh3_128", scene.hash}}},
                     {"request", to_json(request)},
                     {"report", std::move(report)}};
  // Environments, pictures and tables that the request names.
  for (const Option<BakeRequest>& o : bake_options()) {
    const auto* member = std::get_if<std::string BakeRequest::*>(&o.member);
    if (!member || !o.is_path || std::string(o.name) == "scene" || !out["request"].contains(json_name(o.name)))
      continue;
    const std::string& value = request.*(*member);
    const size_t prefix = value.find_last_of("@:");
    const std::string path = prefix == std::string::npos ? value : value.substr(prefix + 1);
    std::error_code status;
    if (!std::filesystem::is_regular_file(path, status)) continue;
    if (auto bytes = read_file(path))
      out["inputs"].push_back({{"name", without_folder(path)}, {"xxh3_128", content_hash(*bytes)}});
  }
  return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace lambent

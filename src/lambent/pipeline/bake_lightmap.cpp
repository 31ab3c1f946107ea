#include <lambent/pipeline/bake_lightmap.h>

#include <lambent/bake/lightmap_error.h>
#include <lambent/bake/unbury.h>
#include <lambent/core/clock.h>
#include <lambent/pipeline/lightmap_pictures.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/place_receivers.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <algorithm>

namespace lambent {
namespace {

struct Seconds {
  double load = 0, build = 0;
};

Summary summarize(const BakeRequest& request, const Lightmap& map, const LightmapReport& r, const Seconds& seconds,
                  size_t moved, const std::optional<Atlas>& atlas, const std::string& density) {
  const LightBasis& light = map.all.light;
  const double rate = double(r.rays) / std::max(r.trace_seconds, 1e-9);
  Summary s;
  s.json = {
      {"receivers", r.receivers},
      {"moved", moved},
      {"buried", r.buried},
      {"groups", light.groups},
      {"rays", r.rays},
      {"rays_per_second", rate},
      {"seconds",
       {{"load", seconds.load}, {"build", seconds.build}, {"trace", r.trace_seconds}, {"bounce", r.bounce_seconds}}},
      {"bytes", map.all.bytes()},
      {"operator_bytes", r.operator_bytes},
      {"operator_file_bytes", r.operator_file_bytes},
      {"operator_kept", r.operator_kept}};
  auto line = [&](const char* label, std::string text) { s.lines.emplace_back(label, std::move(text)); };
  if (atlas) {
    s.json["atlas"] = {{"width", atlas->width},
                       {"height", atlas->height},
                       {"charts", atlas->charts},
                       {"texels_per_unit", atlas->texels_per_unit}};
    line("atlas", fmt::format("{}x{}, {} charts, {:.3g} texels a unit", atlas->width, atlas->height,
                              human_count(atlas->charts), atlas->texels_per_unit));
    if (!density.empty()) line("density", density);
  }
  line("receivers", fmt::format("{}{}{}", human_count(r.receivers),
                                moved ? "; " + human_count(moved) + " moved out of geometry" : "",
                                r.buried ? "; " + human_count(r.buried) + " buried, filled from neighbours" : ""));
  line("lamps", light.groups.empty() ? "none; harmonics of order " + std::to_string(light.order)
                                     : fmt::format("{}", fmt::join(light.groups, ", ")));
  line("rays", fmt::format("{} ({:.1f} million a second)", human_count(r.rays), rate / 1e6));
  line("time",
       fmt::format("load {}, build {}, trace {}, bounce {}", human_seconds(seconds.load), human_seconds(seconds.build),
                   human_seconds(r.trace_seconds), human_seconds(r.bounce_seconds)));
  if (!r.solve.steps.empty()) {
    s.json["convergence"] = convergence(r.solve);
    line("solver",
         fmt::format("{}: residual {:.2g} after {:.1f} applications{}", request.solver, r.solve.steps.back().residual,
                     r.solve.steps.back().applications, r.solve.converged ? "" : ", not converged"));
  }
  if (r.operator_kept < 1)
    line("memory", fmt::format("{:.0f}% of the gather operator fitted; the rest was traced again for each bounce",
                               100 * r.operator_kept));
  return s;
}

// What a bake to an error says of it.
void summarize_error(const BakePlan& plan, const LightmapReport& r, const Scene& scene, Summary& s) {
  const Certificate& c = r.certificate;
  if (!(plan.lightmap.error > 0)) return;
  nlohmann::json parts = nlohmann::json::object();
  for (size_t p = 0; p < c.parts.size(); ++p)
    if (c.parts[p] >= 0) parts[scene.parts[p].name] = c.parts[p];
  s.json["certificate"] = {{"error", c.error},
                           {"uncertain", c.uncertain},
                           {"places", c.places},
                           {"direct_noise", r.direct_noise},
                           {"bounced_noise", r.bounced_noise},
                           {"parts", std::move(parts)}};
  s.json["direct"] = {{"traced", r.direct_traced}, {"samples", r.direct_samples}};
  s.json["bounced"] = {{"traced", r.bounced_traced}, {"samples", r.samples}};
  s.json["seconds"]["certify"] = r.certify_seconds;
  s.lines.emplace_back(
      "traced", fmt::format("direct light at {} with {} samples, bounces at {} with {} rays",
                            human_count(r.direct_traced), r.direct_samples, human_count(r.bounced_traced), r.samples));
  if (c.error < 0) return;
  const double noise = std::hypot(r.direct_noise, r.bounced_noise);
  s.lines.emplace_back("error",
                       fmt::format("{:.1f}% RMS (within {:.1f}), measured at {} places by rays of their own; noise "
                                   "{:.1f}% of direct light, {:.1f}% of bounces",
                                   100 * c.error, 200 * c.uncertain, human_count(c.places), 100 * r.direct_noise,
                                   100 * r.bounced_noise));
  if (c.error > plan.lightmap.error + 2 * c.uncertain)
    s.lines.emplace_back("", fmt::format("above the {:.3g}% asked for: {}", 100 * plan.lightmap.error,
                                         noise > 0.8 * c.error ? "more rays would help (no --time)"
                                                               : "what is lost lies between texels (--quality final, "
                                                                 "or --texels-per-unit, has more)"));
}

}  // namespace

Result<std::optional<Environment>> sky_of_request(const BakeRequest& request, const Job& job) {
  if (request.sky.empty()) return std::optional<Environment>();
  auto env = load_environment(request.sky);
  if (!env) return env.error();
  for (const std::string& w : env->warnings) job.warn(w);
  for (const std::string& text : request.lamp)
    if (auto scale = parse_named_color(text, "--lamp"); scale && scale->name == sky_name)
      for (Vec3& radiance : env->image.rgb) radiance *= scale->color;
  return std::optional(std::move(*env));
}

Result<BakeRequest> with_density(const BakeRequest& request, const BakePlan& plan, const Scene& scene,
                                 const Lamps& lamps, std::string& remark, const Job& job) {
  BakeRequest out = request;
  if (request.receivers != "texels" || !request.atlas.empty() || request.texels_per_unit > 0) return out;
  if (lamps.groups() == 0) {  // the bake will say so
    out.atlas = "1024x1024";
    return out;
  }
  // As many as working memory has room for, twice.
  constexpr size_t many = 1 << 20;
  const double each = double(least_lightmap_memory(many, lamps.groups(), plan.lightmap)) / many;
  const size_t fit = size_t(double(plan.lightmap.memory) / (2 * std::max(each, 1.0)));
  auto density = lightmap_density(scene, lamps, plan.lightmap.error, std::clamp<size_t>(fit, 1, plan.most_texels),
                                  request.seed, &remark, job.progress);
  if (!density) return density.error();
  out.texels_per_unit = *density;
  return out;
}

Result<BakeOutcome> bake_lightmap_request(const BakeRequest& request, const BakePlan& plan, const Job& job) {
  auto start = Clock::now();
  auto scene = load_scene_of(request, job);
  if (!scene) return scene.error();
  auto sky = sky_of_request(request, job);
  if (!sky) return sky.error();
  const Lamps lamps = make_lamps(*scene, *sky ? &**sky : nullptr, request.light_groups);
  if (auto ok = check_lightmap(*scene, lamps, plan.lightmap); !ok) return ok.error();  // before an atlas is made
  std::string density;
  auto dense = with_density(request, plan, *scene, lamps, density, job);
  if (!dense) return dense.error();
  auto placed = place_receivers(*scene, *dense, job);
  if (!placed) return placed.error();
  Seconds seconds{seconds_since(start), 0};
  if (auto ok = check_file_size(plan, request, *scene, placed->receivers.count(), lamps.groups()); !ok)
    return ok.error();
  const bool over_texels = placed->atlas && lamps.groups() > 0;
  if (auto ok = job.inputs_read(over_texels ? lightmap_picture_names(lamps.names, plan.lightmap.directional,
                                                                     request.light_groups, request.direct == "separate")
                                            : std::vector<std::string>());
      !ok)
    return ok.error();
  start = Clock::now();
  auto tracer = Tracer::build(*scene, job.progress);
  if (!tracer) return tracer.error();
  seconds.build = seconds_since(start);
  if (*sky || request.order > 0) warn_if_enclosed(*scene, *tracer, placed->receivers, job);
  const size_t moved =
      placed->atlas ? move_buried_texels(*scene, *tracer, *placed->atlas, placed->receivers, job.progress) : 0;

  LightmapReport report;
  // Splitting changed vertex numbers, not triangles: the lamps still fit.
  auto map = bake_lightmap(*scene, *tracer, placed->receivers, lamps, plan.lightmap, request.direct == "separate",
                           &report, job.progress);
  if (!map) return map.error();
  if (report.beyond_half > 0)
    job.warn(
        fmt::format("the lightmap is kept in single precision: half floats do not hold {:.3g}", report.beyond_half));
  BakeOutcome out;
  out.summary = summarize(request, *map, report, seconds, moved, placed->atlas, density);
  summarize_error(plan, report, *scene, out.summary);
  if (const Certificate& c = report.certificate;
      plan.lightmap.error > 0 && c.error > plan.lightmap.error + 2 * c.uncertain)
    job.warn(fmt::format("the lightmap's error is {:.1f}%, above the {:.3g}% asked for", 100 * c.error,
                         100 * plan.lightmap.error));
  out.pictures = lightmap_pictures(*map, placed->receivers, request.light_groups);
  auto look = lightmap_look(*map, *scene, placed->receivers, plan.lightmap.directional);
  if (!look) return look.error();
  out.look = std::move(*look);
  std::vector<Transfer> terms = std::move(map->terms);
  const DirectionalKind kind = plan.lightmap.directional;
  out.baked = make_baked(std::move(*scene), placed->receivers, std::move(map->all),
                         kind == DirectionalKind::none ? Rows(DiffuseRows{}) : Rows(DirectionalRows{kind}));
  out.baked.terms = std::move(terms);
  out.baked.provenance = provenance_of(request, out.baked.scene,
                                       {{"receivers", report.receivers},
                                        {"moved", moved},
                                        {"buried", report.buried},
                                        {"certificate", out.summary.json.value("certificate", nlohmann::json())}});
  return out;
}

nlohmann::json convergence(const SolveReport& report) {
  nlohmann::json steps = nlohmann::json::array();
  for (const SolveStep& s : report.steps) steps.push_back({{"applications", s.applications}, {"residual", s.residual}});
  return {{"converged", report.converged}, {"steps", steps}};
}

}  // namespace lambent

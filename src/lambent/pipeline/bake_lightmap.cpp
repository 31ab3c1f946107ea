#include <lambent/pipeline/bake_lightmap.h>

#include <lambent/bake/unbury.h>
#include <lambent/pipeline/lightmap_pictures.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/place_receivers.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Seconds {
  double load = 0, build = 0;
};

Summary summarize(const BakeRequest& request, const Lightmap& map, const LightmapReport& r, const Seconds& seconds,
                  size_t moved, const std::optional<Atlas>& atlas) {
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

}  // namespace

Result<BakeOutcome> bake_lightmap_request(const BakeRequest& request, const BakePlan& plan, const Job& job) {
  auto start = Clock::now();
  auto scene = load_scene_of(request, job);
  if (!scene) return scene.error();
  std::optional<Environment> sky;
  if (!request.sky.empty()) {
    auto env = load_environment(request.sky);
    if (!env) return env.error();
    for (const std::string& w : env->warnings) job.warn(w);
    for (const std::string& text : request.lamp)
      if (auto scale = parse_named_color(text, "--lamp"); scale && scale->name == sky_name)
        for (Vec3& radiance : env->image.rgb) radiance *= scale->color;
    sky = std::move(*env);
  }
  const Lamps lamps = make_lamps(*scene, sky ? &*sky : nullptr, request.light_groups);
  if (auto ok = check_lightmap(*scene, lamps, plan.lightmap); !ok) return ok.error();  // before an atlas is made
  auto placed = place_receivers(*scene, request, job);
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
  if (sky || request.order > 0) warn_if_enclosed(*scene, *tracer, placed->receivers, job);
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
  out.summary = summarize(request, *map, report, seconds, moved, placed->atlas);
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
                                       {{"receivers", report.receivers}, {"moved", moved}, {"buried", report.buried}});
  return out;
}

nlohmann::json convergence(const SolveReport& report) {
  nlohmann::json steps = nlohmann::json::array();
  for (const SolveStep& s : report.steps) steps.push_back({{"applications", s.applications}, {"residual", s.residual}});
  return {{"converged", report.converged}, {"steps", steps}};
}

}  // namespace lambent

#include "bake_lightmap.h"

#include <lambent/bake/unbury.h>
#include <lambent/baked/baked_file.h>
#include <lambent/render/lightmap_picture.h>

#include <fmt/format.h>

#include <charconv>
#include <chrono>

namespace lambent::tool {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// "a/b.glb", "lamp 1", "2" -> "a/b.lamp_1.2.exr".
std::string picture_path(const std::string& baked, const std::string& name, const std::string& row) {
  std::string safe;
  for (char c : name) safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' ? c : '_';
  return baked.substr(0, baked.find_last_of('.')) + (safe.empty() ? "" : "." + safe) + (row.empty() ? "" : "." + row) +
         ".exr";
}

// Light with one group on, or all of them; harmonics dark.
std::vector<Vec3> only_group(const LightBasis& light, size_t group) {
  std::vector<Vec3> out(light.count(), Vec3(0));
  const size_t first = light.count() - light.groups.size();
  for (size_t g = 0; g < light.groups.size(); ++g)
    if (group == SIZE_MAX || g == group) out[first + g] = Vec3(1);
  return out;
}

// What leaves every texel, fit for eight bits: values beyond the brightest thousandth are clamped to it.
Result<ViewerLook> make_look(const Scene& scene, const Receivers& receivers, DirectionalKind kind, const Relit& relit,
                             const std::string& path) {
  std::vector<Vec3> radiance = texel_albedo(scene, receivers);
  const std::vector<Vec3> glow = texel_emission(scene, receivers);
  std::vector<float> brightness(radiance.size());
  for (size_t r = 0; r < radiance.size(); ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < relit.rows; ++row) rows[size_t(row)] = relit.at(r, row);
    const Vec3 n = receivers.normals[r], white = evaluate_directional_light(kind, rows, receiver_frame(n), n);
    radiance[r] = max(radiance[r] * white, Vec3(0)) + glow[r];
    brightness[r] = std::max({radiance[r].x, radiance[r].y, radiance[r].z});
  }
  ViewerLook look;
  const size_t most = brightness.size() - 1 - brightness.size() / 1000;
  std::nth_element(brightness.begin(), brightness.begin() + ptrdiff_t(most), brightness.end());
  look.strength = std::max(brightness[most], 1e-6f);
  for (Vec3& c : radiance) c /= look.strength;
  auto png = encode_png(lightmap_picture(std::get<TexelReceivers>(receivers.basis), radiance), 0, path);
  if (!png) return png.error();
  look.png = std::move(*png);
  return look;
}

}  // namespace

const std::map<std::string, Solver> solver_names{{"jacobi", Solver::jacobi},
                                                 {"gauss-seidel", Solver::gauss_seidel},
                                                 {"southwell", Solver::southwell},
                                                 {"gmres", Solver::gmres}};

nlohmann::json convergence(const SolveReport& report) {
  nlohmann::json steps = nlohmann::json::array();
  for (const SolveStep& s : report.steps) steps.push_back({{"applications", s.applications}, {"residual", s.residual}});
  return {{"converged", report.converged}, {"steps", steps}};
}

void ReceiverFlags::add_to(CLI::App& command) {
  command
      .add_option("--receivers", kind,
                  "Where light is received: vertices, texels of an atlas, or patches (triangles); texels for "
                  "lightmaps, else vertices")
      ->check(CLI::IsMember({"vertices", "texels", "patches"}));
  command
      .add_option("--texels-per-unit", texels_per_unit,
                  "Texels along one scene unit; the atlas is as large as that needs")
      ->check(CLI::PositiveNumber);
  command.add_option("--atlas", atlas,
                     "WIDTHxHEIGHT of the atlas; texels are as small as that allows (1024x1024 if nothing is said)");
}

Result<PlacedReceivers> place_receivers(Scene& scene, const ReceiverFlags& flags, const std::string& default_kind) {
  const std::string kind = flags.kind.empty() ? default_kind : flags.kind;
  if (kind != "texels" && (flags.texels_per_unit > 0 || !flags.atlas.empty()))
    return Error{flags.atlas.empty() ? "--texels-per-unit" : "--atlas", "needs --receivers texels"};
  if (kind == "vertices") return PlacedReceivers{make_vertex_receivers(scene), std::nullopt};
  if (kind == "patches") return PlacedReceivers{make_patch_receivers(scene), std::nullopt};
  AtlasOptions options{.texels_per_unit = flags.texels_per_unit};
  if (!flags.atlas.empty()) {
    if (flags.texels_per_unit > 0) return Error{"--atlas", "excludes --texels-per-unit"};
    auto size = parse_size(flags.atlas, "--atlas");
    if (!size) return size.error();
    options.width = (*size)[0], options.height = (*size)[1];
  } else if (!(flags.texels_per_unit > 0)) {
    options.width = options.height = 1024;
  }
  auto atlas = make_atlas(scene, options);
  if (!atlas) return atlas.error();
  if (!atlas->remark.empty()) warn(atlas->remark);
  Receivers receivers = make_texel_receivers(scene, *atlas);
  return PlacedReceivers{std::move(receivers), std::move(*atlas)};
}

void LightmapFlags::add_to(CLI::App& command) {
  command
      .add_option(
          "--direct", direct,
          "Lightmaps: separate writes direct light to a picture of its own as well, and leaves it out of the others")
      ->check(CLI::IsMember({"included", "separate"}))
      ->capture_default_str();
  command
      .add_option("--directional", directional,
                  "Lightmaps for normal maps: sh:2 or sh:3 (harmonics of irradiance), hl2 (Half-Life 2's three "
                  "directions), vector")
      ->check(CLI::IsMember({"none", "sh:2", "sh:3", "hl2", "vector"}))
      ->capture_default_str();
  command
      .add_option("--solver", solver,
                  "Lightmaps, with --bounces converge:EPS: jacobi, gauss-seidel, southwell or gmres")
      ->check(CLI::IsMember(solver_names))
      ->capture_default_str();
  command
      .add_option("--gather", gather,
                  "Lightmaps: bounces by cosine-distributed rays, or through a hemicube's pixels, 3 n^2 as near to "
                  "--samples as can be")
      ->check(CLI::IsMember({"rays", "hemicube"}))
      ->capture_default_str();
  command.add_option("--sky", sky, "Lightmaps: an environment (as --env of render) as one more lamp, named sky");
  command.add_flag("--light-groups", groups,
                   "Lightmaps: a column for each material that glows, each lamp by name, and the sky");
  command.add_option("--lamp-samples", lamp_samples, "Lightmaps: samples a receiver towards each group's lamps")
      ->check(CLI::Range(1, 1 << 16))
      ->capture_default_str();
}

Result<Bounces> parse_bounces(const std::string& text) {
  const std::string prefix = "converge:";
  Bounces out;
  if (text.starts_with(prefix)) {
    auto n = parse_numbers(text.substr(prefix.size()), 1, "--bounces");
    if (!n) return n.error();
    out.converge = double((*n)[0]);
    if (!(out.converge > 0 && out.converge < 1))
      return Error{"--bounces", "converge needs a residual between 0 and 1, not " + text.substr(prefix.size())};
    return out;
  }
  auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), out.count);
  if (status != std::errc() || end != text.data() + text.size() || out.count < 0 || out.count > 64)
    return Error{"--bounces", "expects a number from 0 to 64, or converge:EPS, not \"" + text + "\""};
  return out;
}

int run_lightmap(Context& context, LightmapBake o) {
  if (auto ok = check_output(o.output, {"glb"}); !ok) return fail(ok.error());
  auto start = Clock::now();
  auto scene = load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  std::optional<Environment> sky;
  if (!o.flags.sky.empty()) {
    auto env = load_environment(o.flags.sky);
    if (!env) return fail(env.error());
    warn(env->warnings);
    sky = std::move(*env);
  }
  const Lamps lamps = make_lamps(*scene, sky ? &*sky : nullptr, o.flags.groups);
  auto placed = place_receivers(*scene, o.receivers, "texels");
  if (!placed) return fail(placed.error());
  Receivers& receivers = placed->receivers;
  const double load_seconds = seconds_since(start);
  start = Clock::now();
  auto tracer = Tracer::build(*scene);
  if (!tracer) return fail(tracer.error());
  const double build_seconds = seconds_since(start);
  const size_t moved = placed->atlas ? move_buried_texels(*scene, *tracer, *placed->atlas, receivers) : 0;

  if (o.flags.directional != "none" && o.flags.direct == "separate")
    return fail({"--direct", "separate goes with --directional none"});
  o.options.solver = solver_names.at(o.flags.solver), o.options.lamp_samples = o.flags.lamp_samples;
  o.options.directional = *directional_kind(o.flags.directional);
  o.options.gather = o.flags.gather == "hemicube" ? GatherKind::hemicube : GatherKind::rays;
  o.options.precision = o.precision == "half" ? Precision::half : Precision::single;
  LightmapReport report;
  // Splitting changed vertex numbers, not triangles: the lamps still fit.
  auto map = bake_lightmap(*scene, *tracer, receivers, lamps, o.options, o.flags.direct == "separate", &report,
                           &context.progress);
  if (!map) return fail(map.error());

  const LightBasis& light = map->all.light;
  start = Clock::now();
  std::vector<std::string> pictures;
  std::optional<ViewerLook> look;
  if (const auto* texels = std::get_if<TexelReceivers>(&receivers.basis); texels && !light.groups.empty()) {
    Relit relit, direct;
    auto save = [&](const std::string& name, const Relit& values) -> Result<void> {
      for (int row = 0; row < values.rows; ++row) {
        pictures.push_back(picture_path(o.output, name, values.rows > 1 ? std::to_string(row) : ""));
        if (auto ok = save_image(pictures.back(), lightmap_picture(*texels, values, 4, row)); !ok) return ok;
      }
      return {};
    };
    const bool each = o.flags.groups;
    for (size_t g = each ? 0 : SIZE_MAX;; ++g) {
      const std::string name = each ? light.groups[g] : "";
      relight(map->all, only_group(light, g), relit);
      if (map->direct) {
        relight(*map->direct, only_group(light, g), direct);
        if (auto ok = save(name.empty() ? "direct" : name + ".direct", direct); !ok) return fail(ok.error());
        for (size_t i = 0; i < relit.values.size(); ++i)
          relit.values[i] = std::max(0.0f, relit.values[i] - direct.values[i]);
      }
      if (auto ok = save(map->direct ? (name.empty() ? "indirect" : name + ".indirect") : name, relit); !ok)
        return fail(ok.error());
      if (!each || g + 1 == light.groups.size()) break;
    }
    relight(map->all, only_group(light, SIZE_MAX), relit);
    auto made = make_look(*scene, receivers, o.options.directional, relit, o.output);
    if (!made) return fail(made.error());
    look = std::move(*made);
  }
  nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options",
       {{"transfer", "lightmap"},
        {"order", o.options.order},
        {"samples", o.options.samples},
        {"lamp_samples", o.options.lamp_samples},
        {"bounces", o.options.bounces},
        {"converge", o.options.converge},
        {"directional", o.flags.directional},
        {"gather", o.flags.gather},
        {"sky", o.flags.sky},
        {"emit", o.scene.emit},
        {"max_albedo", o.scene.max_albedo},
        {"ground", o.scene.ground},
        {"max_edge", o.scene.max_edge},
        {"seed", o.options.seed}}},
      {"report", {{"receivers", report.receivers}, {"moved", moved}, {"buried", report.buried}}}};
  if (auto ok = save_baked(o.output, *scene, receivers, map->all, provenance.dump(),
                           {.directional = o.options.directional, .look = look ? &*look : nullptr});
      !ok)
    return fail(ok.error());
  const double save_seconds = seconds_since(start);

  if (context.json) {
    nlohmann::json result{{"output", o.output},
                          {"pictures", pictures},
                          {"receivers", report.receivers},
                          {"moved", moved},
                          {"buried", report.buried},
                          {"groups", light.groups},
                          {"rays", report.rays},
                          {"seconds",
                           {{"load", load_seconds},
                            {"build", build_seconds},
                            {"trace", report.trace_seconds},
                            {"bounce", report.bounce_seconds},
                            {"save", save_seconds}}},
                          {"bytes", map->all.bytes()},
                          {"operator_bytes", report.operator_bytes},
                          {"operator_kept", report.operator_kept}};
    if (placed->atlas)
      result["atlas"] = {{"width", placed->atlas->width},
                         {"height", placed->atlas->height},
                         {"charts", placed->atlas->charts},
                         {"texels_per_unit", placed->atlas->texels_per_unit}};
    if (o.options.converge > 0) result["convergence"] = convergence(report.solve);
    print_json(result);
    return success;
  }
  fmt::print("{}\n", o.output);
  for (const std::string& p : pictures) fmt::print("{}\n", p);
  if (placed->atlas)
    fmt::print("  atlas      {}x{}, {} charts, {:.3g} texels a unit\n", placed->atlas->width, placed->atlas->height,
               human_count(placed->atlas->charts), placed->atlas->texels_per_unit);
  fmt::print("  receivers  {}{}{}\n", human_count(report.receivers),
             moved ? "; " + human_count(moved) + " moved out of geometry" : "",
             report.buried ? "; " + human_count(report.buried) + " buried, filled from neighbours" : "");
  fmt::print("  lamps      {}\n", light.groups.empty() ? "none; harmonics of order " + std::to_string(light.order)
                                                       : fmt::format("{}", fmt::join(light.groups, ", ")));
  fmt::print("  rays       {} ({:.1f} million a second)\n", human_count(report.rays),
             double(report.rays) / std::max(report.trace_seconds, 1e-9) / 1e6);
  fmt::print("  time       load {}, build {}, trace {}, bounce {}, save {}\n", human_seconds(load_seconds),
             human_seconds(build_seconds), human_seconds(report.trace_seconds), human_seconds(report.bounce_seconds),
             human_seconds(save_seconds));
  if (o.options.converge > 0 && !report.solve.steps.empty())
    fmt::print("  solver     {}: residual {:.2g} after {:.1f} applications{}\n", o.flags.solver,
               report.solve.steps.back().residual, report.solve.steps.back().applications,
               report.solve.converged ? "" : ", not converged");
  if (report.operator_kept < 1)
    fmt::print("  memory     {:.0f}% of the gather operator fitted; the rest was traced again for each bounce\n",
               100 * report.operator_kept);
  return success;
}

}  // namespace lambent::tool

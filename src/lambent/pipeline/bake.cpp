#include <lambent/pipeline/bake.h>

#include <lambent/bake/bake.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/unbury.h>
#include <lambent/compress/parametric.h>
#include <lambent/core/clock.h>
#include <lambent/core/ranks.h>
#include <lambent/light/environment.h>
#include <lambent/pipeline/bake_cube.h>
#include <lambent/pipeline/bake_lightmap.h>
#include <lambent/pipeline/bake_parse.h>
#include <lambent/pipeline/bake_rooms.h>
#include <lambent/pipeline/bake_surfels.h>
#include <lambent/pipeline/durable.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/place_receivers.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/fix_light.h>
#include <lambent/relight/light.h>
#include <lambent/render/render.h>

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

namespace lambent {
namespace {

// A bake under way.
struct Bake {
  const BakeRequest& request;
  const BakePlan& plan;
  const Job& job;
  Scene scene{};
  PlacedReceivers placed{};
  Tracer tracer{};  // of the scene above, which stays where it is
  double load_seconds = 0, build_seconds = 0;
  std::optional<AdaptReport> adapted{};
  BakeReport report{};
  // What it has made so far; a dense store may still become a smaller one.
  Store store{};
  Rows rows = DiffuseRows{};
  std::optional<FixedView> view{};
  std::vector<float> fit_errors{};
  std::vector<Transfer> terms{};
  std::vector<Field> more{};
  Summary summary{};
  nlohmann::json told = nlohmann::json::object();  // of the report, for provenance

  const Receivers& receivers() const { return placed.receivers; }
  Transfer& dense() { return std::get<Transfer>(store); }
  const Outgoing* outgoing() const { return std::get_if<Outgoing>(&rows); }
  void line(const std::string& label, std::string text) { summary.lines.emplace_back(label, std::move(text)); }
};

Result<void> bake_by_rooms(Bake& b) {
  auto transfer =
      bake_rooms_of_request(b.request, b.plan.bake, b.scene, b.receivers(), b.job, b.report, b.summary, b.told);
  if (!transfer) return transfer.error();
  b.store = std::move(*transfer);
  return {};
}

Result<void> bake_diffuse(Bake& b) {
  if (!b.request.rooms.empty()) return bake_by_rooms(b);
  if (b.request.subsurface.empty()) {
    BakeOptions options = b.plan.bake;
    if (b.adapted && options.seconds >= 0) options.seconds = std::max(0.0, options.seconds - b.adapted->seconds);
    const BakeRequest& r = b.request;
    options.own_part = b.plan.kind == BakeKind::diffuse && r.compress.empty() && r.fix_light.empty() &&
                       r.fix_view.empty() && r.lattice.empty();
    auto transfer = bake(b.scene, b.tracer, b.receivers(), options, &b.report, b.job.progress);
    if (!transfer) return transfer.error();
    b.store = std::move(*transfer), b.terms = std::move(b.report.terms);
    return {};
  }
  SubsurfaceReport walks;
  auto transfer = bake_subsurface(b.scene, b.tracer, b.receivers(), b.plan.bake, b.plan.subsurface, &b.report, &walks,
                                  b.job.progress);
  if (!transfer) return transfer.error();
  if (walks.lost > 0.005)
    b.job.warn(
        fmt::format("{:.1f}% of the walks through the medium were lost, and their light with them: surfaces are "
                    "not closed, or the medium is too dense",
                    100 * walks.lost));
  b.store = std::move(*transfer), b.terms = std::move(b.report.terms);
  b.summary.json["subsurface"] = {{"events", walks.events}, {"lost", walks.lost}};
  b.line("medium", fmt::format("{:.1f} events a walk", walks.events));
  return {};
}

// Lobes that the incident bands do not hold show blurred, and nothing after the bake brings them back.
void warn_of_smooth_materials(Bake& b, const ReceiverMaterials& materials) {
  constexpr double told = 0.1;
  const CosineBasis basis = make_cosine_basis(b.plan.matrix.incident_order);
  std::vector<size_t> receivers(materials.materials.size(), 0);
  for (uint16_t m : materials.of_receiver) ++receivers[m];
  double most = 0, mean = 0;
  const Brdf* smoothest = nullptr;
  size_t smooth = 0;
  for (size_t m = 0; m < receivers.size(); ++m) {
    if (receivers[m] == 0) continue;
    const double beyond = energy_beyond(materials.materials[m].white, basis, 1024);
    mean += beyond * double(receivers[m]) / double(materials.of_receiver.size());
    if (beyond > told) smooth += receivers[m];
    if (beyond > most) most = beyond, smoothest = &materials.materials[m].white;
  }
  b.summary.json["beyond_incident_bands"] = {{"most", most}, {"mean", mean}};
  if (most <= told) return;
  const auto* mixed = std::get_if<MetallicRoughness>(smoothest);
  b.job.warn(fmt::format(
      "{}: {:.0f} % of the energy of {} lies beyond {} incident bands, and is lost: it will look rougher than it is "
      "({}`--transfer blocks` holds it)",
      smooth == materials.of_receiver.size()
          ? "all surfaces are too smooth"
          : fmt::format("{} of {} receivers are on surfaces too smooth", human_count(smooth),
                        human_count(materials.of_receiver.size())),
      100 * most,
      mixed ? fmt::format("the smoothest's reflection (metallic {:.2g}, roughness {:.2g})", mixed->metallic,
                          mixed->roughness)
            : std::string("their reflection"),
      b.plan.matrix.incident_order,
      b.plan.matrix.incident_order < max_incident_order
          ? fmt::format("--incident-order {} holds more, ", max_incident_order)
          : ""));
}

Result<void> bake_glossy(Bake& b) {
  const ReceiverMaterials materials = make_receiver_materials(b.scene, b.receivers(), b.plan.reflection);
  auto baked =
      bake_matrix(b.scene, b.tracer, b.receivers(), materials, b.plan.bake, b.plan.matrix, &b.report, b.job.progress);
  if (!baked) return baked.error();
  warn_of_smooth_materials(b, materials);
  b.store = std::move(baked->transfer), b.rows = std::move(baked->outgoing), b.terms = std::move(b.report.terms);
  return {};
}

// Visibility times cosine is diffuse transfer of direct light, of as many bands as make the product with light exact.
Result<void> bake_factors(Bake& b) {
  BakeOptions visibility = b.plan.bake;
  visibility.order += b.plan.matrix.incident_order - 1, visibility.bounces = 0;
  auto transfer = bake(b.scene, b.tracer, b.receivers(), visibility, &b.report, b.job.progress);
  if (!transfer) return transfer.error();
  const ReceiverMaterials materials = make_receiver_materials(b.scene, b.receivers(), b.plan.reflection);
  b.rows = make_map_outgoing(materials, b.plan.matrix.incident_order, b.plan.matrix, b.job.progress);
  if (is_cancelled(b.job.progress)) return Error{"", "cancelled"};
  warn_of_smooth_materials(b, materials);
  b.store = FactoredTransfer{std::move(*transfer), b.plan.matrix.incident_order};
  return {};
}

Result<void> fit_lobes(Bake& b) {
  ZonalFitOptions options = b.plan.zonal;
  if (const Outgoing* outgoing = b.outgoing()) options.row_weights = row_weights(*outgoing);
  ZonalFitReport fit;
  auto zonal = fit_zonal(b.dense(), options, &fit, b.job.progress);
  if (!zonal) return zonal.error();
  b.summary.json["zonal"] = {{"lobes", zonal->lobes}, {"rms", fit.rms}, {"seconds", fit.seconds}};
  b.told["zonal"] = {{"lobes", zonal->lobes}, {"rms", fit.rms}};
  b.line("lobes", fmt::format("{}, fitted in {}, with an error of {:.2f}% RMS", zonal->lobes,
                              human_seconds(fit.seconds), 100 * fit.rms));
  b.store = std::move(*zonal), b.fit_errors = std::move(fit.errors);
  return {};
}

Result<void> make_membrane(Bake& b) {
  auto alphas = membrane_alphas(b.request.membrane, b.scene, b.receivers());
  if (!alphas) return alphas.error();
  b.store = membrane_transfer(b.request.order, b.receivers().normals, *alphas, b.plan.bake.precision);
  b.report.receivers = b.receivers().count();
  b.line("lobes", "one a receiver: a membrane");
  return {};
}

Result<void> bake_over_cube(Bake& b) {
  const bool wavelets = b.plan.kind == BakeKind::wavelets;
  auto seen = bake_visibility_of_plan(b.plan, b.scene, b.tracer, b.receivers(), b.job, b.report, b.summary);
  if (!seen) return seen.error();
  if (!wavelets) return b.store = std::move(*seen), b.rows = SightRows{}, Result<void>();
  b.summary.json["wavelets"] = {{"blocks_bytes", seen->bytes()}};
  const bool for_view = !b.request.fix_view.empty();
  HaarFitReport fit;
  auto transfer = fit_haar_of_plan(b.plan, for_view, *seen, b.scene, b.tracer, b.receivers(), b.job, b.report, fit);
  if (!transfer) return transfer.error();
  if (!for_view) tell_wavelets(*transfer, fit, "receiver", b.summary, b.told);
  b.store = std::move(*transfer);
  return {};
}

Result<void> bake_to_indirect(Bake& b) {
  auto baked =
      bake_indirect_of_request(b.request, b.plan, b.scene, b.tracer, b.receivers(), b.job, b.report, b.summary);
  if (!baked) return baked.error();
  if (const DirectionalKind kind = b.plan.indirect.directional; kind != DirectionalKind::none)
    b.rows = DirectionalRows{kind};
  b.store = std::move(*baked);
  return {};
}

Result<void> bake_surface(Bake& b) {
  switch (b.plan.kind) {
    case BakeKind::diffuse: return bake_diffuse(b);
    case BakeKind::matrix: return bake_glossy(b);
    case BakeKind::factors: return bake_factors(b);
    case BakeKind::membrane: return make_membrane(b);
    case BakeKind::blocks:
    case BakeKind::wavelets: return bake_over_cube(b);
    case BakeKind::indirect: return bake_to_indirect(b);
    case BakeKind::lightmap: return Error{"", "a lightmap is baked by bake_lightmap_request()"};
    case BakeKind::zonal:
    case BakeKind::glossy_zonal: break;
  }
  auto ok = b.plan.kind == BakeKind::zonal ? bake_diffuse(b) : bake_glossy(b);
  return ok ? fit_lobes(b) : ok;
}

Result<void> bake_free_space(Bake& b, const Lattice& lattice) {
  LatticeReport report;
  auto baked = bake_lattice(b.scene, b.tracer, b.receivers(), b.dense(), b.outgoing(), lattice, b.plan.lattice, &report,
                            b.job.progress);
  if (!baked) return baked.error();
  b.more.push_back(lattice_field(std::move(*baked)));
  b.told["lattice_invalid"] = report.invalid;
  b.summary.json["lattice"] = {{"points", report.points}, {"invalid", report.invalid},
                               {"rays", report.rays},     {"seconds", report.seconds},
                               {"bytes", report.bytes},   {"neighbours", report.neighbours},
                               {"walled", report.walled}};
  const std::string invalid =
      report.invalid ? "; " + human_count(report.invalid) + " inside something, filled from neighbours" : "";
  b.line("lattice", fmt::format("{} points, order {}, {} in {}{}", human_count(report.points), b.plan.lattice.order,
                                human_bytes(double(report.bytes)), human_seconds(report.seconds), invalid));
  if (report.walled)
    b.job.warn(
        fmt::format("--lattice: a surface stands between {} of {} pairs of neighbouring points, thinner than a "
                    "cell: light leaks through it; finer cells keep it in",
                    human_count(report.walled), human_count(report.neighbours)));
  return {};
}

// What a GLB cannot hold is told before the work.
Result<void> check_picture_bytes(const Bake& b, const View& view) {
  if (file_extension(b.request.output) != "glb") return {};
  if (b.plan.kind == BakeKind::wavelets)
    return check_haar_of_view(b.plan, b.request.size, b.scene, b.tracer, b.receivers(), view);
  const size_t columns = b.plan.bake.light().count();
  const size_t bytes = 3 * size_t(view.width) * size_t(view.height) * columns *
                       (b.plan.bake.precision == Precision::half ? 2 : 4);
  if (bytes < size_t{1} << 32) return {};
  return Error{"--size",
               fmt::format("{} pixels of {} columns take {} bytes, and a .glb holds 4 GiB: write a .gltf",
                           b.request.size, columns, bytes),
               true};
}

Result<void> fix_the_view(Bake& b, const View& view) {
  RenderOptions options;
  options.width = view.width, options.height = view.height, options.samples = b.request.spp;
  options.outgoing = b.outgoing();
  if (const auto* receivers = std::get_if<HaarTransfer>(&b.store)) {
    auto mix = mix_of_view(b.scene, b.tracer, b.receivers().basis, view.camera, options, b.job.progress);
    if (!mix) return mix.error();
    HaarFitReport fit;
    auto pixels = haar_of_view(*receivers, *mix, b.plan.haar, b.plan.bake.memory, fit, b.job.progress);
    if (!pixels) return pixels.error();
    tell_wavelets(*pixels, fit, "pixel", b.summary, b.told);
    b.view = FixedView{view.camera, view.width, view.height, std::move(mix->coverage)};
    b.store = std::move(*pixels), b.rows = DiffuseRows{};
    return {};
  }
  auto pixels = fix_view(b.scene, b.tracer, b.receivers().basis, b.dense(), view.camera, options, b.job.progress);
  if (!pixels) return pixels.error();
  b.view = FixedView{view.camera, view.width, view.height, std::move(pixels->coverage)};
  b.store = std::move(pixels->transfer), b.rows = DiffuseRows{};
  return {};
}

Result<void> fix_the_light(Bake& b) {
  auto env = load_environment(b.request.fix_light);
  if (!env) return env.error();
  for (const std::string& w : env->warnings) b.job.warn(w);
  b.store = fix_light(b.dense(), project_light(*env, b.dense().light).light, env->name);
  return {};
}

Result<void> make_clusters(Bake& b) {
  const auto start = Clock::now();
  double error = 0;
  auto clusters = compress_cpca(b.dense(), b.plan.cpca, &error, b.job.progress);
  if (!clusters) return clusters.error();
  const double seconds = seconds_since(start);
  b.summary.json["cpca"] = {
      {"clusters", clusters->clusters}, {"rank", clusters->rank}, {"error", error}, {"seconds", seconds}};
  b.told["cpca_error"] = error;
  b.line("clusters", fmt::format("{} of rank {}, found in {}, with an error of {:.2f}% RMS", clusters->clusters,
                                 clusters->rank, human_seconds(seconds), 100 * error));
  b.store = std::move(*clusters);
  return {};
}

// What is known of the result's error.
void summarize_error(Bake& b) {
  const BakeReport& r = b.report;
  const Certificate& c = r.certificate;
  if (b.adapted) {
    const AdaptReport& a = *b.adapted;
    b.summary.json["adapt"] = {{"triangles_before", a.before},
                               {"triangles", a.after},
                               {"levels", a.levels},
                               {"rays", a.rays},
                               {"first", a.first},
                               {"last", a.last},
                               {"limited", a.limited},
                               {"late", a.late}};
    b.summary.json["seconds"]["adapt"] = a.seconds;
    const char* ended = a.limited ? ", as many as --quality allows" : a.late ? ", as long as --time allows" : "";
    if (a.after > a.before || a.late)
      b.line("mesh", fmt::format("{} triangles from {}, split where light changes{}", human_count(a.after),
                                 human_count(a.before), ended));
  }
  if (c.error < 0) {
    if (r.error >= 0) b.line("error", fmt::format("{:.2f}% RMS, estimated from half-sample gathers", 100 * r.error));
    return;
  }
  nlohmann::json parts = nlohmann::json::object();
  for (size_t p = 0; p < c.parts.size(); ++p)
    if (c.parts[p] >= 0) parts[b.scene.parts[p].name] = c.parts[p];
  b.summary.json["certificate"] = {{"error", c.error},    {"uncertain", c.uncertain}, {"places", c.places},
                                   {"noise", r.noise},    {"noise_of_rays", c.noise}, {"parts", std::move(parts)},
                                   {"samples", r.samples}};
  b.told["certificate"] = b.summary.json["certificate"];
  b.summary.json["seconds"]["denoise"] = r.denoise_seconds, b.summary.json["seconds"]["certify"] = r.certify_seconds;
  std::string text = fmt::format("{:.1f}% RMS (within {:.1f}), measured at {} places by rays of their own",
                                 100 * c.error, 200 * c.uncertain, human_count(c.places));
  if (r.noise >= 0)
    text += fmt::format("; noise {:.1f}%{}, at {} rays a receiver", 100 * r.noise,
                        r.denoised >= 0 ? fmt::format(" ({:.1f}% before denoising)", 100 * c.noise) : "", r.samples);
  b.line("error", text);
  if (b.plan.bake.error > 0 && c.error > b.plan.bake.error + 2 * c.uncertain)
    b.line("", fmt::format("above the {:.3g}% asked for: {}", 100 * b.plan.bake.error,
                           r.noise > 0.8 * c.error ? "more rays would help (--samples, or no --time)"
                                                   : "what is lost lies between receivers (--quality final, or "
                                                     "--max-edge, has more)"));
}

// What all kinds say, before what each has said of itself.
void summarize(Bake& b) {
  const BakeReport& r = b.report;
  const LightBasis light = light_of(b.store);
  const size_t bytes = bytes_of(b.store), receivers = receivers_of(b.store);
  const double each = double(bytes) / double(std::max<size_t>(receivers, 1));
  const double rate = r.trace_seconds > 0 ? double(r.rays) / r.trace_seconds : 0.0;
  b.summary.json.update({{"receivers", r.receivers},
                         {"buried", r.buried},
                         {"vertices", b.scene.positions.size()},
                         {"triangles", b.scene.triangles.size()},
                         {"rays", r.rays},
                         {"order", light.order},
                         {"lobes", light.lobes.size()},
                         {"channels", channels_of(b.store)},
                         {"rows", rows_of(b.store)},
                         {"seconds",
                          {{"load", b.load_seconds},
                           {"build", b.build_seconds},
                           {"trace", r.trace_seconds},
                           {"bounce", r.bounce_seconds}}},
                         {"rays_per_second", rate},
                         {"bytes", bytes},
                         {"bytes_per_receiver", each},
                         {"operator_bytes", r.operator_bytes},
                         {"operator_file_bytes", r.operator_file_bytes},
                         {"operator_kept", r.operator_kept},
                         {"working_memory", r.working_memory},
                         {"error", r.error >= 0 ? nlohmann::json(r.error) : nlohmann::json()}});
  if (r.traced > 0) b.summary.json["traced"] = r.traced;
  if (b.view) b.summary.json["pixels"] = receivers;
  if (!b.terms.empty()) b.summary.json["terms"] = b.terms.size();
  std::vector<std::pair<std::string, std::string>> lines;
  lines.emplace_back("receivers",
                     fmt::format("{} ({} vertices, {} triangles{})", human_count(r.receivers),
                                 human_count(b.scene.positions.size()), human_count(b.scene.triangles.size()),
                                 r.buried ? "; " + human_count(r.buried) + " buried, filled from neighbours" : ""));
  if (b.plan.bake.meshless) lines.emplace_back("", human_count(r.traced) + " surfels traced, which they read");
  else if (r.traced > 0 && r.traced < r.receivers)
    lines.emplace_back("", human_count(r.traced) + " of them traced, which stand for the others");
  if (r.rays > 0)
    lines.emplace_back("rays", fmt::format("{} ({:.1f} million a second)", human_count(r.rays), rate / 1e6));
  lines.emplace_back("time", fmt::format("load {}, build {}, trace {}, bounce {}", human_seconds(b.load_seconds),
                                         human_seconds(b.build_seconds), human_seconds(r.trace_seconds),
                                         human_seconds(r.bounce_seconds)));
  const int rows = rows_of(b.store), channels = channels_of(b.store);
  std::string shape = light.count() == 0
                        ? std::string()
                        : fmt::format(" ({}, {} row{}, {} channel{}, {})", describe_light(light), rows,
                                      rows == 1 ? "" : "s", channels, channels == 1 ? "" : "s", b.request.precision);
  lines.emplace_back("size", fmt::format("{} a {}, {} in all{}", human_bytes(each), b.view ? "pixel" : "receiver",
                                         human_bytes(double(bytes)), shape));
  b.summary.lines.insert(b.summary.lines.begin(), lines.begin(), lines.end());
  if (r.operator_kept < 1)
    b.line("memory", fmt::format("{:.0f}% of the gather operator fitted; the rest was traced again for each bounce",
                                 100 * r.operator_kept));
  if (r.operator_file_bytes > 0)
    b.line("memory", fmt::format("{} of the gather operator did not fit, and went through a file",
                                 human_bytes(double(r.operator_file_bytes))));
  summarize_error(b);
}

Result<void> begin(Bake& b) {
  auto start = Clock::now();
  auto scene = load_scene_of(b.request, b.job);
  if (!scene) return scene.error();
  b.scene = std::move(*scene);
  auto adapted = adapt_scene(b.scene, b.request, b.plan, b.job);
  if (!adapted) return adapted.error();
  b.adapted = *adapted;
  auto placed = place_receivers(b.scene, b.request, b.job);
  if (!placed) return placed.error();
  b.placed = std::move(*placed);
  b.load_seconds = seconds_since(start), start = Clock::now();
  if (!b.request.rooms.empty()) return {};  // each has its own tree
  auto tracer = Tracer::build(b.scene, b.job.progress);
  if (!tracer) return tracer.error();
  b.tracer = std::move(*tracer), b.build_seconds = seconds_since(start);
  return {};
}

// Stages after the surfaces' own, in their order; each takes a dense store.
Result<void> bake_beside(Bake& b, const std::optional<Lattice>& lattice, const std::optional<View>& view) {
  if (lattice)
    if (auto ok = bake_free_space(b, *lattice); !ok) return ok;
  if (view && this_ranks().count() > 1) b.job.warn("--fix-view: its pixels are gathered by every rank for itself");
  if (view)
    if (auto ok = fix_the_view(b, *view); !ok) return ok;
  if (!b.request.fix_light.empty())
    if (auto ok = fix_the_light(b); !ok) return ok;
  return b.request.compress.empty() ? Result<void>() : make_clusters(b);
}

Result<BakeOutcome> bake_plain(const BakeRequest& request, const BakePlan& plan, const Job& job) {
  const std::unique_ptr<Bake> begun(new Bake{request, plan, job});
  Bake& b = *begun;
  if (auto ok = begin(b); !ok) return ok.error();
  std::optional<Lattice> lattice;
  if (!request.lattice.empty() && plan.kind != BakeKind::indirect) {
    auto parsed = lattice_of_request(request, b.scene);
    if (!parsed) return parsed.error();
    if (auto ok = check_lattice(*parsed, plan.bake.light(), plan.lattice); !ok) return ok.error();
    lattice = *parsed;
  }
  std::optional<View> view;
  if (!request.fix_view.empty()) {
    auto made = parse_view(request.fix_view, request.size, b.scene);
    if (!made)
      return Error{made.error().where == "--camera" ? "--fix-view" : made.error().where, made.error().message, true};
    if (auto ok = check_picture_bytes(b, *made); !ok) return ok.error();
    view = *made;
  }
  if (auto ok = check_file_size(plan, request, b.scene, b.receivers().count(), 0); !ok) return ok.error();
  if (auto ok = job.inputs_read({}); !ok) return ok.error();
  if (plan.kind != BakeKind::membrane && plan.kind != BakeKind::indirect && request.shadows == "on" &&
      request.rooms.empty())
    warn_if_enclosed(b.scene, b.tracer, b.receivers(), job);
  if (b.placed.atlas) move_buried_texels(b.scene, b.tracer, *b.placed.atlas, b.placed.receivers, job.progress);
  if (auto ok = bake_surface(b); !ok) return ok.error();
  if (auto ok = bake_beside(b, lattice, view); !ok) return ok.error();
  summarize(b);
  b.told["receivers"] = b.report.receivers, b.told["buried"] = b.report.buried;
  if (b.report.error >= 0) b.told["error"] = b.report.error;
  BakeOutcome out;
  out.summary = std::move(b.summary);
  out.baked = b.view ? make_baked(std::move(b.scene), std::move(*b.view), std::move(b.store))
                     : make_baked(std::move(b.scene), b.receivers(), std::move(b.store), std::move(b.rows));
  out.baked.surface.fit_errors = std::move(b.fit_errors);
  out.baked.more = std::move(b.more), out.baked.terms = std::move(b.terms);
  out.baked.provenance = provenance_of(request, out.baked.scene, std::move(b.told));
  return out;
}

}  // namespace

Result<BakeOutcome> bake_with_summary(const BakeRequest& asked, const Job& job) {
  auto request = resolved(asked);
  if (!request) return request.error();
  auto plan = plan_of(*request, job);
  if (!plan) return plan.error();
  return plan->kind == BakeKind::lightmap ? bake_lightmap_request(*request, *plan, job)
                                          : bake_plain(*request, *plan, job);
}

Result<Baked> bake(const BakeRequest& request, const Job& job) {
  auto outcome = bake_with_summary(request, job);
  if (!outcome) return outcome.error();
  return std::move(outcome->baked);
}

}  // namespace lambent

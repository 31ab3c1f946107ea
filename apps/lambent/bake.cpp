#include "bake_lightmap.h"
#include "blocks.h"
#include "commands.h"
#include "options.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/subsurface.h>
#include <lambent/bake/unbury.h>
#include <lambent/baked/baked_file.h>
#include <lambent/compress/cpca.h>
#include <lambent/compress/parametric.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/image/image.h>
#include <lambent/light/lamps.h>
#include <lambent/relight/fix_light.h>
#include <lambent/relight/light.h>
#include <lambent/render/render.h>

#include <fmt/format.h>

#include <charconv>
#include <chrono>

namespace lambent::tool {
namespace {

struct BakeCommand {
  SceneOptions scene;
  BakeOptions bake;
  MatrixOptions matrix;
  BrdfOptions brdf;
  ZonalFitOptions zonal;
  LatticeOptions lattice;
  std::string lattice_points, lattice_box;
  std::string light, transfer = "diffuse", membrane, subsurface, outgoing = "map", simulate = "recursion", fix_light,
                     fix_view, size = "512x512", compress, output, shadows = "on", precision = "half", bounces = "3";
  bool factors = false, glossy = false;  // glossy: lobes of the rows of a matrix
  int view_samples = 16;                 // rays a pixel of a fixed view
  ReceiverFlags receivers;
  LightmapFlags lightmap;
  BlocksFlags blocks;
  bool order_given = false;
};

// KIND or KIND:N, where N is the number of rows (svd) or bands (sh, hemisphere, hsh).
Result<void> parse_outgoing(const std::string& text, MatrixOptions& matrix) {
  const size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const auto kind = std::find(std::begin(outgoing_names), std::end(outgoing_names), name);
  if (kind == std::end(outgoing_names))
    return Error{"--outgoing",
                 "must be map, phong, svd:ROWS, sh:BANDS, hemisphere:BANDS or hsh:BANDS, not \"" + text + "\""};
  matrix.outgoing = OutgoingKind(kind - std::begin(outgoing_names));
  if (colon == std::string::npos) return {};
  if (matrix.outgoing == OutgoingKind::map || matrix.outgoing == OutgoingKind::phong)
    return Error{"--outgoing", name + " takes no number: --incident-order says how many rows it has"};
  auto number = parse_numbers(text.substr(colon + 1), 1, "--outgoing");
  if (!number) return number.error();
  const float n = (*number)[0];
  if (n != std::floor(n) || n < 1 || n > 64)
    return Error{"--outgoing", "expects a whole number from 1 to 64 after the colon, not \"" + text + "\""};
  (matrix.outgoing == OutgoingKind::svd ? matrix.svd_rows : matrix.outgoing_order) = int(n);
  return {};
}

Result<Lattice> parse_lattice(const BakeCommand& o, const Scene& scene) {
  auto counts = parse_numbers(o.lattice_points, 3, "--lattice");
  if (!counts) return counts.error();
  for (float n : *counts)
    if (n != std::floor(n) || n < 1 || n > float(max_lattice_points))
      return Error{"--lattice", "expects three whole numbers from 1 to " + std::to_string(max_lattice_points) +
                                    ", not \"" + o.lattice_points + "\""};
  Bounds box = default_lattice_box(scene);
  if (!o.lattice_box.empty()) {
    auto b = parse_numbers(o.lattice_box, 6, "--lattice-box");
    if (!b) return b.error();
    box = {{(*b)[0], (*b)[1], (*b)[2]}, {(*b)[3], (*b)[4], (*b)[5]}};
    if (!all_at_most(box.min, box.max)) return Error{"--lattice-box", "expects the lower corner first, then the upper"};
    if (!all_at_most(max(abs(box.min), abs(box.max)), Vec3(1e9f))) return Error{"--lattice-box", "lies beyond 1e9"};
  }
  return Lattice{box.min, box.max, int((*counts)[0]), int((*counts)[1]), int((*counts)[2])};
}

// What share of the light a sheet lets through at each receiver: one number, or a picture's luminance at its texture
// coordinates.
Result<std::vector<float>> membrane_alphas(const std::string& text, const Scene& scene, const Receivers& receivers) {
  if (auto number = parse_numbers(text, 1, "--membrane")) {
    if (!((*number)[0] >= 0 && (*number)[0] <= 1))
      return Error{"--membrane", "lets through a share from 0 to 1, not " + text};
    return std::vector<float>(receivers.count(), (*number)[0]);
  }
  auto picture = load_image(text);
  if (!picture) return picture.error();
  if (scene.texcoords[0].empty())
    return Error{scene.path, "has no texture coordinates to look the membrane's picture up by"};
  std::vector<float> alphas(receivers.count());
  for (const auto* map : {&receivers.front, &receivers.back})
    for (size_t v = 0; v < map->size(); ++v) {
      if ((*map)[v] == none) continue;
      const Vec2 uv = scene.texcoords[0][v] - floor(scene.texcoords[0][v]);
      const int x = std::min(int(uv.x * float(picture->width)), picture->width - 1),
                y = std::min(int(uv.y * float(picture->height)), picture->height - 1);
      const float alpha = luminance(picture->at(x, y));
      alphas[(*map)[v]] = std::isfinite(alpha) ? std::clamp(alpha, 0.0f, 1.0f) : 0.0f;
    }
  return alphas;
}

int bake_membrane(Context& context, const BakeCommand& o) {
  auto scene = load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  const Receivers receivers = make_vertex_receivers(*scene);
  auto alphas = membrane_alphas(o.membrane, *scene, receivers);
  if (!alphas) return fail(alphas.error());
  const ZonalTransfer transfer = membrane_transfer(o.bake.order, receivers.normals, *alphas, o.bake.precision);
  const nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options", {{"order", o.bake.order}, {"membrane", o.membrane}, {"precision", o.precision}}}};
  if (auto ok = save_baked(o.output, *scene, receivers, transfer, provenance.dump()); !ok) return fail(ok.error());
  if (context.json) print_json({{"output", o.output}, {"receivers", transfer.receivers}, {"bytes", transfer.bytes()}});
  else
    fmt::print("{}\n  a membrane at {} receivers, one lobe each, {}\n", o.output, human_count(transfer.receivers),
               human_bytes(double(transfer.bytes())));
  return success;
}

constexpr int max_lamps = 64, max_directional = 256;
constexpr const char* light_syntax = "sh:BANDS, sh:BANDS+lamps:COUNT@ENV, or directional:COUNT";

Result<int> parse_whole(const std::string& text, int least, int most, const std::string& what) {
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || value < least || value > most)
    return Error{"--light", what + " must be a whole number from " + std::to_string(least) + " to " +
                                std::to_string(most) + ", not \"" + text + "\""};
  return value;
}

// Sets the columns of light that `text` asks for; loads the environment it names, if any.
Result<void> parse_light(const std::string& text, BakeOptions& bake) {
  if (text.starts_with("directional:")) {
    auto count = parse_whole(text.substr(12), 4, max_directional, "the count after directional:");
    if (!count) return count.error();
    bake.order = 0, bake.lobes = even_lobes(*count);
    return {};
  }
  if (!text.starts_with("sh:"))
    return Error{"--light", "must be " + std::string(light_syntax) + ", not \"" + text + "\""};
  const size_t plus = text.find('+');
  auto order =
      parse_whole(text.substr(3, plus == std::string::npos ? plus : plus - 3), 1, max_sh_order, "the bands after sh:");
  if (!order) return order.error();
  bake.order = *order;
  if (plus == std::string::npos) return {};
  const std::string lamps = text.substr(plus + 1);
  const size_t at = lamps.find('@');
  if (!lamps.starts_with("lamps:") || at == std::string::npos || at + 1 == lamps.size())
    return Error{"--light", "expects lamps:COUNT@ENV after the plus sign, not \"" + lamps + "\""};
  auto count = parse_whole(lamps.substr(6, at - 6), 1, max_lamps, "the count after lamps:");
  if (!count) return count.error();
  const std::string name = lamps.substr(at + 1);
  auto env = load_environment(name);
  if (!env) return env.error();
  warn(env->warnings);
  bake.lobes = find_lamps(*env, *count);
  const size_t found = bake.lobes.size();
  if (found < size_t(*count))
    warn(name + ": has " + std::to_string(found) + (found == 1 ? " lamp that stands" : " lamps that stand") +
         " out, not " + std::to_string(*count));
  return {};
}

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

int run_bake(Context& context, BakeCommand o) {
  if (o.transfer == "blocks") return run_blocks_bake(context, o.scene, o.blocks, o.bake.memory, o.output);
  auto bounces = parse_bounces(o.bounces);
  if (!bounces) return fail(bounces.error());
  if (o.transfer == "lightmap") {
    // Harmonics of a distant light join the lamps only where they are asked for: then it is a PRT lightmap.
    return run_lightmap(context, {o.scene,
                                  o.receivers,
                                  o.lightmap,
                                  {.order = o.order_given ? o.bake.order : 0,
                                   .samples = o.bake.samples,
                                   .bounces = bounces->count,
                                   .converge = bounces->converge,
                                   .memory = o.bake.memory,
                                   .seed = o.bake.seed},
                                  o.output,
                                  o.precision});
  }
  if (bounces->converge > 0) return fail({"--bounces", "converge:EPS is for --transfer lightmap"});
  o.bake.bounces = bounces->count;
  o.bake.shadows = o.shadows == "on";
  if (!o.bake.shadows) o.bake.bounces = 0;
  o.bake.precision = o.precision == "half" ? Precision::half : Precision::single;
  const bool is_zonal = o.transfer == "zonal", is_matrix = o.transfer == "matrix" || (is_zonal && o.glossy);
  o.matrix.simulate_paths = o.simulate == "paths";
  o.zonal.precision = o.bake.precision;
  if (is_zonal) o.bake.precision = Precision::single;  // it is rounded once, as lobes
  if (auto ok = check_output(o.output, {"glb"}); !ok) return fail(ok.error());
  if (!o.membrane.empty()) return bake_membrane(context, o);
  SubsurfaceOptions subsurface;
  SubsurfaceReport walks;
  if (!o.subsurface.empty()) {
    auto medium = parse_medium(o.subsurface);
    if (!medium) return fail({"--subsurface", medium.error().text()});
    subsurface.medium = *medium;
  }
  if (is_matrix)
    if (auto ok = parse_outgoing(o.outgoing, o.matrix); !ok) return fail(ok.error());
  auto reflection = load_reflection(o.brdf);
  if (!reflection) return fail(reflection.error());
  if (o.light.empty()) o.light = "sh:" + std::to_string(o.bake.order);
  if (auto ok = parse_light(o.light, o.bake); !ok) return fail(ok.error());
  if (o.factors) {
    if (!o.bake.lobes.empty()) return fail({"--light", "--factors multiplies harmonics: leave lobes out"});
    if (o.bake.order + o.matrix.incident_order - 1 > max_sh_order)
      return fail({"--factors", "needs the bands of the light and of incident light, less one, and " +
                                    std::to_string(max_sh_order) + " is all there are"});
  }
  if (is_matrix && o.bake.order == 0)
    return fail({"--light", "directional light cannot be baked with --transfer matrix"});
  if (!o.bake.lobes.empty() && !o.lattice_points.empty())
    return fail({"--light", "lobes do not light free space: leave --lattice out"});
  if (!o.bake.lobes.empty() && o.matrix.simulate_paths && o.bake.bounces > 0)
    return fail({"--light", "lobes do not bounce along --simulate paths: leave it out, or bake with --bounces 0"});
  if (!o.lattice_points.empty() && o.bake.order + o.lattice.order > max_sh_order + 1)
    return fail(
        {"--lattice-order", "and the bands of the light may be " + std::to_string(max_sh_order + 1) + " together"});

  CpcaOptions cpca_options;
  if (!o.compress.empty())
    if (auto ok = parse_cpca(o.compress, cpca_options); !ok) return fail(ok.error());

  auto start = Clock::now();
  auto scene = load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  std::optional<View> fixed;
  if (!o.fix_view.empty()) {
    ViewOptions asked;
    asked.camera = o.fix_view, asked.size = o.size;
    auto made = make_view(asked, *scene);
    if (!made)
      return fail(Error{made.error().where == "--camera" ? "--fix-view" : made.error().where, made.error().message});
    fixed = *made;
    const size_t bytes = 3 * size_t(fixed->width) * size_t(fixed->height) * o.bake.light().count() *
                         (o.bake.precision == Precision::half ? 2 : 4);
    if (bytes >= size_t{1} << 32)
      return fail({"--size", fmt::format("{} pixels of {} columns take {} bytes, and a baked file holds 4 GiB", o.size,
                                         o.bake.light().count(), bytes)});
  }
  auto placed = place_receivers(*scene, o.receivers, "vertices");
  if (!placed) return fail(placed.error());
  Receivers& receivers = placed->receivers;
  const bool at_vertices = std::holds_alternative<CornerReceivers>(receivers.basis);
  if (!o.lattice_points.empty() && !at_vertices) return fail({"--receivers", "--lattice needs a bake at vertices"});
  if ((is_matrix || is_zonal) && !at_vertices)
    return fail({"--receivers", "--transfer " + o.transfer + " is baked at vertices"});
  const double load_seconds = seconds_since(start);

  o.lattice.samples = o.bake.samples, o.lattice.memory = o.bake.memory, o.lattice.seed = o.bake.seed,
  o.lattice.precision = o.bake.precision;
  std::optional<Lattice> lattice;
  if (!o.lattice_points.empty()) {
    auto parsed = parse_lattice(o, *scene);
    if (!parsed) return fail(parsed.error());
    if (auto ok = check_lattice(*parsed, o.bake.order, o.lattice); !ok) return fail(ok.error());
    lattice = *parsed;
  }

  start = Clock::now();
  auto tracer = Tracer::build(*scene);
  if (!tracer) return fail(tracer.error());
  const double build_seconds = seconds_since(start);
  if (placed->atlas) move_buried_texels(*scene, *tracer, *placed->atlas, receivers);

  BakeReport report;
  std::optional<Outgoing> outgoing;
  Result<Transfer> transfer = Error{};
  if (o.factors) {
    // Visibility times cosine is diffuse transfer of direct light, of as many bands as make the product with light
    // exact.
    BakeOptions visibility = o.bake;
    visibility.order = o.bake.order + o.matrix.incident_order - 1, visibility.bounces = 0;
    transfer = bake(*scene, *tracer, receivers, visibility, &report, &context.progress);
    if (!transfer) return fail(transfer.error());
    outgoing =
        make_map_outgoing(make_receiver_materials(*scene, receivers, *reflection), o.matrix.incident_order, o.matrix);
  } else if (is_matrix) {
    auto baked = bake_matrix(*scene, *tracer, receivers, make_receiver_materials(*scene, receivers, *reflection),
                             o.bake, o.matrix, &report, &context.progress);
    if (!baked) return fail(baked.error());
    transfer = std::move(baked->transfer), outgoing = std::move(baked->outgoing);
  } else {
    transfer = o.subsurface.empty()
                 ? bake(*scene, *tracer, receivers, o.bake, &report, &context.progress)
                 : bake_subsurface(*scene, *tracer, receivers, o.bake, subsurface, &report, &walks, &context.progress);
    if (!transfer) return fail(transfer.error());
    warn_of_lost_walks(walks);
  }

  std::optional<LatticeTransfer> free_space;
  LatticeReport lattice_report;
  if (lattice) {
    auto baked = bake_lattice(*scene, *tracer, receivers, *transfer, outgoing ? &*outgoing : nullptr, *lattice,
                              o.lattice, &lattice_report, &context.progress);
    if (!baked) return fail(baked.error());
    free_space = std::move(*baked);
  }

  std::optional<FixedView> view;
  if (fixed) {
    RenderOptions options;
    options.width = fixed->width, options.height = fixed->height, options.samples = o.view_samples,
    options.outgoing = outgoing ? &*outgoing : nullptr;
    auto pixels = fix_view(*scene, *tracer, receivers.basis, *transfer, fixed->camera, options, &context.progress);
    if (!pixels) return fail(pixels.error());
    *transfer = std::move(pixels->transfer), outgoing.reset();
    view = FixedView{fixed->camera, fixed->width, fixed->height, std::move(pixels->coverage)};
    report.bytes = transfer->bytes();
  }
  if (!o.fix_light.empty()) {
    auto env = load_environment(o.fix_light);
    if (!env) return fail(env.error());
    warn(env->warnings);
    *transfer = fix_light(*transfer, project_light(*env, transfer->light).light, env->name);
    report.bytes = transfer->bytes();
  }

  // Of an environment's path the name alone.
  const size_t at = o.light.find('@');
  const std::string light_name =
      at == std::string::npos ? o.light : o.light.substr(0, at + 1) + o.light.substr(o.light.find_last_of("/@") + 1);
  nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options",
       {{"transfer", o.transfer},
        {"light", light_name},
        {"order", o.bake.order},
        {"samples", o.bake.samples},
        {"bounces", o.bake.bounces},
        {"shadows", o.bake.shadows},
        {"ground", o.scene.ground},
        {"max_edge", o.scene.max_edge},
        {"seed", o.bake.seed},
        {"precision", o.precision}}},
      {"report", {{"receivers", report.receivers}, {"buried", report.buried}}}};
  if (is_matrix)
    provenance["options"].update({{"brdf", o.brdf.brdf},
                                  {"outgoing", o.outgoing},
                                  {"incident_order", o.matrix.incident_order},
                                  {"simulate", o.simulate},
                                  {"factors", o.factors}});
  if (!o.fix_light.empty()) provenance["options"]["fix_light"] = o.fix_light;
  if (!o.subsurface.empty()) provenance["options"]["subsurface"] = o.subsurface;
  if (view) provenance["options"].update({{"fix_view", o.fix_view}, {"size", o.size}});
  if (free_space) {
    provenance["options"].update({{"lattice", o.lattice_points}, {"lattice_order", o.lattice.order}});
    provenance["report"]["lattice_invalid"] = lattice_report.invalid;
  }
  if (report.error >= 0) provenance["report"]["error"] = report.error;

  ZonalFitReport fit;
  std::optional<ZonalTransfer> zonal;
  if (is_zonal) {
    if (outgoing) o.zonal.row_weights = row_weights(*outgoing);
    auto fitted = fit_zonal(*transfer, o.zonal, &fit, &context.progress);
    if (!fitted) return fail(fitted.error());
    zonal = std::move(*fitted);
    report.bytes = zonal->bytes();
    provenance["zonal"] = {{"lobes", o.zonal.lobes}, {"rms", fit.rms}};
  }

  std::optional<CpcaTransfer> clusters;
  double cpca_error = 0, cpca_seconds = 0;
  if (!o.compress.empty()) {
    start = Clock::now();
    auto made = compress_cpca(*transfer, cpca_options, &cpca_error, &context.progress);
    if (!made) return fail(made.error());
    clusters = std::move(*made), cpca_seconds = seconds_since(start);
    report.bytes = clusters->bytes();
    provenance["options"]["compress"] = o.compress;
    provenance["report"]["cpca_error"] = cpca_error;
  }

  start = Clock::now();
  const std::string origin = provenance.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const BakedExtras extras{.outgoing = outgoing ? &*outgoing : nullptr,
                           .lattice = free_space ? &*free_space : nullptr,
                           .factors = o.factors,
                           .view = view ? &*view : nullptr,
                           .fit_errors = fit.errors};
  const Receivers of_surfaces = view ? Receivers{} : receivers;
  if (auto ok = zonal    ? save_baked(o.output, *scene, receivers, *zonal, origin, extras)
              : clusters ? save_baked(o.output, *scene, receivers, *clusters, origin, extras)
                         : save_baked(o.output, *scene, of_surfaces, *transfer, origin, extras);
      !ok)
    return fail(ok.error());
  const double save_seconds = seconds_since(start);

  const double bytes_each = double(report.bytes) / double(view ? transfer->receivers : report.receivers);
  if (context.json) {
    nlohmann::json result{
        {"output", o.output},
        {"receivers", report.receivers},
        {"buried", report.buried},
        {"vertices", scene->positions.size()},
        {"triangles", scene->triangles.size()},
        {"rays", report.rays},
        {"order", transfer->light.order},
        {"lobes", transfer->light.lobes.size()},
        {"channels", transfer->channels},
        {"rows", transfer->rows},
        {"seconds",
         {{"load", load_seconds},
          {"build", build_seconds},
          {"trace", report.trace_seconds},
          {"bounce", report.bounce_seconds},
          {"save", save_seconds}}},
        {"rays_per_second", report.trace_seconds > 0 ? double(report.rays) / report.trace_seconds : 0.0},
        {"bytes", report.bytes},
        {"bytes_per_receiver", bytes_each},
        {"operator_bytes", report.operator_bytes},
        {"operator_kept", report.operator_kept},
        {"working_memory", report.working_memory}};
    if (zonal) result["zonal"] = {{"lobes", zonal->lobes}, {"rms", fit.rms}, {"seconds", fit.seconds}};
    if (clusters)
      result["cpca"] = {
          {"clusters", clusters->clusters}, {"rank", clusters->rank}, {"error", cpca_error}, {"seconds", cpca_seconds}};
    if (!o.subsurface.empty()) result["subsurface"] = {{"events", walks.events}, {"lost", walks.lost}};
    if (view) result["pixels"] = transfer->receivers;
    result["error"] = report.error >= 0 ? nlohmann::json(report.error) : nlohmann::json();
    if (free_space)
      result["lattice"] = {{"points", lattice_report.points},
                           {"invalid", lattice_report.invalid},
                           {"rays", lattice_report.rays},
                           {"seconds", lattice_report.seconds},
                           {"bytes", lattice_report.bytes}};
    print_json(result);
    return success;
  }
  fmt::print("{}\n", o.output);
  fmt::print("  receivers  {} ({} vertices, {} triangles{})\n", human_count(report.receivers),
             human_count(scene->positions.size()), human_count(scene->triangles.size()),
             report.buried ? "; " + human_count(report.buried) + " buried, filled from neighbours" : "");
  fmt::print("  rays       {} ({:.1f} million a second)\n", human_count(report.rays),
             report.trace_seconds > 0 ? double(report.rays) / report.trace_seconds / 1e6 : 0.0);
  fmt::print("  time       load {}, build {}, trace {}, bounce {}, save {}\n", human_seconds(load_seconds),
             human_seconds(build_seconds), human_seconds(report.trace_seconds), human_seconds(report.bounce_seconds),
             human_seconds(save_seconds));
  fmt::print("  size       {} a {}, {} in all ({}, {} row{}, {} channel{}, {})\n", human_bytes(bytes_each),
             view ? "pixel" : "receiver", human_bytes(double(report.bytes)), describe_light(transfer->light),
             transfer->rows, transfer->rows == 1 ? "" : "s", transfer->channels, transfer->channels == 1 ? "" : "s",
             o.precision);
  if (zonal)
    fmt::print("  lobes      {}, fitted in {}, with an error of {:.2f}% RMS\n", zonal->lobes,
               human_seconds(fit.seconds), 100 * fit.rms);
  if (clusters)
    fmt::print("  clusters   {} of rank {}, found in {}, with an error of {:.2f}% RMS\n", clusters->clusters,
               clusters->rank, human_seconds(cpca_seconds), 100 * cpca_error);
  if (!o.subsurface.empty()) fmt::print("  medium     {:.1f} events a walk\n", walks.events);
  if (free_space)
    fmt::print("  lattice    {} points, order {}, {} in {}{}\n", human_count(lattice_report.points), o.lattice.order,
               human_bytes(double(lattice_report.bytes)), human_seconds(lattice_report.seconds),
               lattice_report.invalid
                   ? "; " + human_count(lattice_report.invalid) + " inside something, filled from neighbours"
                   : "");
  if (report.operator_kept < 1)
    fmt::print("  memory     {:.0f}% of the gather operator fitted; the rest was traced again for each bounce\n",
               100 * report.operator_kept);
  if (report.error >= 0)
    fmt::print("  error      {:.2f}% RMS, estimated from half-sample gathers\n", 100 * report.error);
  return success;
}

}  // namespace

void add_bake(CLI::App& app, Run& run) {
  auto o = std::make_shared<BakeCommand>();
  CLI::App* c = app.add_subcommand("bake", "Bake a scene's light transport");
  o->scene.add_to(*c);
  c->add_option("-o,--output", o->output, "Baked file to write (.glb)")->required();
  c->add_option(
       "--transfer", o->transfer,
       "What is stored: diffuse, a vector a receiver for distant light; matrix, incident light in every direction, "
       "for glossy materials; zonal, lobes, for what moves, glossy too with --brdf or --outgoing; lightmap, the light "
       "of the scene's own lamps; "
       "blocks, visibility for sharp shadows and highlights, with materials chosen when it is drawn")
      ->check(CLI::IsMember({"diffuse", "matrix", "zonal", "lightmap", "blocks"}))
      ->capture_default_str();
  auto* order = c->add_option("--order", o->bake.order, "Bands of the lighting's spherical harmonics")
                    ->check(CLI::Range(1, max_sh_order))
                    ->capture_default_str();
  auto* light =
      c->add_option("--light", o->light, std::string("What light is made of, in place of --order: ") + light_syntax);
  auto* lobes = c->add_option("--lobes", o->zonal.lobes, "zonal: lobes a receiver")
                    ->check(CLI::Range(1, max_stored_lobes))
                    ->capture_default_str();
  auto* incident = c->add_option("--incident-order", o->matrix.incident_order, "matrix: bands of incident light")
                       ->check(CLI::Range(1, max_incident_order))
                       ->capture_default_str();
  auto* last =
      c->add_option("--outgoing", o->outgoing,
                    "matrix: rows for the last reflection: map, phong, svd:ROWS, sh:BANDS, hemisphere:BANDS, hsh:BANDS")
          ->capture_default_str();
  auto* grid =
      c->add_option("--view-map", o->matrix.grid,
                    "matrix: nodes a side of the maps that the last reflection is looked up in by view, map and svd")
          ->check(CLI::Range(8, 256))
          ->capture_default_str();
  auto* membrane =
      c->add_option("--membrane", o->membrane,
                    "No simulation: thin sheets that let this share of the light through, 0 to 1, or a picture of it");
  auto* subsurface = c->add_option("--subsurface", o->subsurface, subsurface_help);
  auto* simulate =
      c->add_option("--simulate", o->simulate,
                    "matrix: bounces by the recursion over receivers, or by paths (caustics, coarse meshes; noisier)")
          ->check(CLI::IsMember({"recursion", "paths"}))
          ->capture_default_str();
  auto* factors =
      c->add_flag("--factors", o->factors,
                  "matrix: keep visibility, light and BRDF as factors; direct light alone, a tenth of the size");
  o->brdf.brdf = "materials";
  auto* brdf = o->brdf.add_to(*c);
  auto* fixed = c->add_option("--fix-light", o->fix_light,
                              "Bake this environment in, so that only its brightness is left: a surface light field");
  auto* view = c->add_option("--fix-view", o->fix_view,
                             "EYE,TARGET,FOV or auto: bake this camera in, one row a pixel: image relighting");
  c->add_option("--size", o->size, "--fix-view: WIDTHxHEIGHT in pixels")->needs(view)->capture_default_str();
  c->add_option("--spp", o->view_samples, "--fix-view: rays a pixel")
      ->needs(view)
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  auto* compress =
      c->add_option("--compress", o->compress, "cpca:CLUSTERS,RANK: store clusters, and a few weights a receiver");
  c->add_option("--samples", o->bake.samples, "Rays a receiver")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  auto* bounces =
      c->add_option(
           "--bounces", o->bounces,
           "Reflections between surfaces, 0 to 64; lightmaps also converge:EPS, as many as leave that residual")
          ->capture_default_str();
  c->add_option("--shadows", o->shadows, "off: open light everywhere, no shadows and no bounces")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str();
  c->add_option("--memory", o->bake.memory, "Working memory beyond scene and result; e.g. 500MB, 2GiB")
      ->transform(CLI::AsSizeValue(false))
      ->default_str("4GiB");
  c->add_option("--seed", o->bake.seed, "Of the ray directions")->capture_default_str();
  c->add_option("--precision", o->precision, "Of the stored transfer")
      ->check(CLI::IsMember({"half", "single"}))
      ->capture_default_str();
  o->receivers.add_to(*c);
  o->lightmap.add_to(*c);
  const std::vector<CLI::Option*> blocks = o->blocks.add_to(*c);
  auto* points = c->add_option("--lattice", o->lattice_points,
                               "NX,NY,NZ: also bake light in free space at so many points, for `render --insert`");
  auto* box =
      c->add_option("--lattice-box", o->lattice_box, "X0,Y0,Z0,X1,Y1,Z1: where, if not throughout the scene's box");
  auto* lattice_order = c->add_option("--lattice-order", o->lattice.order, "Bands of the light that arrives there")
                            ->check(CLI::Range(1, max_sh_order))
                            ->capture_default_str();
  c->callback([o, grid, bounces, order, light, lobes, membrane, subsurface, fixed, view, compress, factors, incident,
               last, brdf, simulate, points, box, lattice_order, blocks, &run] {
    o->order_given = order->count() > 0;
    if (order->count() && light->count())
      throw CLI::ValidationError("--order and --light both say how many bands there are: give one");
    if (light->count() && (membrane->count() || (o->transfer != "diffuse" && o->transfer != "matrix")))
      throw CLI::ValidationError("--light is for diffuse and matrix transfer; others take harmonics alone, by --order");
    if (o->shadows == "off" && bounces->count() && o->bounces != "0")
      throw CLI::ValidationError("--shadows off has no bounces: leave --bounces out, or set it to 0");
    if (membrane->count() && o->transfer != "diffuse")
      throw CLI::ValidationError("--membrane is a transfer of its own: leave --transfer out");
    if (subsurface->count() &&
        (membrane->count() || points->count() || (o->transfer != "diffuse" && o->transfer != "zonal")))
      throw CLI::ValidationError("--subsurface is for diffuse and zonal transfer on surfaces");
    if (subsurface->count() && o->shadows == "off")
      throw CLI::ValidationError("--subsurface is always baked with shadows");
    if (fixed->count() && (membrane->count() || o->transfer == "zonal"))
      throw CLI::ValidationError("--fix-light leaves nothing to turn: it is for diffuse and matrix transfer");
    for (const CLI::Option* option : {view, compress})
      if (option->count() && (membrane->count() || (o->transfer != "diffuse" && o->transfer != "matrix")))
        throw CLI::ValidationError(option->get_name() + " is for diffuse and matrix transfer");
    if (view->count() && compress->count())
      throw CLI::ValidationError(
          "--compress makes clusters of receivers on surfaces, and --fix-view has pixels: give one");
    if (view->count() && points->count())
      throw CLI::ValidationError("--fix-view leaves no room for what --lattice would light: give one");
    if (lobes->count() && o->transfer != "zonal") throw CLI::ValidationError("--lobes needs --transfer zonal");
    if (factors->count()) {
      if (bounces->count() && o->bounces != "0")
        throw CLI::ValidationError("--factors is direct light: leave --bounces out, or set it to 0");
      if (o->outgoing != "map")
        throw CLI::ValidationError("--factors keeps incident light: leave --outgoing out, or set it to map");
      for (const CLI::Option* option : {fixed, view, compress, points, simulate})
        if (option->count()) throw CLI::ValidationError("--factors does not go with " + option->get_name());
      o->bounces = "0";
    }
    // Lobes of a matrix's rows, where a last reflection is asked for.
    o->glossy = o->transfer == "zonal" && (last->count() || brdf->count());
    for (const CLI::Option* option : {factors, incident, last, brdf, simulate, grid})
      if (option->count() && o->transfer != "matrix" && !(o->glossy && option != factors))
        throw CLI::ValidationError(option->get_name() + (o->transfer == "zonal" && option != factors
                                                             ? " needs --transfer matrix, or --outgoing or --brdf"
                                                             : " needs --transfer matrix"));
    if (subsurface->count() && o->glossy)
      throw CLI::ValidationError("--subsurface is for diffuse and zonal transfer on surfaces");
    for (const CLI::Option* option : blocks)
      if (option->count() && o->transfer != "blocks")
        throw CLI::ValidationError(option->get_name() + " needs --transfer blocks");
    for (const CLI::Option* option : {order, light, membrane, fixed, view, compress, points, bounces})
      if (option->count() && o->transfer == "blocks")
        throw CLI::ValidationError(option->get_name() +
                                   " is not for --transfer blocks: it stores what is seen, and no light");
    if (o->transfer == "blocks" &&
        (o->shadows == "off" || (!o->receivers.kind.empty() && o->receivers.kind != "vertices")))
      throw CLI::ValidationError("--transfer blocks is baked at vertices, with shadows");
    if ((o->transfer == "matrix" || o->glossy) && o->shadows == "off")
      throw CLI::ValidationError("glossy transfer is always baked with shadows");
    for (const CLI::Option* option : {box, lattice_order})
      if (option->count() && !points->count()) throw CLI::ValidationError(option->get_name() + " needs --lattice");
    if (points->count() && o->shadows == "off") throw CLI::ValidationError("--lattice is always baked with shadows");
    if (points->count() &&
        (membrane->count() || fixed->count() || (o->transfer != "diffuse" && o->transfer != "matrix")))
      throw CLI::ValidationError("--lattice goes with diffuse and matrix transfer, under any distant light");
    run = [o](Context& context) { return run_bake(context, *o); };
  });
}

}  // namespace lambent::tool

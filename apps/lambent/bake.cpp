#include "commands.h"
#include "options.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/materials.h>
#include <lambent/baked/baked_file.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent::tool {
namespace {

struct BakeCommand {
  SceneOptions scene;
  BakeOptions bake;
  MatrixOptions matrix;
  BrdfOptions brdf;
  LatticeOptions lattice;
  std::string lattice_points, lattice_box;
  std::string transfer = "diffuse", outgoing = "svd:6", simulate = "recursion", output, shadows = "on", precision = "half";
};

// KIND or KIND:N, where N is the number of rows (svd) or bands (sh, hemisphere, hsh).
Result<void> parse_outgoing(const std::string& text, MatrixOptions& matrix) {
  const size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const auto kind = std::find(std::begin(outgoing_names), std::end(outgoing_names), name);
  if (kind == std::end(outgoing_names)) return Error{"--outgoing", "must be map, svd:ROWS, sh:BANDS, hemisphere:BANDS or hsh:BANDS, not \"" + text + "\""};
  matrix.outgoing = OutgoingKind(kind - std::begin(outgoing_names));
  if (colon == std::string::npos) return {};
  if (matrix.outgoing == OutgoingKind::map) return Error{"--outgoing", "map takes no number: --incident-order says how many rows it has"};
  auto number = parse_numbers(text.substr(colon + 1), 1, "--outgoing");
  if (!number) return number.error();
  const float n = (*number)[0];
  if (n != std::floor(n) || n < 1 || n > 64) return Error{"--outgoing", "expects a whole number from 1 to 64 after the colon, not \"" + text + "\""};
  (matrix.outgoing == OutgoingKind::svd ? matrix.svd_rows : matrix.outgoing_order) = int(n);
  return {};
}

Result<Lattice> parse_lattice(const BakeCommand& o, const Scene& scene) {
  auto counts = parse_numbers(o.lattice_points, 3, "--lattice");
  if (!counts) return counts.error();
  for (float n : *counts)
    if (n != std::floor(n) || n < 1 || n > float(max_lattice_points))
      return Error{"--lattice", "expects three whole numbers from 1 to " + std::to_string(max_lattice_points) + ", not \"" + o.lattice_points + "\""};
  Bounds box = default_lattice_box(scene);
  if (!o.lattice_box.empty()) {
    auto b = parse_numbers(o.lattice_box, 6, "--lattice-box");
    if (!b) return b.error();
    box = {{(*b)[0], (*b)[1], (*b)[2]}, {(*b)[3], (*b)[4], (*b)[5]}};
    if (glm::any(glm::greaterThan(box.min, box.max))) return Error{"--lattice-box", "expects the lower corner first, then the upper"};
    if (glm::any(glm::greaterThan(glm::max(glm::abs(box.min), glm::abs(box.max)), Vec3(1e9f)))) return Error{"--lattice-box", "lies beyond 1e9"};
  }
  return Lattice{box.min, box.max, int((*counts)[0]), int((*counts)[1]), int((*counts)[2])};
}

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

int run_bake(Context& context, BakeCommand o) {
  o.bake.shadows = o.shadows == "on";
  if (!o.bake.shadows) o.bake.bounces = 0;
  o.bake.precision = o.precision == "half" ? Precision::half : Precision::single;
  const bool is_matrix = o.transfer == "matrix";
  o.matrix.simulate_paths = o.simulate == "paths";
  if (auto ok = check_output(o.output, {"glb"}); !ok) return fail(ok.error());
  if (is_matrix)
    if (auto ok = parse_outgoing(o.outgoing, o.matrix); !ok) return fail(ok.error());
  auto reflection = load_reflection(o.brdf);
  if (!reflection) return fail(reflection.error());

  auto start = Clock::now();
  auto scene = load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  const double load_seconds = seconds_since(start);

  o.lattice.samples = o.bake.samples, o.lattice.memory = o.bake.memory, o.lattice.seed = o.bake.seed, o.lattice.precision = o.bake.precision;
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
  const Receivers receivers = make_vertex_receivers(*scene);
  const double build_seconds = seconds_since(start);

  BakeReport report;
  std::optional<Outgoing> outgoing;
  Result<Transfer> transfer = Error{};
  if (is_matrix) {
    auto baked = bake_matrix(*scene, *tracer, receivers, make_receiver_materials(*scene, receivers, *reflection), o.bake, o.matrix, &report,
                             &context.progress);
    if (!baked) return fail(baked.error());
    transfer = std::move(baked->transfer), outgoing = std::move(baked->outgoing);
  } else {
    transfer = bake(*scene, *tracer, receivers, o.bake, &report, &context.progress);
    if (!transfer) return fail(transfer.error());
  }

  std::optional<LatticeTransfer> free_space;
  LatticeReport lattice_report;
  if (lattice) {
    auto baked = bake_lattice(*scene, *tracer, receivers, *transfer, outgoing ? &*outgoing : nullptr, *lattice, o.lattice, &lattice_report, &context.progress);
    if (!baked) return fail(baked.error());
    free_space = std::move(*baked);
  }

  nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options",
       {{"transfer", o.transfer}, {"order", o.bake.order}, {"samples", o.bake.samples}, {"bounces", o.bake.bounces}, {"shadows", o.bake.shadows},
        {"ground", o.scene.ground}, {"max_edge", o.scene.max_edge}, {"seed", o.bake.seed}, {"precision", o.precision}}},
      {"report", {{"receivers", report.receivers}, {"buried", report.buried}}}};
  if (is_matrix)
    provenance["options"].update({{"brdf", o.brdf.brdf}, {"outgoing", o.outgoing}, {"incident_order", o.matrix.incident_order}, {"simulate", o.simulate}});
  if (free_space) {
    provenance["options"].update({{"lattice", o.lattice_points}, {"lattice_order", o.lattice.order}});
    provenance["report"]["lattice_invalid"] = lattice_report.invalid;
  }
  if (report.error >= 0) provenance["report"]["error"] = report.error;

  start = Clock::now();
  if (auto ok = save_baked(o.output, *scene, receivers, *transfer, provenance.dump(), outgoing ? &*outgoing : nullptr,
                           free_space ? &*free_space : nullptr);
      !ok)
    return fail(ok.error());
  const double save_seconds = seconds_since(start);

  const double bytes_each = double(report.bytes) / double(report.receivers);
  if (context.json) {
    nlohmann::json result{{"output", o.output},
                          {"receivers", report.receivers},
                          {"buried", report.buried},
                          {"vertices", scene->positions.size()},
                          {"triangles", scene->triangles.size()},
                          {"rays", report.rays},
                          {"channels", transfer->channels},
                          {"rows", transfer->rows},
                          {"seconds", {{"load", load_seconds}, {"build", build_seconds}, {"trace", report.trace_seconds},
                                       {"bounce", report.bounce_seconds}, {"save", save_seconds}}},
                          {"rays_per_second", report.trace_seconds > 0 ? double(report.rays) / report.trace_seconds : 0.0},
                          {"bytes", report.bytes},
                          {"bytes_per_receiver", bytes_each},
                          {"operator_bytes", report.operator_bytes},
                          {"operator_kept", report.operator_kept},
                          {"working_memory", report.working_memory}};
    result["error"] = report.error >= 0 ? nlohmann::json(report.error) : nlohmann::json();
    if (free_space)
      result["lattice"] = {{"points", lattice_report.points}, {"invalid", lattice_report.invalid}, {"rays", lattice_report.rays},
                           {"seconds", lattice_report.seconds}, {"bytes", lattice_report.bytes}};
    print_json(result);
    return success;
  }
  fmt::print("{}\n", o.output);
  fmt::print("  receivers  {} ({} vertices, {} triangles{})\n", human_count(report.receivers), human_count(scene->positions.size()),
             human_count(scene->triangles.size()), report.buried ? "; " + human_count(report.buried) + " buried, filled from neighbours" : "");
  fmt::print("  rays       {} ({:.1f} million a second)\n", human_count(report.rays),
             report.trace_seconds > 0 ? double(report.rays) / report.trace_seconds / 1e6 : 0.0);
  fmt::print("  time       load {}, build {}, trace {}, bounce {}, save {}\n", human_seconds(load_seconds), human_seconds(build_seconds),
             human_seconds(report.trace_seconds), human_seconds(report.bounce_seconds), human_seconds(save_seconds));
  fmt::print("  size       {} a receiver, {} in all (order {}, {} row{}, {} channel{}, {})\n", human_bytes(bytes_each), human_bytes(double(report.bytes)),
             transfer->light.order, transfer->rows, transfer->rows == 1 ? "" : "s", transfer->channels, transfer->channels == 1 ? "" : "s", o.precision);
  if (free_space)
    fmt::print("  lattice    {} points, order {}, {} in {}{}\n", human_count(lattice_report.points), o.lattice.order, human_bytes(double(lattice_report.bytes)),
               human_seconds(lattice_report.seconds),
               lattice_report.invalid ? "; " + human_count(lattice_report.invalid) + " inside something, filled from neighbours" : "");
  if (report.operator_kept < 1)
    fmt::print("  memory     {:.0f}% of the gather operator fitted; the rest was traced again for each bounce\n", 100 * report.operator_kept);
  if (report.error >= 0) fmt::print("  error      {:.2f}% RMS, estimated from half-sample gathers\n", 100 * report.error);
  return success;
}

}  // namespace

void add_bake(CLI::App& app, Run& run) {
  auto o = std::make_shared<BakeCommand>();
  CLI::App* c = app.add_subcommand("bake", "Bake a scene's light transport");
  o->scene.add_to(*c);
  c->add_option("-o,--output", o->output, "Baked file to write (.glb)")->required();
  c->add_option("--order", o->bake.order, "Bands of the lighting's spherical harmonics")->check(CLI::Range(1, max_sh_order))->capture_default_str();
  c->add_option("--transfer", o->transfer, "diffuse: a vector a receiver; matrix: incident light in every direction, for glossy materials")
      ->check(CLI::IsMember({"diffuse", "matrix"}))->capture_default_str();
  auto* incident = c->add_option("--incident-order", o->matrix.incident_order, "matrix: bands of incident light")
                       ->check(CLI::Range(1, max_incident_order))->capture_default_str();
  auto* last = c->add_option("--outgoing", o->outgoing, "matrix: rows for the last reflection: map, svd:ROWS, sh:BANDS, hemisphere:BANDS, hsh:BANDS")
                   ->capture_default_str();
  auto* simulate = c->add_option("--simulate", o->simulate, "matrix: bounces by the recursion over receivers, or by paths (caustics, coarse meshes; noisier)")
                       ->check(CLI::IsMember({"recursion", "paths"}))->capture_default_str();
  o->brdf.brdf = "materials";
  auto* brdf = o->brdf.add_to(*c);
  c->add_option("--samples", o->bake.samples, "Rays a receiver")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  auto* bounces = c->add_option("--bounces", o->bake.bounces, "Reflections between surfaces")->check(CLI::Range(0, 64))->capture_default_str();
  c->add_option("--shadows", o->shadows, "off: open light everywhere, no shadows and no bounces")->check(CLI::IsMember({"on", "off"}))->capture_default_str();
  c->add_option("--memory", o->bake.memory, "Working memory beyond scene and result; e.g. 500MB, 2GiB")
      ->transform(CLI::AsSizeValue(false))->default_str("4GiB");
  c->add_option("--seed", o->bake.seed, "Of the ray directions")->capture_default_str();
  c->add_option("--precision", o->precision, "Of the stored transfer")->check(CLI::IsMember({"half", "single"}))->capture_default_str();
  auto* points = c->add_option("--lattice", o->lattice_points, "NX,NY,NZ: also bake light in free space at so many points, for `render --insert`");
  auto* box = c->add_option("--lattice-box", o->lattice_box, "X0,Y0,Z0,X1,Y1,Z1: where, if not throughout the scene's box");
  auto* lattice_order = c->add_option("--lattice-order", o->lattice.order, "Bands of the light that arrives there")
                            ->check(CLI::Range(1, max_sh_order))->capture_default_str();
  c->callback([o, bounces, incident, last, brdf, simulate, points, box, lattice_order, &run] {
    if (o->shadows == "off" && bounces->count() && o->bake.bounces > 0)
      throw CLI::ValidationError("--shadows off has no bounces: leave --bounces out, or set it to 0");
    for (const CLI::Option* option : {incident, last, brdf, simulate})
      if (option->count() && o->transfer != "matrix") throw CLI::ValidationError(option->get_name() + " needs --transfer matrix");
    if (o->transfer == "matrix" && o->shadows == "off") throw CLI::ValidationError("--transfer matrix is always baked with shadows");
    for (const CLI::Option* option : {box, lattice_order})
      if (option->count() && !points->count()) throw CLI::ValidationError(option->get_name() + " needs --lattice");
    if (points->count() && o->shadows == "off") throw CLI::ValidationError("--lattice is always baked with shadows");
    if (points->count() && o->bake.order + o->lattice.order > max_sh_order + 1)
      throw CLI::ValidationError("--order and --lattice-order may be " + std::to_string(max_sh_order + 1) + " together");
    run = [o](Context& context) { return run_bake(context, *o); };
  });
}

}  // namespace lambent::tool

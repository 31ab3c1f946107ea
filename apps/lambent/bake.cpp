#include "commands.h"
#include "options.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/materials.h>
#include <lambent/baked/baked_file.h>
#include <lambent/light/lamps.h>

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
  std::string light, transfer = "diffuse", outgoing = "svd:6", output, shadows = "on", precision = "half";
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

constexpr int max_lamps = 64, max_directional = 256;
constexpr const char* light_syntax = "sh:BANDS, sh:BANDS+lamps:COUNT@ENV, or directional:COUNT";

Result<int> parse_whole(const std::string& text, int least, int most, const std::string& what) {
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || value < least || value > most)
    return Error{"--light", what + " must be a whole number from " + std::to_string(least) + " to " + std::to_string(most) + ", not \"" + text + "\""};
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
  if (!text.starts_with("sh:")) return Error{"--light", "must be " + std::string(light_syntax) + ", not \"" + text + "\""};
  const size_t plus = text.find('+');
  auto order = parse_whole(text.substr(3, plus == std::string::npos ? plus : plus - 3), 1, max_sh_order, "the bands after sh:");
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
  if (found < size_t(*count)) warn(name + ": has " + std::to_string(found) + (found == 1 ? " lamp" : " lamps") + " that stand out, not " + std::to_string(*count));
  return {};
}

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

int run_bake(Context& context, BakeCommand o) {
  o.bake.shadows = o.shadows == "on";
  if (!o.bake.shadows) o.bake.bounces = 0;
  o.bake.precision = o.precision == "half" ? Precision::half : Precision::single;
  const bool is_matrix = o.transfer == "matrix";
  if (auto ok = check_output(o.output, {"glb"}); !ok) return fail(ok.error());
  if (is_matrix)
    if (auto ok = parse_outgoing(o.outgoing, o.matrix); !ok) return fail(ok.error());
  auto reflection = load_reflection(o.brdf);
  if (!reflection) return fail(reflection.error());
  if (o.light.empty()) o.light = "sh:" + std::to_string(o.bake.order);
  if (auto ok = parse_light(o.light, o.bake); !ok) return fail(ok.error());
  if (is_matrix && o.bake.order == 0) return fail(Error{"--light", "directional light cannot be baked with --transfer matrix"});

  auto start = Clock::now();
  auto scene = load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  const double load_seconds = seconds_since(start);

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

  // Of an environment's path the name alone.
  const size_t at = o.light.find('@');
  const std::string light_name = at == std::string::npos ? o.light : o.light.substr(0, at + 1) + o.light.substr(o.light.find_last_of("/@") + 1);
  nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options",
       {{"transfer", o.transfer}, {"light", light_name}, {"order", o.bake.order}, {"samples", o.bake.samples}, {"bounces", o.bake.bounces}, {"shadows", o.bake.shadows},
        {"ground", o.scene.ground}, {"max_edge", o.scene.max_edge}, {"seed", o.bake.seed}, {"precision", o.precision}}},
      {"report", {{"receivers", report.receivers}, {"buried", report.buried}}}};
  if (is_matrix)
    provenance["options"].update({{"brdf", o.brdf.brdf}, {"outgoing", o.outgoing}, {"incident_order", o.matrix.incident_order}});
  if (report.error >= 0) provenance["report"]["error"] = report.error;

  start = Clock::now();
  const std::string origin = provenance.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (auto ok = save_baked(o.output, *scene, receivers, *transfer, origin, outgoing ? &*outgoing : nullptr); !ok) return fail(ok.error());
  const double save_seconds = seconds_since(start);

  const double bytes_each = double(report.bytes) / double(report.receivers);
  if (context.json) {
    nlohmann::json result{{"output", o.output},
                          {"receivers", report.receivers},
                          {"buried", report.buried},
                          {"vertices", scene->positions.size()},
                          {"triangles", scene->triangles.size()},
                          {"rays", report.rays},
                          {"order", transfer->light.order},
                          {"lobes", transfer->light.lobes.size()},
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
  fmt::print("  size       {} a receiver, {} in all ({}, {} row{}, {} channel{}, {})\n", human_bytes(bytes_each), human_bytes(double(report.bytes)),
             describe_light(transfer->light), transfer->rows, transfer->rows == 1 ? "" : "s", transfer->channels, transfer->channels == 1 ? "" : "s", o.precision);
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
  auto* order = c->add_option("--order", o->bake.order, "Bands of the lighting's spherical harmonics")->check(CLI::Range(1, max_sh_order))->capture_default_str();
  c->add_option("--light", o->light, std::string("What light is made of, in place of --order: ") + light_syntax);
  c->add_option("--transfer", o->transfer, "diffuse: a vector a receiver; matrix: incident light in every direction, for glossy materials")
      ->check(CLI::IsMember({"diffuse", "matrix"}))->capture_default_str();
  auto* incident = c->add_option("--incident-order", o->matrix.incident_order, "matrix: bands of incident light")
                       ->check(CLI::Range(1, max_incident_order))->capture_default_str();
  auto* last = c->add_option("--outgoing", o->outgoing, "matrix: rows for the last reflection: map, svd:ROWS, sh:BANDS, hemisphere:BANDS, hsh:BANDS")
                   ->capture_default_str();
  o->brdf.brdf = "materials";
  auto* brdf = o->brdf.add_to(*c);
  c->add_option("--samples", o->bake.samples, "Rays a receiver")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  auto* bounces = c->add_option("--bounces", o->bake.bounces, "Reflections between surfaces")->check(CLI::Range(0, 64))->capture_default_str();
  c->add_option("--shadows", o->shadows, "off: open light everywhere, no shadows and no bounces")->check(CLI::IsMember({"on", "off"}))->capture_default_str();
  c->add_option("--memory", o->bake.memory, "Working memory beyond scene and result; e.g. 500MB, 2GiB")
      ->transform(CLI::AsSizeValue(false))->default_str("4GiB");
  c->add_option("--seed", o->bake.seed, "Of the ray directions")->capture_default_str();
  c->add_option("--precision", o->precision, "Of the stored transfer")->check(CLI::IsMember({"half", "single"}))->capture_default_str();
  c->callback([o, order, bounces, incident, last, brdf, &run] {
    if (order->count() && !o->light.empty()) throw CLI::ValidationError("--order and --light both say how many bands there are: give one");
    if (o->shadows == "off" && bounces->count() && o->bake.bounces > 0)
      throw CLI::ValidationError("--shadows off has no bounces: leave --bounces out, or set it to 0");
    for (const CLI::Option* option : {incident, last, brdf})
      if (option->count() && o->transfer != "matrix") throw CLI::ValidationError(option->get_name() + " needs --transfer matrix");
    if (o->transfer == "matrix" && o->shadows == "off") throw CLI::ValidationError("--transfer matrix is always baked with shadows");
    run = [o](Context& context) { return run_bake(context, *o); };
  });
}

}  // namespace lambent::tool

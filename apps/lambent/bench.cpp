// `lambent bench solvers`: the same radiosity system by every solver, residual against applications of the operator.
#include "bake_lightmap.h"
#include "commands.h"

#include <lambent/bake/kernels.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent::tool {
namespace {

struct SolversCommand {
  SceneOptions scene;
  ReceiverFlags receivers;
  std::string sky;
  int samples = 1024, lamp_samples = 64, most = 200;
  double tolerance = 1e-3, fine = 1e-6;
  uint64_t memory = uint64_t{4} << 30;
  uint32_t seed = 1;
};

// A closed room of albedo 0.8 with a block and a small lamp: light stays long, so solvers differ.
Scene make_closed_room() {
  Scene scene;
  const uint32_t wall = add_material(scene, "wall", Vec3(0.8f)), lamp = add_material(scene, "lamp", Vec3(0.8f));
  scene.materials[lamp].emissive = Vec3(10);
  add_box(scene, wall, "room", Vec3(-2, -1, -3), Vec3(2, 1, 3), 24, true);
  add_box(scene, wall, "block", Vec3(-1, -1, -1), Vec3(0.2f, 0.3f, 0.5f), 12);
  add_quad(scene, lamp, "lamp", Vec3(-0.5f, 0.999f, -0.5f), Vec3(1, 0, 0), Vec3(0, 0, 1), 4, 4);
  return scene;
}

// Applications until the residual is at most this; none if it never is.
std::optional<double> applications_to(const SolveReport& report, double tolerance) {
  for (const SolveStep& s : report.steps)
    if (s.residual <= tolerance) return s.applications;
  return std::nullopt;
}

int run_solvers(Context& context, const SolversCommand& o) {
  Result<Scene> scene = o.scene.path.empty() ? make_closed_room() : load_prepared_scene(o.scene);
  if (!scene) return fail(scene.error());
  std::optional<Environment> sky;
  if (!o.sky.empty()) {
    auto env = load_environment(o.sky);
    if (!env) return fail(env.error());
    warn(env->warnings);
    sky = std::move(*env);
  }
  const Lamps lamps = make_lamps(*scene, sky ? &*sky : nullptr, false);
  if (lamps.groups() == 0) return fail({scene->path, "nothing gives light: no emissive material, no lamp, no sky"});
  auto placed = place_receivers(*scene, o.receivers, "vertices");
  if (!placed) return fail(placed.error());
  const Receivers& receivers = placed->receivers;
  if (receivers.count() == 0) return fail({scene->path, "nothing to bake: no triangle has an area"});
  auto tracer = Tracer::build(*scene);
  if (!tracer) return fail(tracer.error());

  const GatherSetup setup = make_gather_setup(*scene, *tracer, receivers, 1, o.samples, o.seed);
  const size_t width = pad_lanes(3 * lamps.groups());
  AlignedVector<float> e(receivers.count() * width, 0.0f);
  const GatherDirect direct{lamps, o.lamp_samples, e.data(), width};
  auto op = GatherOperator::trace(setup, &direct, nullptr, true, o.memory, &context.progress);
  if (!op) return fail(op.error());

  nlohmann::json all = nlohmann::json::array();
  std::string table = fmt::format("{:14}{:>16}{:>10}{:>16}\n", "solver", fmt::format("to {:g}", o.tolerance), "seconds",
                                  fmt::format("to {:g}", o.fine));
  for (const auto& [name, solver] : solver_names) {
    SolveReport report, fine;
    const auto start = std::chrono::steady_clock::now();
    if (auto x = solve(*op, e.data(), width, {solver, o.tolerance, o.most}, &report, &context.progress); !x)
      return fail(x.error());
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (auto x = solve(*op, e.data(), width, {solver, o.fine, o.most}, &fine, &context.progress); !x)
      return fail(x.error());
    const auto coarse_count = applications_to(report, o.tolerance), fine_count = applications_to(fine, o.fine);
    nlohmann::json one = convergence(fine);
    one["solver"] = name, one["converged"] = report.converged, one["seconds"] = seconds;
    one["applications"] = coarse_count ? nlohmann::json(*coarse_count) : nlohmann::json();
    all.push_back(one);
    auto shown = [](const std::optional<double>& n) {
      return n ? fmt::format("{:.1f}", *n) : std::string("not reached");
    };
    table += fmt::format("{:14}{:>16}{:>10.3f}{:>16}\n", name, shown(coarse_count), seconds, shown(fine_count));
  }
  if (context.json)
    print_json({{"scene", o.scene.path.empty() ? "closed room" : o.scene.path},
                {"receivers", receivers.count()},
                {"samples", o.samples},
                {"tolerance", o.tolerance},
                {"solvers", all}});
  else
    fmt::print("{} receivers, {} rays each; applications of the operator until the residual is reached\n{}",
               receivers.count(), o.samples, table);
  return success;
}

}  // namespace

void add_bench(CLI::App& app, Run& run) {
  auto o = std::make_shared<SolversCommand>();
  CLI::App* bench = app.add_subcommand("bench", "Measure choices on a scene of yours");
  bench->require_subcommand(1);
  CLI::App* c = bench->add_subcommand("solvers", "The scene's radiosity by every solver: residual against work");
  o->scene.add_to(*c);
  c->get_option("scene")->required(false)->description(
      "Scene: .gltf, .glb, .obj or .ply; a closed room of albedo 0.8 if there is none");
  o->receivers.add_to(*c);
  c->add_option("--sky", o->sky, "An environment (as --env of render) as one more lamp");
  c->add_option("--samples", o->samples, "Rays a receiver")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  c->add_option("--lamp-samples", o->lamp_samples, "Samples a receiver towards the lamps")
      ->check(CLI::Range(1, 1 << 16))
      ->capture_default_str();
  c->add_option("--residual", o->tolerance, "Of the solution that is timed")
      ->check(CLI::Range(1e-7, 0.5))
      ->capture_default_str();
  c->add_option("--plot-residual", o->fine, "How far the steps go")
      ->check(CLI::Range(1e-7, 0.5))
      ->capture_default_str();
  c->add_option("--most", o->most, "Applications of the operator at most")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  c->add_option("--memory", o->memory, "Working memory for the operator; e.g. 500MB, 2GiB")
      ->transform(CLI::AsSizeValue(false))
      ->default_str("4GiB");
  c->add_option("--seed", o->seed, "Of the ray directions")->capture_default_str();
  c->callback([o, &run] { run = [o](Context& context) { return run_solvers(context, *o); }; });
}

}  // namespace lambent::tool

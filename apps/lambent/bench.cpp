// `lambent bench solvers`: the same radiosity system by every solver, residual against applications of the operator.
#include "commands.h"
#include "table.h"

#include <lambent/bake/kernels.h>
#include <lambent/core/clock.h>
#include <lambent/pipeline/bake_lightmap.h>
#include <lambent/pipeline/place_receivers.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct SolversCommand {
  BakeRequest request;  // scene, receivers, sky, samples, memory, seed
  int most = 200;
  double tolerance = 1e-3, fine = 1e-6;
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
  const BakeRequest& r = o.request;
  const Job job{&context.progress, [](const std::string& message) { warn(message); }};
  if (auto ok = check_values(bake_options(), r, r.given); !ok) return fail(ok.error());
  Result<Scene> scene = r.scene.empty() ? make_closed_room() : load_scene_of(r, job);
  if (!scene) return fail(scene.error());
  std::optional<Environment> sky;
  if (!r.sky.empty()) {
    auto env = load_environment(r.sky);
    if (!env) return fail(env.error());
    warn(env->warnings);
    sky = std::move(*env);
  }
  const Lamps lamps = make_lamps(*scene, sky ? &*sky : nullptr, false);
  if (lamps.groups() == 0) return fail({scene->path, "nothing gives light: no emissive material, no lamp, no sky"});
  auto placed = place_receivers(*scene, r, job);
  if (!placed) return fail(placed.error());
  const Receivers& receivers = placed->receivers;
  if (receivers.count() == 0) return fail({scene->path, "nothing to bake: no triangle has an area"});
  auto tracer = Tracer::build(*scene);
  if (!tracer) return fail(tracer.error());

  const GatherSetup setup = make_gather_setup(*scene, *tracer, receivers, 1, r.samples, r.seed);
  const size_t width = pad_lanes(3 * lamps.groups());
  AlignedVector<float> e(receivers.count() * width, 0.0f);
  const GatherDirect direct{lamps, r.lamp_samples, e.data(), width};
  auto op = GatherOperator::trace(setup, &direct, nullptr, true, r.memory, &context.progress);
  if (!op) return fail(op.error());

  nlohmann::json all = nlohmann::json::array();
  std::string table = fmt::format("{:14}{:>16}{:>10}{:>16}\n", "solver", fmt::format("to {:g}", o.tolerance), "seconds",
                                  fmt::format("to {:g}", o.fine));
  for (const auto& [name, solver] : solver_names) {
    SolveReport report, fine;
    const auto start = Clock::now();
    if (auto x = solve(*op, e.data(), width, {solver, o.tolerance, o.most}, &report, &context.progress); !x)
      return fail(x.error());
    const double seconds = seconds_since(start);
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
    print_json({{"scene", r.scene.empty() ? "closed room" : r.scene},
                {"receivers", receivers.count()},
                {"samples", r.samples},
                {"tolerance", o.tolerance},
                {"solvers", all}});
  else
    fmt::print("{} receivers, {} rays each; applications of the operator until the residual is reached\n{}",
               receivers.count(), r.samples, table);
  return success;
}

}  // namespace

void add_bench(CLI::App& app, Run& run) {
  auto o = std::make_shared<SolversCommand>();
  CLI::App* bench = app.add_subcommand("bench", "Measure choices on a scene of yours");
  bench->require_subcommand(1);
  CLI::App* c = bench->add_subcommand("solvers", "The scene's radiosity by every solver: residual against work");
  o->request.transfer = "lightmap", o->request.receivers = "vertices", o->request.lamp_samples = 64;
  c->add_option("scene", o->request.scene,
                "Scene: .gltf, .glb, .obj or .ply; a closed room of albedo 0.8 if there is none");
  add_table(*c, bake_options(), o->request, o->request.given, [](const std::string& name) {
    for (const char* taken : {"receivers", "texels-per-unit", "atlas", "sky", "samples", "lamp-samples", "memory",
                              "seed", "ground", "max-edge", "emit", "light-units", "max-albedo", "exclude"})
      if (name == taken) return true;
    return false;
  });
  c->add_option("--residual", o->tolerance, "Of the solution that is timed")
      ->check(CLI::Range(1e-7, 0.5))
      ->capture_default_str();
  c->add_option("--plot-residual", o->fine, "How far the steps go")
      ->check(CLI::Range(1e-7, 0.5))
      ->capture_default_str();
  c->add_option("--most", o->most, "Applications of the operator at most")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  c->callback([o, &run] { run = [o](Context& context) { return run_solvers(context, *o); }; });
}

}  // namespace lambent::tool

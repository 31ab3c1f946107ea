#include "commands.h"
#include "motion.h"
#include "options.h"
#include "relief.h"

#include <lambent/baked/baked_file.h>
#include <lambent/core/clock.h>
#include <lambent/light/project.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/light.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct ReferenceCommand {
  SceneOptions scene;
  LightOptions light;
  ViewOptions view;
  MotionOptions motion;
  DisplaceOptions displace;
  BrdfOptions brdf;
  ShWindow window = ShWindow::none;
  int light_order = 0;
  std::string light_basis;
  bool normal_maps = true;
  ReferenceOptions options;
};

// Lamps that stand anywhere, taken out of those of the scene's own that are scaled.
std::vector<std::string> take_moving_lamps(BakeRequest& request) {
  std::vector<std::string> moving;
  for (const std::string& text : request.lamp)
    if (names_moving_lamp(text)) moving.push_back(text);
  std::erase_if(request.lamp, names_moving_lamp);
  if (!moving.empty() && request.lamp.empty()) request.given.erase("lamp");
  return moving;
}

// The scene's own lamps stay where they were asked for.
Result<void> stand_lamps(Scene& scene, const std::vector<std::string>& texts, ReferenceOptions& options) {
  if (texts.empty()) return {};
  auto lamps = parse_moving_lamps(texts, scene.origin);
  if (!lamps) return lamps.error();
  if (!options.lamps) {
    scene.lights.clear();
    for (Material& m : scene.materials) m.emissive = Vec3(0.0f);
  }
  add_lamps(scene, *lamps);
  options.lamps = true;
  return {};
}

int run_reference(Context& context, ReferenceCommand o, const CLI::App& command) {
  if (auto ok = check_display_options(o.view.display, command, o.view.output); !ok) return fail(ok.error());
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto reflection = load_reflection(o.brdf);
  if (!reflection) return fail(reflection.error());
  o.options.reflection = std::move(*reflection), o.options.reflection.normal_maps = o.normal_maps;
  LightBasis basis{.order = o.light_order};
  if (!o.light_basis.empty()) {
    auto baked = load_baked(o.light_basis);
    if (!baked) return fail(baked.error());
    basis = light_of(baked->surface.store);
    if (basis.count() == 0) return fail({o.light_basis, "holds no light basis: it takes all of any environment"});
  }
  const bool displaced = !o.displace.heights.empty();
  SceneOptions prepared = o.scene;
  if (displaced) prepared.request.ground = false;  // it stays flat
  const std::vector<std::string> moving = take_moving_lamps(prepared.request);
  auto scene = load_prepared_scene(prepared, o.options.lamps);
  if (!scene) return fail(scene.error());
  auto poses = make_poses(o.motion, *scene);
  if (!poses) return fail(poses.error());
  if (poses->front()) *scene = posed(*scene, *poses->front());
  auto view = make_view(o.view, *scene);  // of the scene before it is displaced, as render looks at it
  if (!view) return fail(view.error());
  if (auto ok = stand_lamps(*scene, moving, o.options); !ok) return fail(ok.error());
  if (o.light.env.empty() && !o.options.lamps) return fail({"--env", "is needed, or --lamps or --lamp", true});
  if (o.light.env.empty()) o.light.env = "uniform:0";
  if (displaced)
    if (auto ok = displace_scene(*scene, o.displace); !ok) return fail(ok.error());
  if (displaced && o.scene.request.ground) add_ground(*scene);
  auto env = load_light(o.light);
  if (!env) return fail(env.error());
  if (basis.count() > 0) {
    const LightProjection projection = project_light(*env, basis, *rotation, o.light_order, o.window);
    *env = reconstruct_environment(projection.basis, projection.light);
  } else if (!o.light.rotate.empty()) {
    *env = rotated(*env, *rotation);
  }
  o.options.width = view->width, o.options.height = view->height, o.options.background = o.view.background == "env";
  const auto start = Clock::now();
  auto result = path_trace(*scene, *env, view->camera, o.options, &context.progress);
  if (!result) return fail(result.error());
  const double seconds = seconds_since(start);
  if (auto ok = save_shown(o.view.output, result->image, o.view.display); !ok) return fail(ok.error());

  double variance = 0;
  for (Vec3 v : result->variance) variance += (double(v.x) + v.y + v.z) / 3;
  const double noise = std::sqrt(variance / double(result->variance.size()));
  if (context.json)
    print_json({{"output", o.view.output}, {"seconds", seconds}, {"spp", o.options.spp}, {"noise_rms", noise}});
  else
    fmt::print("{}\n  {} paths a pixel in {}, noise {:.2g} RMS\n", o.view.output, o.options.spp, human_seconds(seconds),
               noise);
  return success;
}

}  // namespace

void add_reference(CLI::App& app, Run& run) {
  auto o = std::make_shared<ReferenceCommand>();
  CLI::App* c = app.add_subcommand("reference", "Path-trace a scene: the truth to judge bakes by");
  o->scene.add_to(*c);
  o->light.add_to(*c, false);
  o->view.add_to(*c);
  o->motion.add_to(*c);
  o->displace.add_to(*c);
  o->brdf.add_to(*c);
  c->add_option("--light-order", o->light_order,
                "Light by the environment's projection to this many bands, negative light included")
      ->check(CLI::Range(1, max_sh_order));
  c->add_option("--light-basis", o->light_basis,
                "Light by the environment's projection onto what this baked file has columns for");
  c->add_option("--window", o->window, "With --light-order or --light-basis: as for render")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_flag("--lamps", o->options.lamps,
              "The scene's own lamps give light too: emissive materials and punctual lights");
  c->add_flag("!--no-direct", o->options.direct,
              "Leave lamps and what they light straight out: light that has met two surfaces or more alone");
  c->add_flag("!--no-normal-maps", o->normal_maps, "Leave materials' normal textures out");
  c->add_option("--bounces", o->options.bounces, "Reflections between surfaces")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  c->add_option("--spp", o->options.spp, "Paths a pixel")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  c->add_option("--seed", o->options.seed, "Of the paths")->capture_default_str();
  c->callback([o, c, &run] { run = [o, c](Context& context) { return run_reference(context, *o, *c); }; });
}

}  // namespace lambent::tool

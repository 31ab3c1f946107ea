#include "commands.h"
#include "options.h"

#include <lambent/bake/bake.h>
#include <lambent/baked/baked_file.h>
#include <lambent/light/project.h>
#include <lambent/relight/relight.h>
#include <lambent/render/insert.h>
#include <lambent/render/render.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent::tool {
namespace {

struct RenderCommand {
  std::string baked;
  LightOptions light;
  ViewOptions view;
  ShWindow window = ShWindow::none;
  int light_order = 0, samples = 16;
  bool no_albedo = false;
  std::vector<std::string> insert;
};

struct Insertion {
  std::string path;
  Vec3 foot;
  float scale = 1;
};

// FILE@X,Y,Z or FILE@X,Y,Z,SCALE.
Result<Insertion> parse_insertion(const std::string& text) {
  const size_t at = text.rfind('@');
  if (at == std::string::npos || at == 0) return Error{"--insert", "expects FILE@X,Y,Z or FILE@X,Y,Z,SCALE, not \"" + text + "\""};
  const std::string place = text.substr(at + 1);
  const bool scaled = std::count(place.begin(), place.end(), ',') == 3;
  auto n = parse_numbers(place, scaled ? 4 : 3, "--insert");
  if (!n) return n.error();
  Insertion out{text.substr(0, at), {(*n)[0], (*n)[1], (*n)[2]}, scaled ? (*n)[3] : 1};
  if (!(out.scale > 0)) return Error{"--insert", "the scale must be above 0"};
  if (glm::any(glm::greaterThan(glm::abs(out.foot), Vec3(1e9f)))) return Error{"--insert", "the place lies beyond 1e9"};
  return out;
}

// Adds the object to what is drawn, lit by the lattice. It must be loaded and baked alone where it stands.
Result<void> add_insertion(Context& context, const Insertion& insertion, const LatticeTransfer& lattice, const Relit& light, RelitScene& drawn) {
  auto object = load_scene(insertion.path);
  if (!object) return object.error();
  warn(object->warnings);
  place_scene(*object, insertion.foot, insertion.scale);
  for (const Vec3& p : object->positions)
    if (!is_finite(p)) return Error{insertion.path, "is too large to be scaled so"};
  const Bounds box = bounds(*object);
  const Vec3 slack(0.01f * glm::length(lattice.lattice.max - lattice.lattice.min));
  if (glm::any(glm::lessThan(box.min, lattice.lattice.min - slack)) || glm::any(glm::greaterThan(box.max, lattice.lattice.max + slack)))
    warn(insertion.path + ": reaches out of the lattice's box; light there is that of the box's border");
  auto tracer = Tracer::build(*object);
  if (!tracer) return tracer.error();
  const Receivers receivers = make_vertex_receivers(*object);
  // What the object does to light that comes to it: own shadows, and one bounce.
  auto transfer = bake(*object, *tracer, receivers, {.order = lattice.order, .samples = 512, .bounces = 1, .precision = Precision::single}, nullptr,
                       &context.progress);
  if (!transfer) return transfer.error();
  return insert_object(drawn, *object, receivers, *transfer, lattice.lattice, light);
}

int run_render(Context& context, const RenderCommand& o) {
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  auto view = make_view(o.view, baked->scene);
  if (!view) return fail(view.error());
  std::vector<Insertion> insertions;
  for (const std::string& text : o.insert) {
    auto insertion = parse_insertion(text);
    if (!insertion) return fail(insertion.error());
    insertions.push_back(std::move(*insertion));
  }
  if (!insertions.empty() && !baked->lattice) return fail({o.baked, "has no light in free space for --insert: bake it with --lattice"});
  auto env = load_light(o.light);
  if (!env) return fail(env.error());

  // light: projected once, turned and windowed as coefficients.
  const int order = o.light_order ? std::min(o.light_order, baked->transfer.light.order) : baked->transfer.light.order;
  std::vector<Vec3> light = rotate_sh(make_sh_rotation(order, *rotation), project_environment(*env, order));
  const std::vector<float> window = apply_sh_window(o.window, light);
  light.resize(baked->transfer.columns(), Vec3(0.0f));

  // T . light
  RelitScene drawn{std::move(baked->scene), std::move(baked->front), std::move(baked->back), baked->transfer.receivers, {}, std::move(baked->outgoing)};
  const auto start = std::chrono::steady_clock::now();
  relight(baked->transfer, light, drawn.relit);
  const double relight_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  if (!insertions.empty()) {
    Relit free_space;
    relight(baked->lattice->transfer, light, free_space);
    for (const Insertion& insertion : insertions)
      if (auto ok = add_insertion(context, insertion, *baked->lattice, free_space, drawn); !ok) return fail(ok.error());
  }

  // O(view)
  auto tracer = Tracer::build(drawn.scene);
  if (!tracer) return fail(tracer.error());
  const CornerReceivers corners = corner_receivers(drawn.scene, drawn.front, drawn.back);
  RenderOptions options{view->width, view->height, o.samples, nullptr, !o.no_albedo, drawn.outgoing ? &*drawn.outgoing : nullptr};
  Environment turned;
  if (o.view.background == "env") {
    turned = o.light.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
    options.background = &turned;
  }
  auto image = render(drawn.scene, *tracer, corners, drawn.relit, view->camera, options, &context.progress);
  if (!image) return fail(image.error());
  if (auto ok = save_image(o.view.output, *image, o.view.exposure); !ok) return fail(ok.error());

  if (context.json)
    print_json({{"output", o.view.output}, {"receivers", baked->transfer.receivers}, {"order", order}, {"window", window},
                {"relight_seconds", relight_seconds}});
  else
    fmt::print("{}\n  relit {} receivers in {:.2f} ms\n", o.view.output, human_count(baked->transfer.receivers), 1e3 * relight_seconds);
  return success;
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
  auto o = std::make_shared<RenderCommand>();
  CLI::App* c = app.add_subcommand("render", "Relight a baked scene and draw it");
  c->add_option("baked", o->baked, "Baked file, from `lambent bake`")->required();
  o->light.add_to(*c);
  o->view.add_to(*c);
  c->add_option("--window", o->window, "Against ringing: none, hann, lanczos, or auto (as weak as keeps open surfaces from going dark)")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_option("--light-order", o->light_order, "Use only this many bands of the baked ones")->check(CLI::Range(1, max_sh_order));
  c->add_option("--spp", o->samples, "Rays a pixel")->check(CLI::Range(1, 4096))->capture_default_str();
  c->add_option("--insert", o->insert, "FILE@X,Y,Z[,SCALE]: put a small diffuse object there, lit by the scene's lattice; may be given again")
      ->allow_extra_args(false);
  c->add_flag("--no-albedo", o->no_albedo, "Draw everything as if it were white");
  c->callback([o, &run] { run = [o](Context& context) { return run_render(context, *o); }; });
}

}  // namespace lambent::tool

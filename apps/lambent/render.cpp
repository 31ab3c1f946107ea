#include "commands.h"
#include "options.h"

#include <lambent/baked/baked_file.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relight.h>
#include <lambent/render/render.h>

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
};

int run_render(Context& context, const RenderCommand& o) {
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  auto view = make_view(o.view, baked->scene);
  if (!view) return fail(view.error());
  auto env = load_light(o.light);
  if (!env) return fail(env.error());

  // light
  const LightProjection projection = project_light(*env, baked->transfer.light, *rotation, o.light_order, o.window);

  // T . light
  Relit relit;
  const auto start = std::chrono::steady_clock::now();
  relight(baked->transfer, projection.light, relit);
  const double relight_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  // O(view)
  auto tracer = Tracer::build(baked->scene);
  if (!tracer) return fail(tracer.error());
  const CornerReceivers corners = corner_receivers(baked->scene, baked->front, baked->back);
  RenderOptions options{view->width, view->height, o.samples, nullptr, !o.no_albedo, baked->outgoing ? &*baked->outgoing : nullptr};
  Environment turned;
  if (o.view.background == "env") {
    turned = o.light.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
    options.background = &turned;
  }
  auto image = render(baked->scene, *tracer, corners, relit, view->camera, options, &context.progress);
  if (!image) return fail(image.error());
  if (auto ok = save_image(o.view.output, *image, o.view.exposure); !ok) return fail(ok.error());

  if (context.json)
    print_json({{"output", o.view.output}, {"receivers", baked->transfer.receivers}, {"order", projection.window.size()},
                {"lobes", projection.basis.lobes.size()}, {"window", projection.window}, {"relight_seconds", relight_seconds}});
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
  c->add_option("--window", o->window, "Against ringing of the harmonics: none, hann, lanczos, or auto (as weak as keeps open surfaces from going dark)")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_option("--light-order", o->light_order, "Use only this many bands of the baked ones; lobes are kept")->check(CLI::Range(1, max_sh_order));
  c->add_option("--spp", o->samples, "Rays a pixel")->check(CLI::Range(1, 4096))->capture_default_str();
  c->add_flag("--no-albedo", o->no_albedo, "Draw everything as if it were white");
  c->callback([o, &run] { run = [o](Context& context) { return run_render(context, *o); }; });
}

}  // namespace lambent::tool

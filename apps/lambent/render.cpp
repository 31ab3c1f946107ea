#include "commands.h"
#include "motion.h"
#include "options.h"

#include <lambent/bake/materials.h>
#include <lambent/baked/baked_file.h>
#include <lambent/light/project.h>
#include <lambent/relight/zonal.h>
#include <lambent/render/render.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent::tool {
namespace {

struct RenderCommand {
  std::string baked, texture, tile = "1,1";
  LightOptions light;
  ViewOptions view;
  MotionOptions motion;
  BrdfOptions brdf;
  bool new_brdf = false;
  ShWindow window = ShWindow::none;
  int light_order = 0, samples = 16;
  bool no_albedo = false;
};

// Any mesh, animated or not, with a transfer texture on it.
int run_textured(Context& context, const RenderCommand& o) {
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  if (o.light.env.empty()) return fail({"--env", "is needed: an environment to light the scene by"});
  auto tile = parse_numbers(o.tile, 2, "--tile");
  if (!tile) return fail(tile.error());
  auto texture = load_zonal_texture(o.texture);
  if (!texture) return fail(texture.error());
  auto scene = load_scene(o.baked);
  if (!scene) return fail(scene.error());
  warn(scene->warnings);
  if (scene->texcoords[0].empty()) warn(o.baked + ": has no texture coordinates, so that the transfer texture shows as one colour");
  auto poses = make_poses(o.motion, *scene);
  if (!poses) return fail(poses.error());
  auto env = load_light(o.light);
  if (!env) return fail(env.error());
  const int order = o.light_order ? std::min(o.light_order, texture->transfer.order) : texture->transfer.order;
  std::vector<Vec3> light = rotate_sh(make_sh_rotation(order, *rotation), project_environment(*env, order));
  apply_sh_window(o.window, light);
  light.resize(size_t(sh_count(texture->transfer.order)), Vec3(0.0f));
  Environment turned;
  if (o.view.background == "env") turned = o.light.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
  std::vector<Image> images;
  Result<View> view = Error{};
  for (const std::optional<Pose>& pose : *poses) {
    const Scene moved = pose ? posed(*scene, *pose) : *scene;
    if (images.empty()) view = make_view(o.view, moved);
    if (!view) return fail(view.error());
    auto tracer = Tracer::build(moved);
    if (!tracer) return fail(tracer.error());
    RenderOptions options{view->width, view->height, o.samples, nullptr, !o.no_albedo};
    if (o.view.background == "env") options.background = &turned;
    auto image = render_transfer_texture(moved, *tracer, *texture, {(*tile)[0], (*tile)[1]}, light, view->camera, options, &context.progress);
    if (!image) return fail(image.error());
    images.push_back(std::move(*image));
  }
  if (auto ok = save_image(o.view.output, images.size() > 1 ? beside(images) : images.front(), o.view.exposure); !ok) return fail(ok.error());
  if (context.json) print_json({{"output", o.view.output}, {"texels", texture->transfer.receivers}, {"frames", images.size()}});
  else fmt::print("{}\n  {} x {} texels of {} lobes\n", o.view.output, texture->width, texture->height, texture->transfer.lobes);
  return success;
}

// Other materials for a bake that kept incident light: its last reflection is made anew.
Result<void> change_materials(Baked& baked, const BrdfOptions& options, const std::string& path) {
  if (!baked.outgoing || baked.outgoing->kind != OutgoingKind::map)
    return Error{path, "--brdf needs a bake that kept incident light: lambent bake --transfer matrix --outgoing map"};
  auto reflection = load_reflection(options);
  if (!reflection) return reflection.error();
  Receivers receivers;
  receivers.origins.resize(baked.transfer.receivers), receivers.front = baked.front, receivers.back = baked.back;
  for (const Mat3& frame : baked.outgoing->frames) receivers.normals.push_back(frame[2]);
  const ReceiverMaterials materials = make_receiver_materials(baked.scene, receivers, *reflection);
  const CosineBasis basis = make_cosine_basis(baked.outgoing->order);
  baked.outgoing->maps.clear();
  for (const LinearMaterial& m : materials.materials) baked.outgoing->maps.push_back(make_response(m, basis, MatrixOptions{}.grid, MatrixOptions{}.response_samples));
  baked.outgoing->map_of = materials.of_receiver;
  return {};
}

int run_render(Context& context, const RenderCommand& o) {
  if (!o.texture.empty()) return run_textured(context, o);
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  if (o.new_brdf)
    if (auto ok = change_materials(*baked, o.brdf, o.baked); !ok) return fail(ok.error());
  auto poses = make_poses(o.motion, baked->scene);
  if (!poses) return fail(poses.error());
  // What moves is seen by the camera that looks at its first pose.
  const Scene first = poses->front() ? posed(baked->scene, *poses->front()) : Scene();
  auto view = make_view(o.view, poses->front() ? first : baked->scene);
  if (!view) return fail(view.error());
  const LightBasis basis = baked->zonal ? LightBasis{.order = baked->zonal->order} : baked->transfer.light;
  const size_t receivers = baked->zonal ? baked->zonal->receivers : baked->transfer.receivers;
  if (o.light.env.empty() && basis.order > 0) return fail({"--env", "is needed: an environment to light the scene by"});
  Result<Environment> env = Environment{};
  if (!o.light.env.empty()) env = load_light(o.light);
  if (!env) return fail(env.error());

  // light: projected once, turned and windowed as coefficients. Light that was fixed in the bake is on.
  const int order = o.light_order ? std::min(o.light_order, basis.order) : basis.order;
  std::vector<Vec3> light;
  std::vector<float> window;
  if (order > 0) {
    light = rotate_sh(make_sh_rotation(order, *rotation), project_environment(*env, order));
    window = apply_sh_window(o.window, light);
  }
  light.resize(basis.count(), Vec3(0.0f));
  std::fill_n(light.end() - ptrdiff_t(basis.groups.size()), basis.groups.size(), Vec3(1.0f));
  ZonalLight table;
  if (baked->zonal) specialise_light(*baked->zonal, light, table);
  else if (o.motion.any()) warn(o.baked + ": its transfer cannot turn with the surface (`lambent compress --zonal` makes one that can); it is used as baked");

  Environment turned;
  const bool show_env = o.view.background == "env" && !o.light.env.empty();
  if (show_env) turned = o.light.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
  const CornerReceivers corners = corner_receivers(baked->scene, baked->front, baked->back);
  double relight_seconds = 1e9;
  std::vector<Image> images;
  for (const std::optional<Pose>& pose : *poses) {
    // T . light
    Relit relit;
    const ReceiverFrames frames = baked->zonal && pose ? make_receiver_frames(receiver_rotations(*pose, baked->front, baked->back, receivers)) : ReceiverFrames();
    const auto start = std::chrono::steady_clock::now();
    if (baked->zonal) relight_zonal(*baked->zonal, pose ? &frames : nullptr, table, relit);
    else relight(baked->transfer, light, relit);
    relight_seconds = std::min(relight_seconds, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());

    // O(view)
    const Scene moved = pose ? posed(baked->scene, *pose) : Scene();
    const Scene& scene = pose ? moved : baked->scene;
    auto tracer = Tracer::build(scene);
    if (!tracer) return fail(tracer.error());
    RenderOptions options{view->width, view->height, o.samples, nullptr, !o.no_albedo, baked->outgoing ? &*baked->outgoing : nullptr};
    if (show_env) options.background = &turned;
    auto image = render(scene, *tracer, corners, relit, view->camera, options, &context.progress);
    if (!image) return fail(image.error());
    images.push_back(std::move(*image));
  }
  if (auto ok = save_image(o.view.output, images.size() > 1 ? beside(images) : images.front(), o.view.exposure); !ok) return fail(ok.error());

  if (context.json)
    print_json({{"output", o.view.output}, {"receivers", receivers}, {"frames", images.size()}, {"order", order}, {"window", window},
                {"relight_seconds", relight_seconds}});
  else
    fmt::print("{}\n  relit {} receivers in {:.2f} ms\n", o.view.output, human_count(receivers), 1e3 * relight_seconds);
  return success;
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
  auto o = std::make_shared<RenderCommand>();
  CLI::App* c = app.add_subcommand("render", "Relight a baked scene and draw it");
  c->add_option("baked", o->baked, "Baked file, from `lambent bake`; with --transfer-texture, any scene")->required();
  o->light.add_to(*c, false);
  o->view.add_to(*c);
  o->motion.add_to(*c, true);
  auto* texture = c->add_option("--transfer-texture", o->texture, "Shade the scene by this texture of zonal lobes, from `lambent patch`");
  c->add_option("--tile", o->tile, "U,V: its repetitions over the unit of texture coordinates")->needs(texture)->capture_default_str();
  c->add_option("--window", o->window, "Against ringing: none, hann, lanczos, or auto (as weak as keeps open surfaces from going dark)")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_option("--light-order", o->light_order, "Use only this many bands of the baked ones")->check(CLI::Range(1, max_sh_order));
  c->add_option("--spp", o->samples, "Rays a pixel")->check(CLI::Range(1, 4096))->capture_default_str();
  c->add_flag("--no-albedo", o->no_albedo, "Draw everything as if it were white");
  auto* brdf = o->brdf.add_to(*c);
  c->callback([o, brdf, &run] { o->new_brdf = brdf->count() > 0; run = [o](Context& context) { return run_render(context, *o); }; });
}

}  // namespace lambent::tool

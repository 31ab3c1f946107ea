#include "blocks.h"
#include "commands.h"
#include "motion.h"
#include "options.h"
#include "textured.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/materials.h>
#include <lambent/baked/baked_file.h>
#include <lambent/light/project.h>
#include <lambent/relight/factors.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relight.h>
#include <lambent/relight/zonal.h>
#include <lambent/render/insert.h>
#include <lambent/render/render.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>

namespace lambent::tool {
namespace {

const std::map<std::string, RenderOptions::Show> show_names{{"product", RenderOptions::Show::product},
                                                            {"radiosity", RenderOptions::Show::radiosity},
                                                            {"albedo", RenderOptions::Show::albedo}};

struct RenderCommand {
  std::string baked;
  TexturedFlags textured;
  std::vector<std::string> sphere_lamps;  // X,Y,Z,RADIUS,R,G,B
  LightOptions light;
  ViewOptions view;
  MotionOptions motion;
  BrdfOptions brdf;
  bool new_brdf = false, view_given = false, product_options = false;
  ProductFlags products;
  ShWindow window = ShWindow::none;
  int light_order = 0, samples = 16;
  RenderOptions::Show show = RenderOptions::Show::product;
  std::vector<std::string> lamps;  // NAME=R,G,B
  std::vector<std::string> insert;
};

// Other materials for a bake that kept incident light: its last reflection is made anew.
Result<void> change_materials(Baked& baked, const BrdfOptions& options, const std::string& path) {
  if (!baked.outgoing || baked.outgoing->kind != OutgoingKind::map)
    return Error{path, "--brdf needs a bake that kept incident light: lambent bake --transfer matrix --outgoing map"};
  auto reflection = load_reflection(options);
  if (!reflection) return reflection.error();
  Receivers receivers;
  receivers.origins.resize(receivers_of(baked)), receivers.front = baked.front, receivers.back = baked.back;
  for (const Mat3& frame : baked.outgoing->frames) receivers.normals.push_back(frame[2]);
  Outgoing changed =
      make_map_outgoing(make_receiver_materials(baked.scene, receivers, *reflection), baked.outgoing->order);
  changed.frames = std::move(baked.outgoing->frames);
  baked.outgoing = std::move(changed);
  return {};
}

// Where each receiver is: at (the first of) its vertices.
std::vector<Vec3> receiver_places(const std::vector<Vec3>& positions, const Baked& baked, size_t receivers) {
  std::vector<Vec3> places(receivers, Vec3(0.0f));
  for (const auto* map : {&baked.back, &baked.front})
    for (size_t v = map->size(); v-- > 0;)
      if ((*map)[v] != none) places[(*map)[v]] = positions[v];
  return places;
}

// Adds the object to what is drawn, lit by the lattice. It must be loaded and baked alone where it stands.
Result<void> add_insertion(Context& context, const Insertion& insertion, const LatticeTransfer& lattice,
                           const Relit& light, RelitScene& drawn) {
  auto object = load_scene(insertion.path);
  if (!object) return object.error();
  warn(object->warnings);
  place_scene(*object, insertion.foot, insertion.scale);
  for (const Vec3& p : object->positions)
    if (!is_finite(p)) return Error{insertion.path, "is too large to be scaled so"};
  const Bounds box = bounds(*object);
  const Vec3 slack(0.01f * length(lattice.lattice.max - lattice.lattice.min));
  if (!all_at_most(lattice.lattice.min - slack, box.min) || !all_at_most(box.max, lattice.lattice.max + slack))
    warn(insertion.path + ": reaches out of the lattice's box; light there is that of the box's border");
  auto tracer = Tracer::build(*object);
  if (!tracer) return tracer.error();
  const Receivers receivers = make_vertex_receivers(*object);
  // What the object does to light that comes to it: own shadows, and one bounce.
  auto transfer = bake(*object, *tracer, receivers,
                       {.order = lattice.order, .samples = 512, .bounces = 1, .precision = Precision::single}, nullptr,
                       &context.progress);
  if (!transfer) return transfer.error();
  return insert_object(drawn, *object, receivers, *transfer, lattice.lattice, light);
}

int run_render(Context& context, const RenderCommand& o) {
  auto near = parse_sphere_lamps(o.sphere_lamps);
  if (!near) return fail(near.error());
  if (!o.textured.texture.empty() && (o.new_brdf || !o.lamps.empty() || !o.insert.empty() || o.product_options))
    return fail({"--transfer-texture", "goes with none of --brdf, --lamp, --insert and --method"});
  if (!o.textured.texture.empty())
    return run_textured(
        context, {o.baked, o.textured, o.light, *near, o.view, o.motion, o.window, o.light_order, o.samples, o.show});
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  if (baked->visibility) {
    if (o.motion.any() || !o.insert.empty() || !o.lamps.empty() || !near->empty())
      return fail(
          {o.baked, "is of visibility in blocks: nothing in it moves, and no lamps but the environment light it"});
    return run_product_render(context, *baked, o.products, o.light, o.view, o.brdf, o.samples);
  }
  if (!near->empty() && !baked->zonal)
    return fail({o.baked, "--sphere-lamp lights lobes and transfer textures: `lambent compress --zonal` makes lobes"});
  if (o.product_options)
    return fail({o.baked, "--method and its options need a bake of visibility: lambent bake --transfer blocks"});
  if (o.new_brdf)
    if (auto ok = change_materials(*baked, o.brdf, o.baked); !ok) return fail(ok.error());
  auto poses = make_poses(o.motion, baked->scene);
  if (!poses) return fail(poses.error());
  // What moves is seen by the camera that looks at its first pose.
  const Scene first = poses->front() ? posed(baked->scene, *poses->front()) : Scene();
  auto view = make_view(o.view, poses->front() ? first : baked->scene);
  if (!view) return fail(view.error());
  if (baked->view) {
    if (o.view_given) return fail({o.baked, "its view is fixed: leave --camera, --size and --spp out"});
    if (o.motion.any()) return fail({o.baked, "its view is fixed, and nothing in it can move"});
    *view = {baked->view->camera, baked->view->width, baked->view->height};
  }
  std::vector<Insertion> insertions;
  for (const std::string& text : o.insert) {
    auto insertion = parse_insertion(text);
    if (!insertion) return fail(insertion.error());
    insertions.push_back(std::move(*insertion));
  }
  if (!insertions.empty() && !baked->lattice)
    return fail({o.baked, "has no light in free space for --insert: bake it with --lattice"});
  if (!insertions.empty() &&
      (!std::holds_alternative<CornerReceivers>(baked->basis) || baked->directional != DirectionalKind::none))
    return fail({o.baked, "objects can only be inserted into bakes at vertices"});
  if (!insertions.empty() && o.motion.any())
    return fail({"--insert", "draws the scene at rest: leave the animation out"});
  const LightBasis basis = light_of(*baked);
  const size_t receivers = receivers_of(*baked);
  if (o.light.env.empty() && near->empty() && (basis.order > 0 || !basis.lobes.empty()))
    return fail({"--env", "is needed: the file is baked for distant light"});
  std::optional<Environment> env;
  if (!o.light.env.empty()) {
    auto loaded = load_light(o.light);
    if (!loaded) return fail(loaded.error());
    env = std::move(*loaded);
  }

  // light: of the environment, and of the scene's own lamps what they are unless told otherwise.
  LightProjection projection;
  if (env) projection = project_light(*env, basis, *rotation, o.light_order, o.window);
  else projection.light.assign(basis.count(), Vec3(0.0f));
  std::vector<Vec3>& light = projection.light;
  std::vector<Vec3> lamps(basis.groups.size(), Vec3(1.0f));
  for (const std::string& text : o.lamps) {
    auto lamp = parse_named_color(text, "--lamp");
    if (!lamp) return fail(lamp.error());
    const auto group = std::find(basis.groups.begin(), basis.groups.end(), lamp->name);
    if (group == basis.groups.end())
      return fail({"--lamp", "the file has no group \"" + lamp->name + "\"; it has " +
                                 (basis.groups.empty() ? "none" : fmt::format("{}", fmt::join(basis.groups, ", ")))});
    lamps[size_t(group - basis.groups.begin())] = lamp->color;
  }
  std::copy(lamps.begin(), lamps.end(), light.end() - ptrdiff_t(lamps.size()));
  ZonalLight table;
  if (baked->zonal) specialise_light(*baked->zonal, light, table);
  else if (o.motion.any())
    warn(o.baked +
         ": its transfer cannot turn with the surface (`lambent compress --zonal` makes one that can); it is used as "
         "baked");

  RenderOptions options{view->width,       view->height, o.samples,
                        nullptr,           o.show,       baked->outgoing ? &*baked->outgoing : nullptr,
                        baked->directional};
  if (!basis.groups.empty()) {
    const bool one = basis.groups.size() == 1 && basis.groups[0] == std::string("all");
    for (const Material& m : baked->scene.materials) {
      const auto group = std::find(basis.groups.begin(), basis.groups.end(), m.name);
      options.emission.push_back(m.emissive * (one ? lamps[0]
                                               : group == basis.groups.end()
                                                   ? Vec3(0)
                                                   : lamps[size_t(group - basis.groups.begin())]));
    }
  }
  Environment turned;
  if (o.view.background == "env" && env) {
    turned = o.light.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
    options.background = &turned;
  }
  LocalLight local{light, *near, projection.window};
  if (baked->zonal) {
    local.distant.resize(size_t(sh_count(baked->zonal->order)), Vec3(0.0f));
    if (!env)
      local.window =
          sh_window(o.window, o.light_order ? std::min(o.light_order, baked->zonal->order) : baked->zonal->order);
  }
  double relight_seconds = 1e9;
  std::vector<Image> images;
  for (const std::optional<Pose>& pose : *poses) {
    // T . light
    Relit relit;
    ReceiverFrames frames;
    Outgoing outgoing;
    if (baked->zonal && pose) {
      const std::vector<Mat3> rotations = receiver_rotations(*pose, baked->front, baked->back, receivers);
      frames = make_receiver_frames(rotations);
      if (baked->outgoing) outgoing = turn_outgoing(*baked->outgoing, rotations), options.outgoing = &outgoing;
    }
    const auto start = std::chrono::steady_clock::now();
    if (baked->zonal && !near->empty())
      relight_zonal(
          *baked->zonal, pose ? &frames : nullptr,
          make_light_field(local, receiver_places(pose ? pose->positions : baked->scene.positions, *baked, receivers)),
          relit);
    else if (baked->zonal) relight_zonal(*baked->zonal, pose ? &frames : nullptr, table, relit);
    else if (baked->cpca) relight(*baked->cpca, light, relit);
    else if (baked->factors) relight_factors(baked->transfer, *baked->outgoing, light, relit);
    else relight(baked->transfer, light, relit);
    relight_seconds =
        std::min(relight_seconds, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());

    if (baked->view) {  // O(view) is in T
      images.push_back(
          pixels_image(relit, baked->view->coverage, view->camera, view->width, view->height, options.background));
      continue;
    }

    // O(view)
    const Scene moved = pose ? posed(baked->scene, *pose) : Scene();
    const Scene& scene = pose ? moved : baked->scene;
    RelitScene drawn;
    if (!insertions.empty()) {
      drawn = {baked->scene, baked->front, baked->back, receivers, std::move(relit), baked->outgoing};
      Relit free_space;
      relight(baked->lattice->transfer, light, free_space);
      for (const Insertion& insertion : insertions)
        if (auto ok = add_insertion(context, insertion, *baked->lattice, free_space, drawn); !ok)
          return fail(ok.error());
      if (drawn.outgoing) options.outgoing = &*drawn.outgoing;
      if (!options.emission.empty()) options.emission.resize(drawn.scene.materials.size(), Vec3(0.0f));
    }
    const Scene& shown = insertions.empty() ? scene : drawn.scene;
    auto tracer = Tracer::build(shown);
    if (!tracer) return fail(tracer.error());
    const SpatialBasis spatial = insertions.empty() ? baked->basis
                                                    : SpatialBasis(corner_receivers(shown, drawn.front, drawn.back));
    auto image = render(shown, *tracer, spatial, insertions.empty() ? relit : drawn.relit, view->camera, options,
                        &context.progress);
    if (!image) return fail(image.error());
    images.push_back(std::move(*image));
  }
  if (auto ok = save_image(o.view.output, images.size() > 1 ? beside(images) : images.front(), o.view.exposure); !ok)
    return fail(ok.error());

  if (context.json)
    print_json({{"output", o.view.output},
                {"receivers", receivers},
                {"frames", images.size()},
                {"order", projection.window.size()},
                {"lobes", basis.lobes.size()},
                {"window", projection.window},
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
  o->textured.add_to(*c);
  c->add_option("--sphere-lamp", o->sphere_lamps,
                "X,Y,Z,RADIUS,R,G,B: a near lamp, a sphere of that radiance, for lobes and transfer textures; may be "
                "given again")
      ->allow_extra_args(false);
  c->add_option("--window", o->window,
                "Against ringing of the harmonics: none, hann, lanczos, or auto (as weak as keeps open surfaces from "
                "going dark)")
      ->transform(CLI::CheckedTransformer(window_names).description("{none,hann,lanczos,auto}"));
  c->add_option("--light-order", o->light_order, "Use only this many bands of the baked ones; lobes are kept")
      ->check(CLI::Range(1, max_sh_order));
  auto* spp = c->add_option("--spp", o->samples, "Rays a pixel")->check(CLI::Range(1, 4096))->capture_default_str();
  c->add_option("--lamp", o->lamps,
                "NAME=R,G,B: scale a group of lamps by this colour (files baked with --light-groups)");
  c->add_option("--insert", o->insert,
                "FILE@X,Y,Z[,SCALE]: put a small diffuse object there, lit by the scene's lattice; may be given again")
      ->allow_extra_args(false);
  c->add_option(
       "--show", o->show,
       "product of light and colour; radiosity: the light alone, as if everything were white; albedo: the colour alone")
      ->transform(CLI::CheckedTransformer(show_names).description("{product,radiosity,albedo}"));
  auto* brdf = o->brdf.add_to(*c);
  std::vector<CLI::Option*> products = o->products.add_to(*c);
  products.push_back(
      c->add_option("--indirect", o->products.indirect,
                    "Files of visibility in blocks: sh adds light that has bounced, by a diffuse bake in harmonics")
          ->check(CLI::IsMember({"none", "sh"}))
          ->capture_default_str());
  c->callback([o, c, brdf, spp, products, &run] {
    o->new_brdf = brdf->count() > 0;
    for (const CLI::Option* option : products) o->product_options |= option->count() > 0;
    o->view_given = c->count("--camera") > 0 || c->count("--size") > 0 || spp->count() > 0;
    run = [o](Context& context) { return run_render(context, *o); };
  });
}

}  // namespace lambent::tool

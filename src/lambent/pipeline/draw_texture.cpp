#include <lambent/pipeline/draw_texture.h>

#include <lambent/pipeline/motion.h>
#include <lambent/pipeline/relief.h>
#include <lambent/scene/displace.h>
#include <lambent/scene/load.h>
#include <lambent/scene/strain.h>

#include <fmt/format.h>

#include <cmath>
#include <memory>

namespace lambent {

Result<TextureUse> texture_use(const DrawRequest& request, const ZonalTexture& texture, const Job& job) {
  auto tile = parse_numbers(request.tile, 2, "--tile");
  if (!tile) return tile.error();
  const bool grooves = texture.groove_depth > 0, asked = request.groove_depth > 0 || request.groove_width != 1 ||
                                                         !request.groove_map.empty() || !request.wrinkle.empty();
  if (!grooves && asked)
    return Error{request.transfer_texture, "has no grooves (`lambent patch --groove` makes a table of them)"};
  TextureUse use{{(*tile)[0], (*tile)[1]},
                 request.groove_width,
                 request.groove_depth > 0 ? request.groove_depth : texture.groove_depth,
                 {}};
  if (grooves && use.groove_depth > texture.groove_depth)
    job.warn(fmt::format("{}: its deepest groove is {:.3g} wide ones deep; deeper ones look like it",
                         request.transfer_texture, texture.groove_depth));
  if (request.groove_map.empty()) return use;
  auto map = load_height_map(request.groove_map);
  if (!map) return map.error();
  use.groove_map = [map = std::make_shared<HeightMap>(std::move(*map))](Vec2 uv) {
    return float(sample_heights(map->values, map->width, map->height, uv));
  };
  return use;
}

Result<Wrinkles> Wrinkles::make(const DrawRequest& request, const TextureUse& use, const Scene& scene, const Job& job) {
  Wrinkles out;
  if (request.wrinkle.empty()) return out;
  out.limit_ = use.groove_depth;
  if (request.wrinkle.starts_with("strain,")) {
    auto limit = parse_numbers(request.wrinkle.substr(7), 1, "--wrinkle");
    if (!limit) return limit.error();
    out.limit_ = (*limit)[0];
  } else if (request.wrinkle != "strain") {
    return Error{"--wrinkle", "expects strain or strain,LIMIT, not \"" + request.wrinkle + "\"", true};
  }
  if (!(out.limit_ > 0 && out.limit_ <= 10))
    return Error{"--wrinkle", "a limit is of 0 to 10 widths of the groove", true};
  if (out.limit_ > use.groove_depth)
    job.warn(fmt::format("{}: its deepest groove is {:.3g} wide ones deep; deeper ones look like it",
                         request.transfer_texture, use.groove_depth));
  if (request.animation.empty() && request.deform.empty())
    return Error{"--wrinkle", "needs what presses the surface: --animation or --deform", true};
  std::vector<std::vector<Vec3>> pressed;
  if (!request.animation.empty()) {
    auto which = find_animation(scene, request.animation);
    if (!which) return which.error();
    auto animations = list_animations(scene);
    if (!animations) return animations.error();
    const AnimationInfo& all = (*animations)[*which];
    constexpr int times = 9;
    for (int k = 0; k < times; ++k) {
      auto pose = pose_scene(scene, *which, all.from + (all.to - all.from) * k / (times - 1));
      if (!pose) return pose.error();
      pressed.push_back(std::move(pose->positions));
    }
  } else {
    auto poses = make_poses({"", "", request.deform}, scene);
    if (!poses) return poses.error();
    pressed.push_back(std::move(poses->front()->positions));
  }
  out.tile_ = pressed_directions(scene, pressed, std::hypot(use.tile.x, use.tile.y), use.tile);
  return out;
}

void Wrinkles::press(const Scene& scene, const std::optional<Pose>& pose, TextureUse& use) const {
  if (tile_.empty()) return;
  use.pressed_tile = tile_;
  use.pressed_depth = pressed_depths(scene, pose ? pose->positions : scene.positions, tile_, use.groove_width, limit_);
}

std::string cannot_light(const Baked& baked, const DrawRequest& request) {
  const Outgoing* outgoing = outgoing_of(baked.surface);
  if (!outgoing || outgoing->kind != OutgoingKind::map || !vertices_of(baked))
    return "it did not keep the light that arrives (`lambent bake --transfer matrix` does)";
  if (!request.animation.empty() || !request.deform.empty()) return "it is of the scene at rest, which moves here";
  return "";
}

Result<ArrivingParts> relight_arriving(Relighter& relighter, const Baked& baked, const DrawRequest& request,
                                       const Surroundings& around) {
  auto light = column_light(request, around, light_of(baked.surface.store), baked.scene.origin);
  if (!light) return light.error();
  soften_peaks(*light);
  ArrivingParts out;
  for (const auto& [part, arriving] :
       {std::pair(&light->projection.light, &out.all), std::pair(&light->peaks, &out.peaks)}) {
    if (part->empty()) continue;
    Relit rows;
    if (auto ok = relighter.set_light(*part); !ok) return Error{request.baked, ok.error().message};
    if (auto ok = relighter.relight({}, rows); !ok) return Error{request.baked, ok.error().message};
    *arriving = arriving_light(rows, *outgoing_of(baked.surface));
  }
  return out;
}

namespace {

// The mesh, and the light that arrives at it where its bake knows that.
struct TexturedScene {
  Scene scene;
  ArrivingParts arriving;
  CornerReceivers corners;
};

Result<void> add_arriving(const Baked& baked, const DrawRequest& request, const Surroundings& around,
                          TexturedScene& out) {
  auto relighter = Relighter::make(baked.surface);
  if (!relighter) return Error{request.baked, relighter.error().message};
  auto arriving = relight_arriving(*relighter, baked, request, around);
  if (!arriving) return arriving.error();
  out.arriving = std::move(*arriving), out.corners = std::get<CornerReceivers>(baked.basis);
  return {};
}

Result<TexturedScene> load_textured_scene(const DrawRequest& request, const Surroundings& around, const Job& job) {
  TexturedScene out;
  if (is_baked(request.baked)) {
    auto baked = load_baked(request.baked);
    if (!baked) return baked.error();
    const std::string why = cannot_light(*baked, request);
    if (!why.empty()) job.warn(request.baked + ": what was baked is left out, its shadows too, since " + why);
    else if (auto ok = add_arriving(*baked, request, around, out); !ok) return ok.error();
    out.scene = std::move(baked->scene);
  } else {
    auto scene = load_scene(request.baked);
    if (!scene) return scene.error();
    out.scene = std::move(*scene);
  }
  for (const std::string& warning : out.scene.warnings) job.warn(warning);
  if (out.scene.texcoords[0].empty())
    job.warn(request.baked + ": has no texture coordinates, so that the transfer texture shows as one colour");
  return out;
}

}  // namespace

Result<Drawing> draw_texture(const DrawRequest& request, const Job& job) {
  if (auto ok = check_draw(request, DrawKind::texture); !ok) return ok.error();
  auto show = parse_show(request.show);
  if (!show) return show.error();
  auto texture = load_zonal_texture(request.transfer_texture);
  if (!texture) return texture.error();
  auto use = texture_use(request, *texture, job);
  if (!use) return use.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  auto loaded = load_textured_scene(request, *around, job);
  if (!loaded) return loaded.error();
  const Scene& scene = loaded->scene;
  auto poses = make_poses({request.animation, request.frames, request.deform, request.time}, scene);
  if (!poses) return poses.error();
  auto wrinkles = Wrinkles::make(request, *use, scene, job);
  if (!wrinkles) return wrinkles.error();
  auto light = column_light(request, *around, LightBasis{.order = texture->transfer.order}, scene.origin, false);
  if (!light) return light.error();
  const LocalLight local = light->local();
  std::optional<ArrivingAt> arriving;
  if (const ArrivingParts& parts = loaded->arriving; parts.all)
    arriving.emplace(ArrivingAt{*parts.all, loaded->corners, parts.peaks ? &*parts.peaks : nullptr});
  Drawing drawing;
  Result<View> view = Error{};
  for (const std::optional<Pose>& pose : *poses) {
    const Scene moved = pose ? posed(scene, *pose) : scene;
    wrinkles->press(scene, pose, *use);
    if (drawing.frames.empty()) view = parse_view(request.camera, request.size, moved);
    if (!view) return view.error();
    auto tracer = Tracer::build(moved);
    if (!tracer) return tracer.error();
    const RenderOptions options{view->width, view->height, request.spp, around->background(), show->colour};
    auto image = render_transfer_texture(moved, *tracer, *texture, *use, local, view->camera, options, job.progress,
                                         arriving ? &*arriving : nullptr);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  drawing.summary.json = {{"texels", texture->transfer.receivers},
                          {"frames", drawing.frames.size()},
                          {"arriving_order", loaded->arriving.all ? loaded->arriving.all->order : 0}};
  drawing.summary.lines.emplace_back(
      "texture", fmt::format("{} x {} {} of {} lobes", texture->width, texture->height,
                             texture->groove_depth > 0 ? "grooves" : "texels", texture->transfer.lobes));
  return drawing;
}

}  // namespace lambent

#include <lambent/pipeline/draw_texture.h>

#include <lambent/pipeline/draw_light.h>
#include <lambent/pipeline/motion.h>
#include <lambent/pipeline/relief.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/scene/displace.h>
#include <lambent/scene/load.h>

#include <fmt/format.h>

#include <memory>

namespace lambent {
namespace {

Result<TextureUse> texture_use(const DrawRequest& request, const ZonalTexture& texture, const Job& job) {
  auto tile = parse_numbers(request.tile, 2, "--tile");
  if (!tile) return tile.error();
  const bool grooves = texture.groove_depth > 0,
             asked = request.groove_depth > 0 || request.groove_width != 1 || !request.groove_map.empty();
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

Result<Scene> load_textured_scene(const DrawRequest& request, const Job& job) {
  auto scene = load_scene(request.baked);
  if (!scene) return scene;
  for (const std::string& warning : scene->warnings) job.warn(warning);
  if (is_baked(request.baked))
    job.warn(request.baked + ": what was baked is left out, its shadows too: a transfer texture shades itself alone");
  if (scene->texcoords[0].empty())
    job.warn(request.baked + ": has no texture coordinates, so that the transfer texture shows as one colour");
  return scene;
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
  auto scene = load_textured_scene(request, job);
  if (!scene) return scene.error();
  auto poses = make_poses({request.animation, request.frames, request.deform, request.time}, *scene);
  if (!poses) return poses.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  auto light = column_light(request, *around, LightBasis{.order = texture->transfer.order}, scene->origin, false);
  if (!light) return light.error();
  const LocalLight local = light->local();
  Drawing drawing;
  Result<View> view = Error{};
  for (const std::optional<Pose>& pose : *poses) {
    const Scene moved = pose ? posed(*scene, *pose) : *scene;
    if (drawing.frames.empty()) view = parse_view(request.camera, request.size, moved);
    if (!view) return view.error();
    auto tracer = Tracer::build(moved);
    if (!tracer) return tracer.error();
    const RenderOptions options{view->width, view->height, request.spp, around->background(), show->colour};
    auto image = render_transfer_texture(moved, *tracer, *texture, *use, local, view->camera, options, job.progress);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  drawing.summary.json = {{"texels", texture->transfer.receivers}, {"frames", drawing.frames.size()}};
  drawing.summary.lines.emplace_back(
      "texture", fmt::format("{} x {} {} of {} lobes", texture->width, texture->height,
                             texture->groove_depth > 0 ? "grooves" : "texels", texture->transfer.lobes));
  return drawing;
}

}  // namespace lambent

#include "relief.h"
#include "textured.h"

#include <lambent/light/project.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/scene/load.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>

#include <optional>

namespace lambent::tool {

void TexturedFlags::add_to(CLI::App& c) {
  auto* given = c.add_option("--transfer-texture", texture,
                             "Shade the scene by this texture of zonal lobes, from `lambent patch`");
  c.add_option("--tile", tile,
               "U,V: its repetitions over the unit of texture coordinates; of grooves, across which they lie: 12,0 "
               "makes 12 along v")
      ->needs(given)
      ->capture_default_str();
  c.add_option("--groove-depth", groove_depth, "Of grooves, in their widths; if not the deepest that the table has")
      ->needs(given)
      ->check(CLI::Range(1e-6f, 10.0f));
  c.add_option("--groove-width", groove_width, "Of grooves, as a share of a repetition")
      ->needs(given)
      ->check(CLI::Range(1e-3f, 1.0f))
      ->capture_default_str();
  c.add_option("--groove-map", groove_map,
               "A picture over the texture coordinates, white where grooves have their full depth")
      ->needs(given);
}

int run_textured(Context& context, const TexturedRender& o) {
  if (auto ok = check_output(o.view.output, {"png", "exr"}); !ok) return fail(ok.error());
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  if (o.light.env.empty() && o.lamps.empty()) return fail({"--env", "is needed: an environment to light the scene by"});
  auto tile = parse_numbers(o.flags.tile, 2, "--tile");
  if (!tile) return fail(tile.error());
  auto texture = load_zonal_texture(o.flags.texture);
  if (!texture) return fail(texture.error());
  const bool grooves = texture->groove_depth > 0;
  if (!grooves && o.flags.grooves())
    return fail({o.flags.texture, "has no grooves (`lambent patch --groove` makes a table of them)"});
  TextureUse use{{(*tile)[0], (*tile)[1]},
                 o.flags.groove_width,
                 o.flags.groove_depth > 0 ? o.flags.groove_depth : texture->groove_depth,
                 {}};
  if (grooves && use.groove_depth > texture->groove_depth)
    warn(fmt::format("{}: its deepest groove is {:.3g} wide ones deep; deeper ones look like it", o.flags.texture,
                     texture->groove_depth));
  HeightMap map;
  if (!o.flags.groove_map.empty()) {
    auto loaded = load_height_map(o.flags.groove_map);
    if (!loaded) return fail(loaded.error());
    map = std::move(*loaded),
    use.groove_map = [&map](Vec2 uv) { return float(sample_heights(map.values, map.width, map.height, uv)); };
  }
  auto scene = load_scene(o.scene);
  if (!scene) return fail(scene.error());
  warn(scene->warnings);
  if (scene->texcoords[0].empty())
    warn(o.scene + ": has no texture coordinates, so that the transfer texture shows as one colour");
  auto poses = make_poses(o.motion, *scene);
  if (!poses) return fail(poses.error());
  LightOptions distant = o.light;
  if (distant.env.empty()) distant.env = "uniform:0";
  auto env = load_light(distant);
  if (!env) return fail(env.error());
  const int order = o.light_order ? std::min(o.light_order, texture->transfer.order) : texture->transfer.order;
  std::vector<Vec3> light = rotate_sh(make_sh_rotation(order, *rotation), project_environment(*env, order));
  const std::vector<float> window = apply_sh_window(o.window, light);
  light.resize(size_t(sh_count(texture->transfer.order)), Vec3(0.0f));
  const LocalLight local{std::move(light), o.lamps, window};
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
    RenderOptions options{view->width, view->height, o.samples, nullptr, o.show};
    if (o.view.background == "env") options.background = &turned;
    auto image =
        render_transfer_texture(moved, *tracer, *texture, use, local, view->camera, options, &context.progress);
    if (!image) return fail(image.error());
    images.push_back(std::move(*image));
  }
  if (auto ok = save_image(o.view.output, images.size() > 1 ? beside(images) : images.front(), o.view.exposure); !ok)
    return fail(ok.error());
  if (context.json)
    print_json({{"output", o.view.output}, {"texels", texture->transfer.receivers}, {"frames", images.size()}});
  else
    fmt::print("{}\n  {} x {} {} of {} lobes\n", o.view.output, texture->width, texture->height,
               grooves ? "grooves" : "texels", texture->transfer.lobes);
  return success;
}

}  // namespace lambent::tool

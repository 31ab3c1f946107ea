#include "commands.h"
#include "options.h"

#include <lambent/baked/baked_file.h>
#include <lambent/core/file.h>
#include <lambent/pipeline/describe.h>
#include <lambent/pipeline/parse.h>
#include <lambent/pipeline/view_error.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/load.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>

#include <set>

namespace lambent::tool {
namespace {

nlohmann::json vector_json(Vec3 v) { return {v.x, v.y, v.z}; }
nlohmann::json place_json(Vec3 v, Vec3d origin) { return {v.x + origin.x, v.y + origin.y, v.z + origin.z}; }

nlohmann::json describe_scene(const Scene& scene) {
  const Bounds box = bounds(scene);
  size_t two_sided = 0;
  for (const Triangle& t : scene.triangles) two_sided += t.two_sided;
  nlohmann::json materials = nlohmann::json::array();
  for (const Material& m : scene.materials)
    materials.push_back({{"name", m.name},
                         {"base_color", vector_json(m.base_color)},
                         {"textured", m.base_color_texture >= 0},
                         {"double_sided", m.double_sided}});
  return {{"vertices", scene.positions.size()},
          {"triangles", scene.triangles.size()},
          {"two_sided_triangles", two_sided},
          {"parts", scene.parts.size()},
          {"textures", scene.textures.size()},
          {"materials", materials},
          {"bounds", {{"min", place_json(box.min, scene.origin)}, {"max", place_json(box.max, scene.origin)}}},
          {"receivers", make_vertex_receivers(scene).count()},
          {"warnings", scene.warnings}};
}

void print_scene(const nlohmann::json& d) {
  fmt::print("  {} vertices, {} triangles ({} two-sided) in {} parts; {} materials, {} textures\n",
             human_count(d["vertices"].get<size_t>()), human_count(d["triangles"].get<size_t>()),
             human_count(d["two_sided_triangles"].get<size_t>()), d["parts"].get<size_t>(), d["materials"].size(),
             d["textures"].get<size_t>());
  const auto& a = d["bounds"]["min"];
  const auto& b = d["bounds"]["max"];
  fmt::print("  from ({:.4g}, {:.4g}, {:.4g}) to ({:.4g}, {:.4g}, {:.4g})\n", a[0].get<double>(), a[1].get<double>(),
             a[2].get<double>(), b[0].get<double>(), b[1].get<double>(), b[2].get<double>());
  fmt::print("  {} receivers at its vertices\n", human_count(d["receivers"].get<size_t>()));
}

int inspect_picture(Context& context, const std::string& path) {
  std::vector<std::string> warnings;
  auto image = load_image(path, &warnings);
  if (!image) return fail(image.error());
  warn(warnings);
  size_t negative = 0, broken = 0;
  double peak = 0, sum = 0;
  for (Vec3 p : image->rgb) {
    if (!is_finite(p)) {
      ++broken;
      continue;
    }
    negative += p.x < 0 || p.y < 0 || p.z < 0;
    peak = std::max(peak, double(luminance(p))), sum += luminance(p);
  }
  const double mean = sum / double(std::max<size_t>(1, image->rgb.size() - broken));
  if (context.json)
    print_json({{"file", path},
                {"kind", "image"},
                {"width", image->width},
                {"height", image->height},
                {"alpha", !image->alpha.empty()},
                {"mean_luminance", mean},
                {"peak_luminance", peak},
                {"negative_pixels", negative},
                {"non_finite_pixels", broken}});
  else
    fmt::print(
        "{}\n  picture, {} x {}{}\n  luminance: mean {:.4g}, peak {:.4g}; {} pixels with a negative channel, {} not "
        "finite\n",
        path, image->width, image->height, image->alpha.empty() ? "" : ", with alpha", mean, peak, negative, broken);
  return success;
}

int inspect_texture(Context& context, const std::string& path) {
  auto texture = load_zonal_texture(path);
  if (!texture) return fail(texture.error());
  const ZonalTransfer& t = texture->transfer;
  const bool grooves = texture->groove_depth > 0;
  const char* precision = t.precision == Precision::half ? "half" : "single";
  if (context.json)
    print_json({{"file", path},
                {"kind", grooves ? "grooves" : "transfer texture"},
                {"width", texture->width},
                {"height", texture->height},
                {"order", t.order},
                {"lobes", t.lobes},
                {"channels", t.channels},
                {"bytes", t.bytes()},
                {"precision", precision},
                {"groove_depth", grooves ? nlohmann::json(texture->groove_depth) : nlohmann::json()}});
  else
    fmt::print("{}\n  {}: {} x {}, {} zonal lobes, order {}, {} channel{}, {} ({})\n", path,
               grooves ? fmt::format("grooves up to {:.3g} widths deep, places by depths", texture->groove_depth)
                       : "transfer texture",
               texture->width, texture->height, t.lobes, t.order, t.channels, t.channels == 1 ? "" : "s",
               human_bytes(double(t.bytes())), precision);
  return success;
}

int inspect_baked(Context& context, const std::string& path) {
  auto baked = load_baked(path);
  if (!baked) return fail(baked.error());
  nlohmann::json d{{"file", path},
                   {"kind", "baked"},
                   {"scene", describe_scene(baked->scene)},
                   {"transfer", describe(baked->surface)},
                   {"provenance", nlohmann::json::parse(baked->provenance, nullptr, false)}};
  if (const Field* lattice = lattice_of(*baked)) d["lattice"] = describe(*lattice);
  if (!baked->terms.empty()) d["terms"] = baked->terms.size();
  if (context.json) return print_json(d), success;
  fmt::print("{}\n  baked: {}\n", path, describe_in_words(baked->surface));
  if (const Field* lattice = lattice_of(*baked)) fmt::print("  beside it: {}\n", describe_in_words(*lattice));
  if (!baked->terms.empty()) fmt::print("  {} terms of the series\n", baked->terms.size());
  print_scene(d["scene"]);
  fmt::print("  provenance {}\n", d["provenance"].dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  return success;
}

struct InspectCommand {
  std::string path, view_error, camera = "auto", size = "512x512";
};

int paint_error(Context& context, const InspectCommand& o) {
  if (auto ok = check_output(o.view_error, {"png"}); !ok) return fail(Error{"--view-error", ok.error().message, true});
  if (!is_baked(o.path)) return fail(Error{"--view-error", "needs a baked file, and " + o.path + " is none", true});
  auto baked = load_baked(o.path);
  if (!baked) return fail(baked.error());
  auto view = view_error(*baked, o.camera, o.size, {&context.progress, [](const std::string& text) { warn(text); }});
  if (!view) return fail(view.error());
  if (auto ok = save_image(o.view_error, view->image); !ok) return fail(ok.error());
  const Certificate& c = view->certificate;
  nlohmann::json parts = nlohmann::json::object();
  for (size_t p = 0; p < c.parts.size(); ++p)
    if (c.parts[p] >= 0) parts[baked->scene.parts[p].name] = c.parts[p];
  if (context.json) {
    print_json({{"file", o.path},
                {"picture", o.view_error},
                {"error", c.error},
                {"uncertain", c.uncertain},
                {"places", c.places},
                {"scale", view->scale},
                {"parts", parts}});
    return success;
  }
  fmt::print("{}\n  error {:.2f}% RMS (within {:.2f}), measured anew at {} places; of its own light, by part:\n",
             o.path, 100 * c.error, 200 * c.uncertain, human_count(c.places));
  for (const auto& [name, error] : parts.items()) fmt::print("    {:5.1f}%  {}\n", 100 * error.get<double>(), name);
  fmt::print("  {}: from 0 (black) to {:.3g}% (white) of all light's RMS\n", o.view_error, 100 * view->scale);
  return success;
}

int run_inspect(Context& context, const InspectCommand& o) {
  const std::string& path = o.path;
  if (!o.view_error.empty()) return paint_error(context, o);
  const std::string extension = file_extension(path);
  if (extension == "lpt") return inspect_texture(context, path);
  if (std::set<std::string>{"hdr", "exr", "png", "jpg", "jpeg"}.contains(extension))
    return inspect_picture(context, path);
  if ((extension == "glb" || extension == "gltf") && is_baked(path)) return inspect_baked(context, path);
  auto scene = load_scene(path);
  if (!scene) return fail(scene.error());
  nlohmann::json d = describe_scene(*scene);
  d["file"] = path, d["kind"] = "scene";
  if (context.json) {
    print_json(d);
  } else {
    warn(scene->warnings);
    fmt::print("{}\n", path);
    print_scene(d);
  }
  return success;
}

}  // namespace

void add_inspect(CLI::App& app, Run& run) {
  auto o = std::make_shared<InspectCommand>();
  CLI::App* c = app.add_subcommand(
      "inspect", "Say what is in a scene, a baked file, a transfer texture, an environment or a picture");
  c->add_option("file", o->path, "File")->required();
  auto* paint = c->add_option("--view-error", o->view_error,
                              "Picture (.png) to paint of a diffuse bake's error, measured anew, with its scale");
  c->add_option("--camera", o->camera, "Of --view-error: EYE,TARGET,FOV or auto")->needs(paint);
  c->add_option("--size", o->size, "Of --view-error: WIDTHxHEIGHT in pixels")->needs(paint);
  c->callback([o, &run] { run = [o](Context& context) { return run_inspect(context, *o); }; });
}

}  // namespace lambent::tool

#include "commands.h"
#include "options.h"

#include <lambent/baked/baked_file.h>
#include <lambent/core/file.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/load.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>

#include <set>

namespace lambent::tool {
namespace {

nlohmann::json vector_json(Vec3 v) { return {v.x, v.y, v.z}; }

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
          {"bounds", {{"min", vector_json(box.min)}, {"max", vector_json(box.max)}}},
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
  auto image = load_image(path);
  if (!image) return fail(image.error());
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

int inspect_zonal(Context& context, const std::string& path, const Baked& baked) {
  const ZonalTransfer& t = *baked.zonal;
  const nlohmann::json outgoing = baked.outgoing ? nlohmann::json(outgoing_names[int(baked.outgoing->kind)])
                                                 : nlohmann::json();
  const nlohmann::json d{{"file", path},
                         {"kind", "baked"},
                         {"scene", describe_scene(baked.scene)},
                         {"transfer",
                          {{"kind", "zonal"},
                           {"order", t.order},
                           {"lobes", t.lobes},
                           {"rows", t.rows},
                           {"outgoing", outgoing},
                           {"channels", t.channels},
                           {"receivers", t.receivers},
                           {"bytes", t.bytes()},
                           {"precision", t.precision == Precision::half ? "half" : "single"}}},
                         {"provenance", nlohmann::json::parse(baked.provenance, nullptr, false)}};
  if (context.json) return print_json(d), success;
  fmt::print(
      "{}\n  baked: {} zonal lobes{}, order {}, {} channel{}, {} receivers, {} ({})\n", path, t.lobes,
      baked.outgoing ? fmt::format(" in each of {} rows ({})", t.rows, outgoing_names[int(baked.outgoing->kind)]) : "",
      t.order, t.channels, t.channels == 1 ? "" : "s", human_count(t.receivers), human_bytes(double(t.bytes())),
      t.precision == Precision::half ? "half" : "single");
  print_scene(d["scene"]);
  fmt::print("  provenance {}\n", d["provenance"].dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  return success;
}

int inspect_visibility(Context& context, const std::string& path, const Baked& baked) {
  const Visibility& v = *baked.visibility;
  const VisibilityStatistics s = visibility_statistics(v);
  const nlohmann::json d{{"file", path},
                         {"kind", "baked"},
                         {"scene", describe_scene(baked.scene)},
                         {"transfer",
                          {{"kind", "blocks"},
                           {"cube", v.size},
                           {"bits", v.bits},
                           {"receivers", v.receivers},
                           {"bytes", v.data.size()},
                           {"blocked", s.blocked},
                           {"clear", s.clear},
                           {"mixed", s.mixed},
                           {"changes_per_mixed_block", s.changes}}},
                         {"provenance", nlohmann::json::parse(baked.provenance, nullptr, false)}};
  if (context.json) return print_json(d), success;
  fmt::print(
      "{}\n  baked: visibility in blocks, cube {}, {} bit{}, {} receivers, {}; {:.1f} % of blocks mixed, with {:.1f} "
      "changes each\n",
      path, v.size, v.bits, v.bits == 1 ? "" : "s", human_count(v.receivers), human_bytes(double(v.data.size())),
      100 * s.mixed, s.changes);
  print_scene(d["scene"]);
  fmt::print("  provenance {}\n", d["provenance"].dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  return success;
}

int run_inspect(Context& context, const std::string& path) {
  const std::string extension = file_extension(path);
  if (extension == "lpt") return inspect_texture(context, path);
  if (std::set<std::string>{"hdr", "exr", "png", "jpg", "jpeg"}.contains(extension))
    return inspect_picture(context, path);
  if ((extension == "glb" || extension == "gltf") && is_baked(path)) {
    auto baked = load_baked(path);
    if (!baked) return fail(baked.error());
    if (baked->visibility) return inspect_visibility(context, path, *baked);
    if (baked->zonal) return inspect_zonal(context, path, *baked);
    Transfer t = baked->transfer;
    t.light = light_of(*baked);
    if (baked->cpca)
      t.light = baked->cpca->light, t.rows = baked->cpca->rows, t.channels = baked->cpca->channels,
      t.receivers = baked->cpca->receivers;
    const size_t bytes = baked->cpca ? baked->cpca->bytes() : baked->transfer.bytes();
    nlohmann::json lobes = nlohmann::json::array();
    for (const Lobe& l : t.light.lobes) lobes.push_back({{"axis", vector_json(l.axis)}, {"sharpness", l.sharpness}});
    nlohmann::json d{{"file", path},
                     {"kind", "baked"},
                     {"scene", describe_scene(baked->scene)},
                     {"transfer",
                      {{"kind", baked->factors    ? "factors"
                                : baked->outgoing ? "matrix"
                                                  : "diffuse"},
                       {"order", t.light.order},
                       {"lobes", lobes},
                       {"groups", t.light.groups},
                       {"columns", t.columns()},
                       {"rows", t.rows},
                       {"channels", t.channels},
                       {"receivers", t.receivers},
                       {"bytes", bytes},
                       {"precision", t.precision == Precision::half ? "half" : "single"}}},
                     {"provenance", nlohmann::json::parse(baked->provenance, nullptr, false)}};
    if (baked->cpca) d["transfer"]["cpca"] = {{"clusters", baked->cpca->clusters}, {"rank", baked->cpca->rank}};
    if (baked->view) {
      const FixedView& v = *baked->view;
      d["view"] = {{"width", v.width},
                   {"height", v.height},
                   {"eye", vector_json(v.camera.eye)},
                   {"target", vector_json(v.camera.target)},
                   {"fov", v.camera.fov}};
    }
    if (baked->lattice) {
      const LatticeTransfer& l = *baked->lattice;
      d["lattice"] = {{"points", {l.lattice.nx, l.lattice.ny, l.lattice.nz}},
                      {"order", l.order},
                      {"min", vector_json(l.lattice.min)},
                      {"max", vector_json(l.lattice.max)},
                      {"invalid", std::count(l.valid.begin(), l.valid.end(), uint8_t(0))},
                      {"bytes", l.transfer.bytes()}};
    }
    if (context.json) {
      print_json(d);
    } else {
      fmt::print("{}\n  baked: {}, {}, {} column{}, {} row{}, {} channel{}, {} receivers, {} ({})\n", path,
                 baked->factors    ? "factors"
                 : baked->outgoing ? std::string("matrix, outgoing ") + outgoing_names[int(baked->outgoing->kind)]
                                   : "diffuse",
                 describe_light(t.light), t.columns(), t.columns() == 1 ? "" : "s", t.rows, t.rows == 1 ? "" : "s",
                 t.channels, t.channels == 1 ? "" : "s", human_count(t.receivers), human_bytes(double(bytes)),
                 t.precision == Precision::half ? "half" : "single");
      if (baked->cpca) fmt::print("  in {} clusters of rank {}\n", baked->cpca->clusters, baked->cpca->rank);
      if (baked->view) fmt::print("  a fixed view of {} x {} pixels\n", baked->view->width, baked->view->height);
      for (const Lobe& l : t.light.lobes)
        fmt::print("  lobe about ({:.4f}, {:.4f}, {:.4f}), sharpness {:.4g}: {:.2g} degrees across\n", l.axis.x,
                   l.axis.y, l.axis.z, l.sharpness, std::min(180.0, double(degrees(2 / std::sqrt(l.sharpness)))));
      if (baked->lattice)
        fmt::print("  light in free space at {} x {} x {} points, order {}, {}\n", baked->lattice->lattice.nx,
                   baked->lattice->lattice.ny, baked->lattice->lattice.nz, baked->lattice->order,
                   human_bytes(double(baked->lattice->transfer.bytes())));
      print_scene(d["scene"]);
      fmt::print("  provenance {}\n", d["provenance"].dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    }
    return success;
  }
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
  auto path = std::make_shared<std::string>();
  CLI::App* c = app.add_subcommand(
      "inspect", "Say what is in a scene, a baked file, a transfer texture, an environment or a picture");
  c->add_option("file", *path, "File")->required();
  c->callback([path, &run] { run = [path](Context& context) { return run_inspect(context, *path); }; });
}

}  // namespace lambent::tool

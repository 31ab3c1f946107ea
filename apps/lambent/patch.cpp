#include "commands.h"
#include "options.h"
#include "relief.h"

#include <lambent/bake/materials.h>
#include <lambent/bake/subsurface.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/file.h>
#include <lambent/scene/load.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct PatchCommand {
  std::string heights, output, precision = "half", subsurface, floor, brdf, views;
  float depth = 0.1f, albedo = 0.5f, groove = 0, thickness = 0.05f;
  int size = 128, views_a_side = 0;
  BakeOptions bake;
  ZonalFitOptions zonal;

  const std::string& medium() const { return floor.empty() ? subsurface : floor; }
  bool is_mesh() const {
    const std::string extension = file_extension(heights);
    return extension == "glb" || extension == "gltf" || extension == "obj" || extension == "ply";
  }
};

Result<PatchScene> load_height_patch(const PatchCommand& o, double& jump) {
  auto field = load_heights(o.heights, o.size, o.depth);
  if (!field) return field.error();
  jump = seam_jump(*field);
  return make_patch(*field, o.medium().empty() ? Vec3(o.albedo) : Vec3(1));
}

// The relief under its light: at its texels, or, with views, as it is seen through them.
Result<Transfer> bake_patch(const PatchCommand& o, const PatchScene& patch, const Tracer& tracer,
                            const SubsurfaceOptions& subsurface, BakeReport& report, SubsurfaceReport& walks,
                            Progress& progress) {
  if (!o.brdf.empty()) {
    auto reflection = parse_reflection(o.brdf);
    if (!reflection) return reflection.error();
    const MatrixOptions matrix{.incident_order = std::min(6, max_sh_order + 1 - o.bake.order),
                               .outgoing = OutgoingKind::map};
    auto baked = bake_matrix(patch.scene, tracer, patch.receivers,
                             make_receiver_materials(patch.scene, patch.receivers, *reflection), o.bake, matrix,
                             &report, &progress);
    if (!baked) return baked.error();
    return view_patch(patch, tracer, baked->transfer, &baked->outgoing, o.size, o.views_a_side);
  }
  auto transfer = o.medium().empty() ? bake(patch.scene, tracer, patch.receivers, o.bake, &report, &progress)
                                     : bake_subsurface(patch.scene, tracer, patch.receivers, o.bake, subsurface,
                                                       &report, &walks, &progress);
  if (!transfer || !o.views_a_side) return transfer;
  return view_patch(patch, tracer, *transfer, nullptr, o.size, o.views_a_side);
}

Result<PatchScene> load_mesh_patch(const PatchCommand& o, double& jump) {
  auto tile = load_scene(o.heights);
  if (!tile) return tile.error();
  warn(tile->warnings);
  HeightField heights;
  auto patch = make_mesh_patch(*tile, o.size, &heights);
  if (patch) jump = seam_jump(heights);
  return patch;
}

int run_grooves(Context& context, const PatchCommand& o) {
  auto table = make_wrinkle_table({o.bake.order, o.zonal.lobes, o.size, o.groove, o.albedo});
  if (!table) return fail({"--groove", table.error().text(), true});
  if (auto ok = save_zonal_texture(o.output, table->texture); !ok) return fail(ok.error());
  const ZonalTransfer& t = table->texture.transfer;
  if (context.json)
    print_json({{"output", o.output},
                {"size", o.size},
                {"lobes", t.lobes},
                {"order", t.order},
                {"groove_depth", o.groove},
                {"rms", table->rms},
                {"bytes", t.bytes()}});
  else
    fmt::print(
        "{}\n  grooves of {} depths up to {:.3g} widths at {} places across, {} lobes, order {}, {}\n  fitted with an "
        "error of {:.2f}% RMS\n",
        o.output, o.size, o.groove, o.size, t.lobes, t.order, human_bytes(double(t.bytes())), 100 * table->rms);
  return success;
}

int run_patch(Context& context, PatchCommand o) {
  if (auto ok = check_output(o.output, {"lpt"}); !ok) return fail(ok.error());
  if (o.groove != 0) return run_grooves(context, o);
  SubsurfaceOptions subsurface{.period = 1};
  SubsurfaceReport walks;
  if (!o.medium().empty()) {
    auto medium = parse_medium(o.medium());
    if (!medium) return fail({o.floor.empty() ? "--subsurface" : "--floor", medium.error().text(), true});
    subsurface.medium = *medium;
  }
  double jump = 1;
  auto made = o.is_mesh() ? load_mesh_patch(o, jump) : load_height_patch(o, jump);
  if (!made) return fail(made.error());
  PatchScene& patch = *made;
  if (!o.floor.empty()) add_floor(patch, o.thickness);
  if (jump > 3)
    warn(fmt::format("{}: does not tile: it jumps {:.1f} times as far from one repetition to the next as inside",
                     o.heights, jump));
  auto tracer = Tracer::build(patch.scene);
  if (!tracer) return fail(tracer.error());
  o.bake.precision = Precision::single;
  o.zonal.precision = o.precision == "half" ? Precision::half : Precision::single;
  BakeReport report;
  auto transfer = bake_patch(o, patch, *tracer, subsurface, report, walks, context.progress);
  if (!transfer) return fail(transfer.error());
  warn_of_lost_walks(walks);
  ZonalFitReport fit;
  auto lobes = fit_zonal(*transfer, o.zonal, &fit, &context.progress);
  if (!lobes) return fail(lobes.error());
  if (auto ok = save_zonal_texture(o.output, {o.size, o.size, *lobes, 0, o.views_a_side}); !ok) return fail(ok.error());
  nlohmann::json through;
  if (!o.medium().empty()) through = {{"events", walks.events}, {"lost", walks.lost}};
  if (context.json)
    print_json({{"output", o.output},
                {"size", o.size},
                {"lobes", o.zonal.lobes},
                {"views", o.views_a_side * o.views_a_side},
                {"order", o.bake.order},
                {"rays", report.rays},
                {"buried", report.buried},
                {"trace_seconds", report.trace_seconds},
                {"bounce_seconds", report.bounce_seconds},
                {"fit_seconds", fit.seconds},
                {"rms", fit.rms},
                {"bytes", lobes->bytes()},
                {"seam_jump", jump},
                {"subsurface", through}});
  else
    fmt::print(
        "{}\n  {} x {} texels, {} lobes, order {}, {}\n  simulated in {} ({} rays), fitted in {} with an error of "
        "{:.2f}% RMS\n",
        o.output, o.size, o.size, o.zonal.lobes, o.bake.order, human_bytes(double(lobes->bytes())),
        human_seconds(report.trace_seconds + report.bounce_seconds), human_count(report.rays),
        human_seconds(fit.seconds), 100 * fit.rms);
  return success;
}

// What a relief is made of, and from where it is seen; none of it is of grooves.
constexpr const char* looks[] = {"--subsurface", "--floor", "--floor-thickness", "--brdf", "--views"};

void add_looks(CLI::App* c, PatchCommand& o) {
  c->add_option("--subsurface", o.subsurface, std::string(subsurface_help) + "; a unit is one side of the patch");
  auto* floor = c->add_option("--floor", o.floor,
                              "As --subsurface, of a relief that ends in a plane below it, through which light comes "
                              "from behind where it is thin");
  c->add_option("--floor-thickness", o.thickness, "--floor: from the plane to the lowest place, in sides of the patch")
      ->needs(floor)
      ->check(CLI::Range(1e-4f, 10.0f))
      ->capture_default_str();
  c->add_option("--brdf", o.brdf,
                "A model for its surface in place of the diffuse one, as `bake --brdf` takes it; makes it "
                "depend on the view (--views)");
  c->add_option("--views", o.views,
                "NxN: as it is seen from so many directions, one behind the other and hidden by one "
                "another as they are, and glossy; with --brdf 8x8");
}

void check_look(const CLI::App& c, PatchCommand& o) {
  if (c.count("--subsurface") && c.count("--floor"))
    throw CLI::ValidationError("--subsurface is of a relief without a bottom, and --floor of one with: give one");
  if (c.count("--albedo") && !o.medium().empty())
    throw CLI::ValidationError("--albedo is of reflection, and --subsurface and --floor have none: give one");
  if (c.count("--brdf") && !o.medium().empty())
    throw CLI::ValidationError("--brdf is of reflection, and --subsurface and --floor have none: give one");
  if (c.count("--brdf") && o.is_mesh())
    throw CLI::ValidationError("--brdf is of height maps: a mesh is taken as diffuse");
  if (c.count("--views") || c.count("--brdf")) {
    auto sides = parse_size(c.count("--views") ? o.views : "8x8", "--views");
    if (!sides || (*sides)[0] != (*sides)[1] || (*sides)[0] < 2 || (*sides)[0] > max_texture_views)
      throw CLI::ValidationError("--views must be NxN, 2x2 to 32x32, not " + o.views);
    o.views_a_side = (*sides)[0];
  }
}

}  // namespace

void add_patch(CLI::App& app, Run& run) {
  auto o = std::make_shared<PatchCommand>();
  CLI::App* c = app.add_subcommand(
      "patch", "Simulate a repeating relief and make a transfer texture of it, for render --transfer-texture");
  auto* heights = c->add_option("heights", o->heights,
                                "What repeats: a height map, or a mesh (.glb, .gltf, .obj, .ply) that is as wide along "
                                "x as along y and faces +z");
  auto* groove =
      c->add_option(
           "--groove", o->groove,
           "In place of these, a table of grooves of cosine shape up to this depth, in their widths, for wrinkles")
          ->check(CLI::Range(1e-3f, 10.0f));
  c->add_option("-o,--output", o->output, "Transfer texture to write (.lpt)")->required();
  auto* depth =
      c->add_option("--depth", o->depth, "Height of white over black, in sides of the patch")->capture_default_str();
  auto* size = c->add_option("--size", o->size, "Texels a side; places and depths of grooves, 32 of them")
                   ->check(CLI::Range(2, 1024))
                   ->capture_default_str();
  auto* albedo = c->add_option("--albedo", o->albedo, "What the relief reflects of the light that bounces")
                     ->check(CLI::Range(0.0f, 1.0f))
                     ->capture_default_str();
  add_looks(c, *o);
  auto* lobes = c->add_option("--lobes", o->zonal.lobes, "Zonal lobes a texel; of grooves 3")
                    ->check(CLI::Range(1, max_stored_lobes))
                    ->capture_default_str();
  c->add_option("--order", o->bake.order, "Bands of the lighting's spherical harmonics")
      ->check(CLI::Range(1, max_sh_order))
      ->capture_default_str();
  auto* samples =
      c->add_option("--samples", o->bake.samples, "Rays a texel")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  auto* bounces = c->add_option("--bounces", o->bake.bounces, "Reflections between surfaces")
                      ->check(CLI::Range(0, 64))
                      ->capture_default_str();
  auto* seed = c->add_option("--seed", o->bake.seed, "Of the ray directions")->capture_default_str();
  auto* precision = c->add_option("--precision", o->precision, "Of the stored lobes")
                        ->check(CLI::IsMember({"half", "single"}))
                        ->capture_default_str();
  c->callback([o, c, seed, precision, heights, groove, size, lobes, samples, bounces, albedo, depth, &run] {
    if (!heights->count() == !groove->count())
      throw CLI::ValidationError("give a height map or a mesh, or --groove DEPTH, and not both");
    if (groove->count()) {
      std::vector<const CLI::Option*> others{samples, bounces, depth, seed, precision};
      for (const char* name : looks) others.push_back(c->get_option(name));
      for (const CLI::Option* option : others)
        if (option->count())
          throw CLI::ValidationError(option->get_name() +
                                     " is not of grooves, which are computed in their cross-section with all bounces, "
                                     "and kept in single precision");
      if (!size->count()) o->size = 32;
      if (!lobes->count()) o->zonal.lobes = 3;
    }
    check_look(*c, *o);
    if (o->is_mesh() && (albedo->count() || depth->count()))
      throw CLI::ValidationError("--albedo and --depth are of height maps: a mesh has its own");
    run = [o](Context& context) { return run_patch(context, *o); };
  });
}

}  // namespace lambent::tool

#include "commands.h"
#include "options.h"

#include <lambent/bake/patch.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/file.h>
#include <lambent/image/image.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct PatchCommand {
  std::string heights, output, precision = "half";
  float depth = 0.1f, albedo = 0.5f;
  int size = 128;
  BakeOptions bake;
  ZonalFitOptions zonal;
};

int run_patch(Context& context, PatchCommand o) {
  if (auto ok = check_output(o.output, {"lpt"}); !ok) return fail(ok.error());
  auto picture = load_image(o.heights);
  if (!picture) return fail(picture.error());
  // A height is what the file holds: the curve that loading undoes in PNG and JPEG is put back.
  const std::string extension = file_extension(o.heights);
  const bool encoded = extension == "png" || extension == "jpg" || extension == "jpeg";
  std::vector<float> values;
  for (Vec3 p : picture->rgb) values.push_back(encoded ? srgb_encode(luminance(p)) : luminance(p));
  auto field = make_height_field(values, picture->width, picture->height, o.size, o.depth);
  if (!field) return fail({o.heights, field.error().text()});
  const double jump = seam_jump(*field);
  if (jump > 3) warn(fmt::format("{}: does not tile: it jumps {:.1f} times as far from one repetition to the next as inside", o.heights, jump));

  const PatchScene patch = make_patch(*field, Vec3(o.albedo));
  auto tracer = Tracer::build(patch.scene);
  if (!tracer) return fail(tracer.error());
  o.bake.precision = Precision::single;
  o.zonal.precision = o.precision == "half" ? Precision::half : Precision::single;
  BakeReport report;
  auto transfer = bake(patch.scene, *tracer, patch.receivers, o.bake, &report, &context.progress);
  if (!transfer) return fail(transfer.error());
  ZonalFitReport fit;
  auto lobes = fit_zonal(*transfer, o.zonal, &fit, &context.progress);
  if (!lobes) return fail(lobes.error());
  if (auto ok = save_zonal_texture(o.output, {o.size, o.size, *lobes}); !ok) return fail(ok.error());
  if (context.json)
    print_json({{"output", o.output}, {"size", o.size}, {"lobes", o.zonal.lobes}, {"order", o.bake.order}, {"rays", report.rays}, {"trace_seconds", report.trace_seconds},
                {"bounce_seconds", report.bounce_seconds}, {"fit_seconds", fit.seconds}, {"rms", fit.rms}, {"bytes", lobes->bytes()}, {"seam_jump", jump}});
  else
    fmt::print("{}\n  {} x {} texels, {} lobes, order {}, {}\n  simulated in {} ({} rays), fitted in {} with an error of {:.2f}% RMS\n", o.output, o.size, o.size,
               o.zonal.lobes, o.bake.order, human_bytes(double(lobes->bytes())), human_seconds(report.trace_seconds + report.bounce_seconds), human_count(report.rays),
               human_seconds(fit.seconds), 100 * fit.rms);
  return success;
}

}  // namespace

void add_patch(CLI::App& app, Run& run) {
  auto o = std::make_shared<PatchCommand>();
  CLI::App* c = app.add_subcommand("patch", "Simulate a repeating relief and make a transfer texture of it, for render --transfer-texture");
  c->add_option("heights", o->heights, "Height map: a picture that tiles")->required();
  c->add_option("-o,--output", o->output, "Transfer texture to write (.lpt)")->required();
  c->add_option("--depth", o->depth, "Height of white over black, in sides of the patch")->capture_default_str();
  c->add_option("--size", o->size, "Texels a side")->check(CLI::Range(2, 1024))->capture_default_str();
  c->add_option("--albedo", o->albedo, "What the relief reflects of the light that bounces")->check(CLI::Range(0.0f, 1.0f))->capture_default_str();
  c->add_option("--lobes", o->zonal.lobes, "Zonal lobes a texel")->check(CLI::Range(1, max_stored_lobes))->capture_default_str();
  c->add_option("--order", o->bake.order, "Bands of the lighting's spherical harmonics")->check(CLI::Range(1, max_sh_order))->capture_default_str();
  c->add_option("--samples", o->bake.samples, "Rays a texel")->check(CLI::Range(1, 1 << 20))->capture_default_str();
  c->add_option("--bounces", o->bake.bounces, "Reflections between surfaces")->check(CLI::Range(0, 64))->capture_default_str();
  c->add_option("--seed", o->bake.seed, "Of the ray directions")->capture_default_str();
  c->add_option("--precision", o->precision, "Of the stored lobes")->check(CLI::IsMember({"half", "single"}))->capture_default_str();
  c->callback([o, &run] { run = [o](Context& context) { return run_patch(context, *o); }; });
}

}  // namespace lambent::tool

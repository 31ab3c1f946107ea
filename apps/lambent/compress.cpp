#include "commands.h"
#include "options.h"

#include <lambent/baked/baked_file.h>
#include <lambent/compress/cpca.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/clock.h>
#include <lambent/render/render.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

struct CompressCommand {
  std::string baked, output, cpca, error_picture, precision = "half";
  ZonalFitOptions zonal;
  std::string camera = "auto", size = "512x512";
  float white = 0.1f;
};

// The relative error of each receiver's fit as a false colour on the mesh; `white` is the brightest.
Result<Image> paint_errors(const Baked& baked, const std::vector<float>& errors, const CompressCommand& o,
                           Progress* progress) {
  ViewOptions view_options;
  view_options.camera = o.camera, view_options.size = o.size;
  auto view = make_view(view_options, baked.scene);
  if (!view) return view.error();
  auto tracer = Tracer::build(baked.scene);
  if (!tracer) return tracer.error();
  Relit relit;
  relit.values.resize((errors.size() + transfer_block - 1) / transfer_block * 3 * transfer_block);
  for (size_t r = 0; r < errors.size(); ++r) {
    const Vec3 colour = false_color(errors[r] / o.white);
    for (size_t c = 0; c < 3; ++c)
      relit.values[(r / transfer_block * 3 + c) * transfer_block + r % transfer_block] = colour[int(c)];
  }
  RenderOptions options;
  options.width = view->width, options.height = view->height, options.show = RenderOptions::Show::radiosity;
  auto image =
      render(baked.scene, *tracer, std::get<CornerReceivers>(baked.basis), relit, view->camera, options, progress);
  if (!image) return image;
  image->alpha.clear();
  draw_text(*image, 6, 6, fmt::format("white: {:.3g}%", 100 * o.white), Vec3(1.0f));
  return image;
}

nlohmann::json provenance_of(const Baked& baked) {
  auto provenance = nlohmann::json::parse(baked.provenance, nullptr, false);
  return provenance.is_object() ? provenance : nlohmann::json::object();
}

// What of a field counts as its size in a file: the store, and the errors of a fit.
size_t size_of(const Field& field) { return bytes_of(field.store) + field.fit_errors.size() * sizeof(float); }

// Puts the smaller store into the place of the larger, and writes the file as viewers know it.
Result<void> save_smaller(const CompressCommand& o, Baked& baked, Field smaller, const nlohmann::json& provenance) {
  const size_t before = size_of(baked.surface), after = size_of(smaller);
  if (after > before)
    return Error{o.baked,
                 fmt::format("would grow: as {} its transfer takes {} bytes, and {} as it is{}", name_of(smaller.store),
                             after, before,
                             std::holds_alternative<ZonalTransfer>(smaller.store)
                                 ? "; for surfaces that move, `bake --transfer zonal` makes lobes of any number"
                                 : "")};
  auto file = MappedFile::open(o.baked);
  if (!file) return file.error();
  const std::optional<ViewerLook> look = load_look(*file, o.baked);
  baked.surface = std::move(smaller), baked.provenance = provenance.dump(), baked.terms.clear();
  for (const std::string& part : files_of(o.baked)) allow_replacing(part);  // by less of the same
  return save_baked(o.output, baked, look ? &*look : nullptr);
}

// Of the files, as they lie on the disk.
struct Sizes {
  double before = 0, after = 0;
};
Sizes sizes_of(const CompressCommand& o, size_t before) { return {double(before), double(bytes_on_disk(o.output))}; }

int compress_to_clusters(Context& context, const CompressCommand& o, Baked& baked, size_t size_before) {
  CpcaOptions options;
  if (auto ok = parse_cpca("cpca:" + o.cpca, options); !ok) return fail({"--cpca", ok.error().message, true});
  const auto* dense = std::get_if<Transfer>(&baked.surface.store);
  if (!dense || std::holds_alternative<FixedView>(baked.surface.where))
    return fail({o.baked, "holds no plain transfer at receivers on surfaces, which is what clusters are made of"});
  double error = 0;
  const auto start = Clock::now();
  auto clusters = compress_cpca(*dense, options, &error, &context.progress);
  if (!clusters) return fail({o.baked, clusters.error().text()});
  const double seconds = seconds_since(start);
  const size_t receivers = clusters->receivers;
  const int count = clusters->clusters, rank = clusters->rank;
  nlohmann::json provenance = provenance_of(baked);
  provenance["cpca"] = {{"clusters", count}, {"rank", rank}, {"error", error}};
  if (!baked.terms.empty()) warn(o.baked + ": the terms of its series are left out: clusters have none");
  Field field{baked.surface.where, std::move(*clusters), baked.surface.rows};
  if (auto ok = save_smaller(o, baked, std::move(field), provenance); !ok) return fail(ok.error());
  const Sizes sizes = sizes_of(o, size_before);
  if (context.json)
    print_json({{"output", o.output},
                {"receivers", receivers},
                {"clusters", count},
                {"rank", rank},
                {"error", error},
                {"seconds", seconds},
                {"bytes", sizes.after},
                {"bytes_before", sizes.before}});
  else
    fmt::print(
        "{}\n  error      {:.2f}% RMS of the transfer\n  time       {} for {} receivers\n  size       {}, {} before "
        "({} "
        "clusters of rank {})\n",
        o.output, 100 * error, human_seconds(seconds), human_count(receivers), human_bytes(sizes.after),
        human_bytes(sizes.before), count, rank);
  return success;
}

int compress_to_lobes(Context& context, CompressCommand& o, Baked& baked, size_t size_before) {
  const auto* dense = std::get_if<Transfer>(&baked.surface.store);
  if (!dense || !vertices_of(baked) || directional_of(baked.surface) != DirectionalKind::none)
    return fail({o.baked, "holds no transfer of spherical harmonics at vertices, which is what lobes are fitted to"});
  if (lattice_of(baked)) warn(o.baked + ": light in free space is left out: lobes have none");
  if (!baked.terms.empty()) warn(o.baked + ": the terms of its series are left out: lobes have none");
  ZonalFitReport report;
  if (const Outgoing* outgoing = outgoing_of(baked.surface)) o.zonal.row_weights = row_weights(*outgoing);
  auto fit = fit_zonal(*dense, o.zonal, &report, &context.progress);
  if (!fit) return fail({o.baked, fit.error().text()});
  nlohmann::json provenance = provenance_of(baked);
  provenance["zonal"] = {{"lobes", fit->lobes},    {"starts", o.zonal.starts}, {"retry", o.zonal.retry},
                         {"ridge", o.zonal.ridge}, {"seed", o.zonal.seed},     {"rms", report.rms}};
  baked.more.clear();
  Field field{baked.surface.where, *fit, baked.surface.rows, report.errors};
  if (auto ok = save_smaller(o, baked, std::move(field), provenance); !ok) return fail(ok.error());
  if (!o.error_picture.empty()) {
    auto image = paint_errors(baked, report.errors, o, &context.progress);
    if (!image) return fail(image.error());
    if (auto ok = save_image(o.error_picture, *image); !ok) return fail(ok.error());
  }

  std::vector<float> sorted = report.errors;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted.empty() ? 0 : sorted[sorted.size() / 2], worst = sorted.empty() ? 0 : sorted.back();
  const Sizes sizes = sizes_of(o, size_before);
  if (context.json)
    print_json({{"output", o.output},
                {"receivers", fit->receivers},
                {"lobes", fit->lobes},
                {"rows", fit->rows},
                {"channels", fit->channels},
                {"rms", report.rms},
                {"median", median},
                {"worst", worst},
                {"seconds", report.seconds},
                {"retried", report.retried},
                {"bytes", sizes.after},
                {"bytes_before", sizes.before}});
  else
    fmt::print(
        "{}\n  error      {:.2f}% RMS of the transfer; receivers: median {:.2f}%, worst {:.1f}%\n  time       {} for "
        "{} receivers\n"
        "  size       {}, {} before ({} lobes{}, order {}, {} channel{})\n",
        o.output, 100 * report.rms, 100 * median, 100 * worst, human_seconds(report.seconds),
        human_count(fit->receivers), human_bytes(sizes.after), human_bytes(sizes.before), fit->lobes,
        fit->rows > 1 ? fmt::format(" in each of {} rows", fit->rows) : "", fit->order, fit->channels,
        fit->channels == 1 ? "" : "s");
  return success;
}

int run_compress(Context& context, CompressCommand o) {
  if (auto ok = check_output(o.output, {"glb", "gltf"}); !ok) return fail(ok.error());
  if (!o.error_picture.empty())
    if (auto ok = check_output(o.error_picture, {"png", "exr"}); !ok) return fail(ok.error());
  o.zonal.precision = o.precision == "half" ? Precision::half : Precision::single;
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  const size_t before = bytes_on_disk(o.baked);  // the output may take its place
  if (std::holds_alternative<Visibility>(baked->surface.store))
    return fail({o.baked, "holds no transfer to compress, but visibility in blocks"});
  if (std::holds_alternative<HaarTransfer>(baked->surface.store))
    return fail({o.baked,
                 "holds transfer in wavelets, which is compressed as it is baked: bake --light haar:...,error="
                 "or keep="});
  return o.cpca.empty() ? compress_to_lobes(context, o, *baked, before)
                        : compress_to_clusters(context, o, *baked, before);
}

}  // namespace

void add_compress(CLI::App& app, Run& run) {
  auto o = std::make_shared<CompressCommand>();
  CLI::App* c = app.add_subcommand(
      "compress", "Store baked transfer in less: zonal lobes, which turn with a surface that moves, or clusters");
  c->add_option("baked", o->baked, "Baked file, from `lambent bake`")->required();
  auto* cpca = c->add_option(
      "--cpca", o->cpca, "CLUSTERS,RANK: clusters of receivers with like transfer, each a mean and so many components");
  auto* zonal = c->add_option("--zonal", o->zonal.lobes, "Lobes a receiver; of a matrix, a row")
                    ->check(CLI::Range(1, max_stored_lobes));
  c->add_option("-o,--output", o->output, "Baked file to write: .glb, or .gltf with its data beside it")->required();
  c->add_option("--starts", o->zonal.starts, "Searches from random axes where the error is high")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  c->add_option("--retry", o->zonal.retry, "What error is high, relative")
      ->check(CLI::Range(0.0f, 1.0f))
      ->capture_default_str();
  c->add_option("--ridge", o->zonal.ridge, "What squared coefficients count in the squared error")
      ->check(CLI::Range(0.0f, 1.0f))
      ->capture_default_str();
  c->add_option("--seed", o->zonal.seed, "Of the random axes")->capture_default_str();
  c->add_option("--precision", o->precision, "Of the stored lobes")
      ->check(CLI::IsMember({"half", "single"}))
      ->capture_default_str();
  auto* picture =
      c->add_option("--view-error", o->error_picture, "Picture of the fit's error on the mesh (.png or .exr)");
  c->add_option("--camera", o->camera, "For --view-error, as for render")->needs(picture)->capture_default_str();
  c->add_option("--size", o->size, "For --view-error, as for render")->needs(picture)->capture_default_str();
  c->add_option("--white", o->white, "For --view-error: the relative error drawn white")
      ->needs(picture)
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  cpca->excludes(zonal)->excludes(picture);
  c->callback([o, cpca, zonal, &run] {
    if (!cpca->count() && !zonal->count()) throw CLI::ValidationError("give --zonal LOBES or --cpca CLUSTERS,RANK");
    run = [o](Context& context) { return run_compress(context, *o); };
  });
}

}  // namespace lambent::tool

#include "commands.h"
#include "options.h"
#include "truth.h"

#include <lambent/bake/adapt.h>
#include <lambent/bake/bake.h>
#include <lambent/baked/baked_file.h>
#include <lambent/core/clock.h>
#include <lambent/core/file.h>
#include <lambent/light/peaks.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/pipeline/version.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/relight.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <filesystem>

namespace lambent::tool {
namespace {

struct DemoCommand {
  std::string folder = "out";
  int spp = 128, width = 320, height = 240;
  float detail = 1;
  std::string at(const std::string& name) const { return folder + "/" + name; }
};

struct Hour {
  const char* name;
  float elevation, azimuth;
};
constexpr Hour hours[] = {{"morning", 22, 160}, {"noon", 68, 75}, {"evening", 9, 35}};

struct Row {
  std::string name;
  ImageDifference order6, sky;
  double noise_psnr;  // of the reference under the order-6 light, against the truth it converges to
  double relight_ms, reference_seconds;
};

// What the hours share.
struct Courtyard {
  const Scene& scene;
  const Tracer& tracer;
  const CornerReceivers& corners;
  const Transfer& transfer;
  BakeOptions options;
  Camera camera = courtyard_camera();
};

// One sky: relit, judged, and written; `shown_picture` is what to look at, as the screen shows it.
Result<Row> draw_hour(const DemoCommand& o, const Courtyard& yard, const Hour& hour, Relit& relit, Image& shown_picture,
                      Progress& progress) {
  const auto& [scene, tracer, corners, transfer, options, camera] = yard;
  SkyOptions sky;
  sky.elevation = hour.elevation, sky.azimuth = hour.azimuth;
  auto env = make_sky(sky);
  if (!env) return env.error();
  const std::vector<Vec3> light = project_environment(*env, options.order);
  Relit peaks;
  relight(transfer, light, relit);  // the first call sizes the output
  const auto start = Clock::now();
  relight(transfer, light, relit);
  Row row{hour.name, {}, {}, 0, 1e3 * seconds_since(start), 0};

  const Environment smooth = reconstruct_environment(light);
  const RenderOptions view{o.width, o.height, 64};
  const std::vector<Vec3> rest = project_environment(without_peaks(*env, options.order), options.order);
  auto picture = render(scene, tracer, corners, relit, camera, view, &progress);
  if (!picture) return picture.error();
  const Display display{auto_exposure({&*picture, 1}), Tone::neutral};
  ReferenceOptions truth;
  truth.width = o.width, truth.height = o.height, truth.spp = o.spp, truth.bounces = options.bounces,
  truth.background = false;
  const auto traced = Clock::now();
  auto same_light = trace_truth(scene, smooth, camera, truth, display, progress);
  if (!same_light) return same_light.error();
  row.reference_seconds = seconds_since(traced);
  auto full_light = trace_truth(scene, *env, camera, truth, display, progress);
  if (!full_light) return full_light.error();
  auto d6 = compare_images(*picture, same_light->image, display),
       dsky = compare_images(*picture, full_light->image, display);
  if (!d6) return d6.error();
  if (!dsky) return dsky.error();
  row.order6 = *d6, row.sky = *dsky, row.noise_psnr = same_light->noise_psnr;

  // The pictures to look at have the sky behind them, and do not ring.
  std::vector<Vec3> peaked = light;
  for (size_t k = 0; k < peaked.size(); ++k) peaked[k] -= rest[k];
  relight(transfer, peaked, peaks);
  dering(relit, peaks);
  RenderOptions shown{o.width * 3 / 2, o.height * 3 / 2, 32, &*env};
  auto pretty = render(scene, tracer, corners, relit, camera, shown, &progress);
  if (!pretty) return pretty.error();
  shown_picture = *pretty;
  for (Vec3& c : shown_picture.rgb) c = lambent::shown(c, display);
  const std::pair<std::string, Image> files[] = {
      {"relit_" + row.name, std::move(*pretty)},
      {"reference_" + row.name, same_light->image},
      {"reference_sky_" + row.name, full_light->image},
      {"error_" + row.name, difference_picture(*picture, same_light->image, display)}};
  for (const auto& [name, image] : files) {
    // Error maps are already pictures of displayed values.
    if (auto ok = save_image(o.at(name + ".png"), image, name.starts_with("error") ? Display() : display); !ok)
      return ok.error();
    if (name.starts_with("relit"))
      if (auto ok = save_image(o.at(name + ".exr"), image); !ok) return ok.error();
  }
  return row;
}

struct Said {
  nlohmann::json json;
  std::string table;
};
Said summarize(const Scene& scene, const BakeReport& report, const BakeOptions& options, const std::vector<Row>& rows) {
  nlohmann::json json{{"scene", {{"vertices", scene.positions.size()}, {"triangles", scene.triangles.size()}}},
                      {"bake",
                       {{"receivers", report.receivers},
                        {"rays", report.rays},
                        {"trace_seconds", report.trace_seconds},
                        {"bounce_seconds", report.bounce_seconds},
                        {"bytes_per_receiver", double(report.bytes) / double(report.receivers)},
                        {"error", report.error}}},
                      {"rows", nlohmann::json::array()}};
  std::string table = fmt::format(
      "Courtyard: {} vertices, {} receivers, {} rays; traced in {}, {} bounces in {}; {:.0f} bytes a receiver; "
      "error {:.2f}% RMS\n\n"
      "| sky | relight, ms | against the reference under the same order-{} light: PSNR, dB | FLIP | noise of that "
      "reference alone, dB | against the full sky: PSNR, dB | FLIP | reference, s |\n"
      "|---|---|---|---|---|---|---|---|\n",
      human_count(scene.positions.size()), human_count(report.receivers), human_count(report.rays),
      human_seconds(report.trace_seconds), options.bounces, human_seconds(report.bounce_seconds),
      double(report.bytes) / double(report.receivers), 100 * report.error, options.order);
  for (const Row& r : rows) {
    table += fmt::format("| {} | {:.2f} | {:.1f} | {:.3f} | {:.1f} | {:.1f} | {:.3f} | {:.1f} |\n", r.name,
                         r.relight_ms, r.order6.psnr, r.order6.flip, r.noise_psnr, r.sky.psnr, r.sky.flip,
                         r.reference_seconds);
    json["rows"].push_back({{"sky", r.name},
                            {"relight_ms", r.relight_ms},
                            {"psnr", r.order6.psnr},
                            {"flip", r.order6.flip},
                            {"reference_noise_psnr", r.noise_psnr},
                            {"psnr_full_sky", r.sky.psnr},
                            {"flip_full_sky", r.sky.flip},
                            {"reference_seconds", r.reference_seconds}});
  }
  return {std::move(json), std::move(table)};
}

int run_demo(Context& context, const DemoCommand& o) {
  std::error_code status;
  std::filesystem::create_directories(o.folder, status);
  if (!std::filesystem::is_directory(o.folder)) return fail({o.folder, "cannot be made: " + status.message()});
  auto at = [&](const std::string& name) { return o.at(name); };

  constexpr double error = 0.01;  // as --quality final
  Scene scene = make_courtyard(o.detail);
  if (auto split = adapt(scene, {.error = 0.8 * error}, &context.progress); !split) return fail(split.error());
  auto tracer = Tracer::build(scene);
  if (!tracer) return fail(tracer.error());
  const Receivers receivers = make_vertex_receivers(scene);
  const CornerReceivers corners = corner_receivers(scene, receivers.front, receivers.back);
  BakeOptions options;
  options.error = error;
  BakeReport report;
  auto transfer = bake(scene, *tracer, receivers, options, &report, &context.progress);
  if (!transfer) return fail(transfer.error());
  Baked baked = make_baked(scene, receivers, *transfer, DiffuseRows{});
  baked.provenance =
      nlohmann::json{{"generator", std::string("lambent ") + version},
                     {"input", "courtyard (built in)"},
                     {"options", {{"order", options.order}, {"samples", report.samples}, {"bounces", options.bounces}}}}
          .dump();
  if (auto ok = save_baked(at("courtyard.glb"), baked); !ok) return fail(ok.error());

  const Courtyard yard{scene, *tracer, corners, *transfer, options};
  std::vector<Row> rows;
  std::vector<Image> relit_pictures;
  Relit relit;
  for (const Hour& hour : hours) {
    relit_pictures.emplace_back();
    auto row = draw_hour(o, yard, hour, relit, relit_pictures.back(), context.progress);
    if (!row) return fail(row.error());
    rows.push_back(std::move(*row));
  }

  if (auto ok = save_image(at("courtyard.png"), beside(relit_pictures)); !ok) return fail(ok.error());

  const Said said = summarize(scene, report, options, rows);
  if (auto ok = write_file_atomically(at("summary.md"), said.table); !ok) return fail(ok.error());
  if (context.json) print_json(said.json);
  else fmt::print("{}\nPictures and table are in {}/\n", said.table, o.folder);
  return success;
}

}  // namespace

void add_demo(CLI::App& app, Run& run) {
  auto o = std::make_shared<DemoCommand>();
  CLI::App* c =
      app.add_subcommand("demo", "Bake the built-in courtyard, relight it under three skies, judge it by path tracing");
  c->add_option("-o,--output", o->folder, "Folder to write to")->capture_default_str();
  c->add_option("--spp", o->spp, "Paths a pixel of the reference")
      ->check(CLI::Range(1, 1 << 16))
      ->capture_default_str();
  c->add_option("--detail", o->detail, "Tessellation of the scene; 1 is 50,000 vertices and more")
      ->check(CLI::Range(0.05f, 8.0f))
      ->capture_default_str();
  c->callback([o, &run] { run = [o](Context& context) { return run_demo(context, *o); }; });
}

}  // namespace lambent::tool

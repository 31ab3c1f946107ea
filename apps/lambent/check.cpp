// `lambent check`: a bake beside the path tracer's picture of the same scene and light, in one page.
#include "commands.h"
#include "options.h"
#include "table.h"
#include "truth.h"

#include <lambent/core/file.h>
#include <lambent/core/clock.h>
#include <lambent/light/project.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/text.h>
#include <lambent/relight/light.h>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace lambent::tool {
namespace {

struct CheckCommand {
  BakeRequest request;
  LightOptions light;
  std::string camera = "auto", size = "320x240", tone = "neutral", output;
  int paths = 512;
};

struct Panel {
  std::string title;
  Image image;
  bool is_map = false;  // colours of a scale, not light
};

// Of the bake against a reference, and how far two halves of that are from its mean.
struct Judged {
  ImageDifference difference;
  double noise = 0;  // dB: of the reference alone, against the truth that it tends to
};

struct Report {
  std::string scene, light;
  Summary bake;
  double bake_seconds = 0, reference_seconds = 0, energy = 1;
  size_t bytes = 0;
  Display display;
  Clipping clipped;
  Judged same;                 // under the light that the bake knows
  std::optional<Judged> full;  // under all of it
  std::vector<Panel> panels;
  std::vector<std::string> advice;
};

std::string base64(std::span<const uint8_t> bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t three = 0;
    for (size_t k = 0; k < 3; ++k) three = three << 8 | (i + k < bytes.size() ? bytes[i + k] : 0u);
    for (size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[three >> (18 - 6 * k) & 63];
  }
  return out;
}

std::string escaped(const std::string& text) {
  std::string out;
  for (char c : text)
    out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

// FLIP's map, black where neither picture is covered.
Image error_map(const Image& ours, const Image& truth, const Display& display) {
  Image map(ours.width, ours.height);
  const std::vector<float> flip = flip_map(displayed(truth, display), displayed(ours, display));
  for (size_t i = 0; i < flip.size(); ++i) map.rgb[i] = false_color(flip[i]);
  return map;
}

void advise(Report& r, const Baked& baked, const BakeRequest& request) {
  const LightBasis basis = light_of(baked.surface.store);
  if (r.energy < 0.8)
    r.advice.push_back(
        fmt::format("{} bands keep {:.0f} % of this light's squared radiance: the rest is sharper than they "
                    "are. --light sh:{}+lamps:4@ENV keeps its lamps, --transfer blocks all of it",
                    basis.order, 100 * r.energy, basis.order));
  if (r.clipped.negative > 0.01)
    r.advice.push_back(
        fmt::format("{:.1f} % of the pixels are darker than black: harmonics of a sharp lamp ring. A bake with "
                    "--light sh:N+lamps:4@ENV or --transfer blocks holds the lamps",
                    100 * r.clipped.negative));
  const double mean = r.same.difference.mean_b > 0 ? r.same.difference.mean_a / r.same.difference.mean_b : 1;
  if (r.same.difference.psnr < std::min(r.same.noise - 3, 40.0)) {
    r.advice.push_back(
        fmt::format("The bake is {:.1f} dB from the reference, whose own noise allows {:.1f}{}. Where the "
                    "map shows whole faces, they are too large: --quality final or --max-edge splits them; "
                    "where it shows grain, {} has half the noise",
                    r.same.difference.psnr, r.same.noise,
                    std::abs(mean - 1) > 0.02 ? fmt::format(", its mean {:.2f} of the truth's", mean) : "",
                    request.samples > 0 ? fmt::format("--samples {}", 3 * request.samples) : "half the --error"));
  } else if (r.same.difference.psnr < 40 && r.same.noise < 43) {
    r.advice.push_back("The reference's noise is what limits these figures: --paths traces more");
  }
  if (r.advice.empty()) r.advice.push_back("Nothing to mend");
}

std::string row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(name), escaped(value));
}

std::string judged_row(const std::string& name, const Judged& j) {
  return row(name,
             fmt::format("{:.1f} dB (noise of the reference allows {:.1f}), FLIP {:.3f}, relative MSE {:.2g}, mean "
                         "{:.3f} against {:.3f}",
                         j.difference.psnr, j.noise, j.difference.flip, j.difference.relative_mse, j.difference.mean_a,
                         j.difference.mean_b));
}

Result<std::string> page_of(const Report& r) {
  std::string out = fmt::format(
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\n<style>body{{font:15px/1.4 "
      "sans-serif;margin:2em auto;max-width:70em;padding:0 "
      "1em;color:#222;background:#fff}}figure{{display:inline-block;"
      "margin:0 .6em 1em "
      "0}}img{{display:block;max-width:100%}}th{{text-align:left;vertical-align:top;padding-right:1.2em;"
      "font-weight:600}}</style>\n<h1>{0}</h1>\n<p>Under {1}.</p>\n",
      escaped(r.scene), escaped(r.light));
  for (const Panel& p : r.panels) {
    auto png = encode_png(p.image, p.is_map ? Display() : r.display, p.title);
    if (!png) return png.error();
    out +=
        fmt::format("<figure><img src=\"data:image/png;base64,{}\" alt=\"{}\"><figcaption>{}</figcaption></figure>\n",
                    base64(*png), escaped(p.title), escaped(p.title));
  }
  out += "<h2>What to do</h2>\n<ul>\n";
  for (const std::string& line : r.advice) out += "<li>" + escaped(line) + "</li>\n";
  out += "</ul>\n<h2>Figures</h2>\n<table>\n" + judged_row("against the same light", r.same);
  if (r.full) out += judged_row("against all of the light", *r.full);
  out += row("light within the bands", fmt::format("{:.1f} % of its squared radiance", 100 * r.energy)) +
         row("shown", fmt::format("{:+.2f} stops; {:.1f} % white, {:.1f} % darker than black", r.display.exposure,
                                  100 * r.clipped.white, 100 * r.clipped.negative)) +
         row("time", fmt::format("{} to bake, {} to path-trace", human_seconds(r.bake_seconds),
                                 human_seconds(r.reference_seconds))) +
         row("transfer", human_bytes(double(r.bytes)));
  for (const auto& [label, text] : r.bake.lines) out += row(label, text);
  return out + "</table>\n</html>\n";
}

nlohmann::json json_of(const Judged& j) {
  return {{"psnr", std::isfinite(j.difference.psnr) ? nlohmann::json(j.difference.psnr) : nlohmann::json()},
          {"noise_psnr", j.noise},
          {"flip", j.difference.flip},
          {"relative_mse", j.difference.relative_mse},
          {"mean", j.difference.mean_a},
          {"mean_reference", j.difference.mean_b}};
}

// Traces the reference under `env`, and judges the bake's picture by it.
Result<Judged> judge(Report& r, const Image& ours, const std::string& title, const Scene& scene, const Environment& env,
                     const Camera& camera, const ReferenceOptions& options, Progress& progress) {
  auto truth = trace_truth(scene, env, camera, options, r.display, progress);
  if (!truth) return truth.error();
  auto difference = compare_images(ours, truth->image, r.display);
  if (!difference) return difference.error();
  r.panels.push_back({"FLIP against it: black is none, white all", error_map(ours, truth->image, r.display), true});
  r.panels.insert(r.panels.end() - 1, {title, std::move(truth->image)});
  return Judged{*difference, truth->noise_psnr};
}

// Bakes, draws, and traces what the bake should be.
Result<Report> check(const CheckCommand& o, const Job& job) {
  Report r{.scene = o.request.scene, .light = o.light.env};
  auto env = load_light(o.light);
  if (!env) return env.error();
  auto rotation = light_rotation(o.light);
  if (!rotation) return rotation.error();
  auto start = Clock::now();
  auto outcome = bake_with_summary(o.request, job);
  if (!outcome) return outcome.error();
  r.bake_seconds = seconds_since(start), r.bake = outcome->summary;
  const Baked& baked = outcome->baked;
  const LightBasis basis = light_of(baked.surface.store);
  DrawRequest drawn{.baked = o.request.scene,
                    .env = o.light.env,
                    .env_rotate = o.light.rotate,
                    .camera = o.camera,
                    .size = o.size,
                    .background = "none",
                    .spp = 64,
                    .tone = o.tone};
  auto drawing = draw(baked, drawn, job);
  if (!drawing) return drawing.error();
  const Image& ours = drawing->frames.front();
  auto display = parse_display("auto", o.tone, drawing->frames);
  if (!display) return display.error();
  r.display = *display, r.clipped = clipping(drawing->frames, *display), r.bytes = bytes_of(baked.surface.store);
  r.panels.push_back({"Baked", ours});

  auto view = parse_view(o.camera, o.size, baked.scene);
  if (!view) return view.error();
  ReferenceOptions options{.width = view->width, .height = view->height, .spp = o.paths, .background = false};
  options.bounces = std::max(0, std::atoi(o.request.bounces.c_str()));
  if (outgoing_of(baked.surface)) {
    auto reflection = parse_reflection(o.request.brdf);
    if (!reflection) return reflection.error();
    options.reflection = std::move(*reflection);
  }
  start = Clock::now();
  const Environment turned = o.light.rotate.empty() ? *env : rotated(*env, *rotation);
  if (basis.count() > 0) {
    const LightProjection projection = project_light(*env, basis, *rotation);
    const Environment known = reconstruct_environment(projection.basis, projection.light);
    // That light rings in the reference too.
    drawn.window = "none";
    auto ringing = draw(baked, drawn, job);
    if (!ringing) return ringing.error();
    auto same = judge(r, ringing->frames.front(), "Path-traced under the light that the bake knows", baked.scene, known,
                      view->camera, options, *job.progress);
    if (!same) return same.error();
    r.same = *same, r.energy = std::min(1.0, squared_radiance(known) / std::max(squared_radiance(turned), 1e-30));
  }
  auto full =
      judge(r, ours, "Path-traced under all of the light", baked.scene, turned, view->camera, options, *job.progress);
  if (!full) return full.error();
  (basis.count() > 0 ? r.full.emplace() : r.same) = *full;
  r.reference_seconds = seconds_since(start);
  advise(r, baked, o.request);
  return r;
}

int run_check(Context& context, const CheckCommand& o) {
  if (auto ok = check_output(o.output, {"html"}); !ok) return fail(ok.error());
  if (o.request.transfer == "lightmap")
    return fail({"--transfer", "lightmap: check judges bakes that an environment lights", true});
  const Job job{&context.progress, [](const std::string& message) { warn(message); }};
  auto report = check(o, job);
  if (!report) return fail(report.error());
  auto page = page_of(*report);
  if (!page) return fail(page.error());
  if (auto ok = write_file_atomically(o.output, *page); !ok) return fail(ok.error());
  if (context.json) {
    print_json({{"output", o.output},
                {"same_light", json_of(report->same)},
                {"full_light", report->full ? json_of(*report->full) : nlohmann::json()},
                {"energy_kept", report->energy},
                {"white", report->clipped.white},
                {"negative", report->clipped.negative},
                {"bake_seconds", report->bake_seconds},
                {"reference_seconds", report->reference_seconds},
                {"advice", report->advice}});
  } else {
    fmt::print("{}\n  {:.1f} dB against the path tracer under the same light, whose noise allows {:.1f}\n", o.output,
               report->same.difference.psnr, report->same.noise);
    for (const std::string& line : report->advice) fmt::print("  {}\n", line);
  }
  return success;
}

}  // namespace

void add_check(CLI::App& app, Run& run) {
  // What the references could not answer to: light or view fixed in the bake, and light that takes other ways than
  // theirs. `size` is of the pictures.
  static const std::set<std::string> left_out{"scene", "output", "checkpoint", "depfile",    "fix-light", "fix-view",
                                              "size",  "spp",    "shadows",    "subsurface", "membrane",  "sky"};
  auto o = std::make_shared<CheckCommand>();
  CLI::App* c = app.add_subcommand("check", "Bake a scene and judge it by path tracing, in one page");
  c->add_option("scene", o->request.scene, "Scene: .gltf, .glb, .obj or .ply")->required();
  o->light.add_to(*c);
  c->add_option("--camera", o->camera, "EX,EY,EZ,TX,TY,TZ,FOV: eye, target, vertical degrees; or auto")
      ->capture_default_str();
  c->add_option("--size", o->size, "Size of the pictures, WIDTHxHEIGHT pixels")->capture_default_str();
  c->add_option("--paths", o->paths, "Paths a pixel of the references")
      ->check(CLI::Range(2, 1 << 20))
      ->capture_default_str();
  c->add_option("--tone", o->tone, "Curve from light to the screen")
      ->check(CLI::IsMember({"neutral", "agx", "aces", "none"}))
      ->capture_default_str();
  c->add_option("-o,--output", o->output, "Page to write: .html, with all in it")->required();
  add_table(*c, bake_options(), o->request, o->request.given,
            [](const std::string& name) { return !left_out.contains(name); });
  c->callback([o, &run] { run = [o](Context& context) { return run_check(context, *o); }; });
}

}  // namespace lambent::tool

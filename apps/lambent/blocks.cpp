#include "blocks.h"
#include "commands.h"

#include <lambent/bake/bake.h>
#include <lambent/relight/light.h>
#include <lambent/render/products.h>
#include <lambent/render/render.h>

#include <fmt/format.h>

#include <charconv>
#include <chrono>

namespace lambent::tool {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

Result<int> parse_visibility(const std::string& text) {
  if (text == "binary") return 1;
  int bits = 0;
  const char* end = text.data() + text.size();
  if (text.starts_with("bits:"))
    if (const auto [stop, status] = std::from_chars(text.data() + 5, end, bits);
        status == std::errc() && stop == end && bits >= 2 && bits <= max_visibility_bits)
      return bits;
  return Error{"--visibility", "must be binary, or bits:N with N from 2 to " + std::to_string(max_visibility_bits) +
                                   ", not \"" + text + "\""};
}

struct Method {
  Product product = Product::blocks;
  double fraction = 0.01;  // of Haar coefficients
};
Result<Method> parse_method(const std::string& text) {
  if (text == "blocks") return Method{};
  if (text == "standard") return Method{Product::standard};
  if (text == "haar") return Method{Product::haar};
  if (text.starts_with("haar:"))
    if (auto n = parse_numbers(text.substr(5), 1, "--method"); n && (*n)[0] > 0 && (*n)[0] <= 1)
      return Method{Product::haar, double((*n)[0])};
  return Error{
      "--method",
      "must be blocks, standard, haar, or haar:FRACTION with a fraction above 0 and up to 1, not \"" + text + "\""};
}

// What stays the same from frame to frame, and what a frame fills.
struct Products {
  Method method;
  BlockLight light;
  std::optional<HaarLight> haar;
  ProductReceivers receivers;
  Relit relit;
  Breakdown breakdown;
  size_t seen = 0;
  float share = 0;  // of the brightest texel
  double project_seconds = 0, forms_seconds = 0, cull_seconds = 0, shade_seconds = 0;

  void set_environment(const Environment& env, int size, const Mat3& rotation) {
    auto start = Clock::now();
    const CubeLight cube = cube_light(env, size, rotation);
    project_seconds += seconds_since(start), start = Clock::now();
    set_light(light, cube);
    if (method.product == Product::haar) haar = make_haar_light(cube, method.fraction);
    forms_seconds += seconds_since(start);
    share = largest_share(cube);
  }
  void shade(const Baked& baked, const View& view) {
    auto start = Clock::now();
    const std::vector<uint32_t> wanted = seen_receivers(
        baked.scene, baked.front, baked.back, baked.visibility->receivers, view.camera, view.width, view.height);
    cull_seconds += seconds_since(start), start = Clock::now();
    shade_receivers(method.product, light, haar ? &*haar : nullptr, *baked.visibility, receivers, wanted,
                    view.camera.eye, relit, &breakdown);
    shade_seconds += seconds_since(start), seen += wanted.size();
  }
};

Result<Products> make_products(const Baked& baked, const ProductFlags& flags, const BrdfOptions& brdf) {
  Products p;
  auto method = parse_method(flags.method);
  if (!method) return method.error();
  p.method = *method;
  const int size = baked.visibility->size;
  if (p.method.product == Product::haar && (size & (size - 1)))
    return Error{"--method", "haar needs a cube of 2^k texels a side"};
  auto reflection = load_reflection(brdf);
  if (!reflection) return reflection.error();
  const Cube cube = make_cube(size);
  const SamplingRule rule = flags.samples == "bounded" ? SamplingRule::bounded
                          : flags.samples == "paper"   ? SamplingRule::appendix_a
                                                       : SamplingRule::full;
  p.receivers = make_product_receivers(baked.scene, baked.front, baked.back, baked.visibility->receivers, *reflection,
                                       cube, {rule, flags.tolerance});
  return p;
}

void warn_of_harsh_light(const Products& p, const Baked& baked, const std::string& env) {
  if (p.share > 0.5f && baked.visibility->bits == 1)
    warn(env + ": one texel of the cube has " + fmt::format("{:.0f}", 100 * p.share) +
         " % of the light, whose shadows show as steps: bake with --visibility bits:6");
}

nlohmann::json describe(const Breakdown& b) {
  const double all = double(std::max<size_t>(1, b.light_brdf + b.light_visibility + b.triple));
  const double samples = double(std::max<size_t>(1, b.samples[0] + b.samples[1] + b.samples[2] + b.samples[3]));
  nlohmann::json shares = nlohmann::json::array();
  for (size_t n : b.samples) shares.push_back(100 * double(n) / samples);
  return {{"light_brdf", 100 * double(b.light_brdf) / all},
          {"light_visibility", 100 * double(b.light_visibility) / all},
          {"triple", 100 * double(b.triple) / all},
          {"samples_1_4_16_256", shares}};
}

// Light that has bounced: what a diffuse bake with bounces has more than one without, times the diffuse albedo.
Result<void> add_indirect(Context& context, const Baked& baked, const Tracer& tracer, const Environment& env,
                          const Mat3& rotation, Products& p) {
  const Receivers receivers = make_vertex_receivers(baked.scene);
  if (receivers.front != baked.front || receivers.back != baked.back)
    return Error{"--indirect", "the file's receivers are not those of its scene"};
  BakeOptions options{.order = 5, .samples = 512, .precision = Precision::single};
  auto all = bake(baked.scene, tracer, receivers, options, nullptr, &context.progress);
  if (!all) return all.error();
  options.bounces = 0;
  auto direct = bake(baked.scene, tracer, receivers, options, nullptr, &context.progress);
  if (!direct) return direct.error();
  const LightProjection light = project_light(env, all->light, rotation);
  Relit bounced, straight;
  relight(*all, light.light, bounced);
  relight(*direct, light.light, straight);
  for (size_t r = 0; r < receivers.count(); ++r) {
    const Vec3 more = max(bounced.at(r) - straight.at(r), Vec3(0));
    p.relit.set(r, 0, p.relit.at(r) + diffuse_albedo(p.receivers.materials[p.receivers.material_of[r]].brdf) * more);
  }
  return {};
}

struct RelightCommand {
  std::string baked;
  LightOptions light;
  std::string camera = "auto", size = "512x512";
  BrdfOptions brdf;
  ProductFlags flags;
  bool turntable = false, spin = false;
  int frames = 60;
};

int run_relight(Context& context, const RelightCommand& o) {
  auto baked = load_baked(o.baked);
  if (!baked) return fail(baked.error());
  if (!baked->visibility) return fail({o.baked, "holds no visibility in blocks: lambent bake --transfer blocks"});
  auto rotation = light_rotation(o.light);
  if (!rotation) return fail(rotation.error());
  auto loaded = load_light(o.light);
  if (!loaded) return fail(loaded.error());
  auto view = make_view({.camera = o.camera, .size = o.size}, baked->scene);
  if (!view) return fail(view.error());
  auto products = make_products(*baked, o.flags, o.brdf);
  if (!products) return fail(products.error());
  Products& p = *products;
  const int size = baked->visibility->size;
  const Environment env = reduced(*loaded, 8 * size);
  p.set_environment(env, size, *rotation);
  warn_of_harsh_light(p, *baked, o.light.env);
  p.project_seconds = p.forms_seconds = 0;
  const View first = *view;
  const auto start = Clock::now();
  int done = 0;
  for (; done < o.frames && !context.progress.cancelled(); ++done) {
    const float turn = 360.0f * float(done) / float(o.frames);
    if (o.spin) p.set_environment(env, size, rotation_from_yaw_pitch_roll({turn, 0, 0}) * *rotation);
    if (o.turntable)
      view->camera.eye = first.camera.target +
                         rotation_from_yaw_pitch_roll({turn, 0, 0}) * (first.camera.eye - first.camera.target);
    p.shade(*baked, *view);
  }
  const double seconds = seconds_since(start), frames = double(std::max(done, 1));
  const double each = p.seen ? 1e9 * p.shade_seconds / double(p.seen) : 0.0;
  if (context.json) {
    print_json({{"frames", done},
                {"seconds", seconds},
                {"frames_per_second", frames / seconds},
                {"receivers", baked->visibility->receivers},
                {"seen", double(p.seen) / frames},
                {"ns_per_vertex", each},
                {"ms",
                 {{"project", 1e3 * p.project_seconds / frames},
                  {"forms", 1e3 * p.forms_seconds / frames},
                  {"cull", 1e3 * p.cull_seconds / frames},
                  {"shade", 1e3 * p.shade_seconds / frames}}},
                {"breakdown", describe(p.breakdown)}});
    return success;
  }
  fmt::print("{}\n  {} frames in {}: {:.1f} a second; {} of {} receivers seen\n", o.baked, done, human_seconds(seconds),
             frames / seconds, human_count(size_t(double(p.seen) / frames)), human_count(baked->visibility->receivers));
  fmt::print("  ms a frame  project {:.2f}, forms {:.2f}, cull {:.2f}, shade {:.2f} ({:.0f} ns a receiver)\n",
             1e3 * p.project_seconds / frames, 1e3 * p.forms_seconds / frames, 1e3 * p.cull_seconds / frames,
             1e3 * p.shade_seconds / frames, each);
  if (p.method.product == Product::blocks) fmt::print("  blocks      {}\n", describe(p.breakdown).dump());
  return success;
}

}  // namespace

std::vector<CLI::Option*> BlocksFlags::add_to(CLI::App& command) {
  return {command.add_option("--cube", cube, "blocks: texels a side of a cubemap's face")
              ->check(CLI::IsMember({16, 32, 64, 128, 256}))
              ->capture_default_str(),
          command
              .add_option("--visibility", visibility,
                          "blocks: binary, or bits:N, shares of texels in 2^N levels, for harsh light")
              ->capture_default_str()};
}

int run_blocks_bake(Context& context, const SceneOptions& scene_options, const BlocksFlags& flags, size_t memory,
                    const std::string& output) {
  auto bits = parse_visibility(flags.visibility);
  if (!bits) return fail(bits.error());
  if (auto ok = check_output(output, {"glb"}); !ok) return fail(ok.error());
  auto scene = load_prepared_scene(scene_options);
  if (!scene) return fail(scene.error());
  const Receivers receivers = make_vertex_receivers(*scene);
  auto tracer = Tracer::build(*scene);
  if (!tracer) return fail(tracer.error());
  VisibilityReport report;
  auto visibility = bake_visibility(*tracer, receivers, {flags.cube, *bits, memory}, &report, &context.progress);
  if (!visibility) return fail(visibility.error());
  const nlohmann::json provenance{
      {"generator", "lambent " LAMBENT_VERSION},
      {"input", {{"name", scene->path.substr(scene->path.find_last_of('/') + 1)}, {"xxh3_128", scene->hash}}},
      {"options",
       {{"transfer", "blocks"},
        {"cube", flags.cube},
        {"visibility", flags.visibility},
        {"ground", scene_options.ground},
        {"max_edge", scene_options.max_edge}}},
      {"report", {{"receivers", receivers.count()}}}};
  if (auto ok = save_baked(output, *scene, receivers, *visibility,
                           provenance.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
      !ok)
    return fail(ok.error());
  const VisibilityStatistics s = visibility_statistics(*visibility);
  const double each = double(visibility->data.size()) / double(std::max<size_t>(1, receivers.count())),
               rate = report.seconds > 0 ? double(report.rays) / report.seconds : 0.0;
  if (context.json) {
    print_json({{"output", output},
                {"receivers", receivers.count()},
                {"rays", report.rays},
                {"seconds", report.seconds},
                {"rays_per_second", rate},
                {"bytes", visibility->data.size()},
                {"bytes_per_receiver", each},
                {"blocked", s.blocked},
                {"clear", s.clear},
                {"mixed", s.mixed},
                {"changes_per_mixed_block", s.changes}});
    return success;
  }
  fmt::print("{}\n  receivers  {}\n  rays       {} ({:.1f} million a second)\n", output, human_count(receivers.count()),
             human_count(report.rays), rate / 1e6);
  fmt::print("  size       {} a receiver, {} in all (cube {}, {} bit{})\n", human_bytes(each),
             human_bytes(double(visibility->data.size())), flags.cube, *bits, *bits == 1 ? "" : "s");
  fmt::print("  blocks     {:.1f} % blocked, {:.1f} % clear, {:.1f} % mixed with {:.1f} changes each\n",
             100 * s.blocked, 100 * s.clear, 100 * s.mixed, s.changes);
  return success;
}

std::vector<CLI::Option*> ProductFlags::add_to(CLI::App& command) {
  return {
      command
          .add_option("--method", method,
                      "Files of visibility in blocks: by blocks, standard (every texel), haar or haar:FRACTION "
                      "(wavelets, kept coefficients)")
          ->capture_default_str(),
      command
          .add_option(
              "--brdf-samples", samples,
              "blocks: how many BRDF samples a block gets: bounded, by the error; paper, by its appendix A; full, 256")
          ->check(CLI::IsMember({"bounded", "paper", "full"}))
          ->capture_default_str(),
      command.add_option("--tolerance", tolerance, "blocks: error of BRDF x pi that bounded leaves")
          ->check(CLI::Range(1e-4f, 10.0f))
          ->capture_default_str()};
}

int run_product_render(Context& context, const Baked& baked, const ProductFlags& flags,
                       const LightOptions& light_options, const ViewOptions& view_options, const BrdfOptions& brdf,
                       int samples) {
  auto rotation = light_rotation(light_options);
  if (!rotation) return fail(rotation.error());
  auto view = make_view(view_options, baked.scene);
  if (!view) return fail(view.error());
  if (light_options.env.empty()) return fail({"--env", "is needed: the file is baked for distant light"});
  auto env = load_light(light_options);
  if (!env) return fail(env.error());
  auto products = make_products(baked, flags, brdf);
  if (!products) return fail(products.error());
  Products& p = *products;
  p.set_environment(*env, baked.visibility->size, *rotation);
  warn_of_harsh_light(p, baked, light_options.env);
  p.shade(baked, *view);
  auto tracer = Tracer::build(baked.scene);
  if (!tracer) return fail(tracer.error());
  if (flags.indirect == "sh")
    if (auto ok = add_indirect(context, baked, *tracer, *env, *rotation, p); !ok) return fail(ok.error());
  RenderOptions options{
      .width = view->width, .height = view->height, .samples = samples, .show = RenderOptions::Show::radiosity};
  Environment turned;
  if (view_options.background == "env") {
    turned = light_options.rotate.empty() ? std::move(*env) : rotated(*env, *rotation);
    options.background = &turned;
  }
  auto image = render(baked.scene, *tracer, baked.basis, p.relit, view->camera, options, &context.progress);
  if (!image) return fail(image.error());
  if (auto ok = save_image(view_options.output, *image, view_options.exposure); !ok) return fail(ok.error());
  if (context.json)
    print_json({{"output", view_options.output},
                {"receivers", baked.visibility->receivers},
                {"seen", p.seen},
                {"method", flags.method},
                {"project_seconds", p.project_seconds},
                {"forms_seconds", p.forms_seconds},
                {"shade_seconds", p.shade_seconds},
                {"breakdown", describe(p.breakdown)}});
  else
    fmt::print("{}\n  shaded {} of {} receivers in {:.2f} ms, by {}\n", view_options.output, human_count(p.seen),
               human_count(baked.visibility->receivers), 1e3 * p.shade_seconds, flags.method);
  return success;
}

void add_relight(CLI::App& app, Run& run) {
  auto o = std::make_shared<RelightCommand>();
  CLI::App* c = app.add_subcommand(
      "relight", "Run the interactive loop over visibility in blocks without a window, and say what it takes");
  c->add_option("baked", o->baked, "Baked file, from `lambent bake --transfer blocks`")->required();
  o->light.add_to(*c);
  c->add_option("--camera", o->camera, "auto, or EX,EY,EZ,TX,TY,TZ,FOV: where the first frame is seen from")
      ->capture_default_str();
  c->add_option("--size", o->size, "WIDTHxHEIGHT of the picture that receivers are culled for")->capture_default_str();
  o->brdf.add_to(*c);
  o->flags.add_to(*c);
  c->add_flag("--turntable", o->turntable, "The eye goes once around its target");
  c->add_flag("--spin-light", o->spin, "The light goes once around, rebuilt for each frame");
  c->add_option("--frames", o->frames, "How many")->check(CLI::Range(1, 100000))->capture_default_str();
  c->callback([o, &run] { run = [o](Context& context) { return run_relight(context, *o); }; });
}

}  // namespace lambent::tool

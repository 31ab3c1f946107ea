#include <lambent/pipeline/draw_blocks.h>

#include <lambent/bake/bake.h>
#include <lambent/core/clock.h>
#include <lambent/light/cube_light.h>
#include <lambent/pipeline/text.h>
#include <lambent/render/products.h>

#include <fmt/format.h>

namespace lambent {
namespace {

const Visibility& visibility_of(const Baked& baked) { return std::get<Visibility>(baked.surface.store); }

// What values at a block's nodes tell of a lobe is little: under a sun, 0.2 shows as edges between blocks.
constexpr float lobe_tolerance = 0.2f, values_tolerance = 0.02f;

SamplingRule sampling_rule(const std::string& name) {
  return name == "bounded" ? SamplingRule::bounded : name == "paper" ? SamplingRule::appendix_a : SamplingRule::full;
}

}  // namespace

Result<ProductMethod> parse_method(const std::string& text) {
  if (text == "blocks") return ProductMethod{};
  if (text == "standard") return ProductMethod{Product::standard};
  if (text == "haar") return ProductMethod{Product::haar};
  if (text.starts_with("haar:"))
    if (auto n = parse_numbers(text.substr(5), 1, "--method"); n && (*n)[0] > 0 && (*n)[0] <= 1)
      return ProductMethod{Product::haar, double((*n)[0])};
  return Error{
      "--method",
      "must be blocks, standard, haar, or haar:FRACTION with a fraction above 0 and up to 1, not \"" + text + "\"",
      true};
}

Result<Reflection> block_reflection(const Scene& scene, const DrawRequest& request) {
  auto reflection = parse_reflection(request.brdf.empty() ? "diffuse" : request.brdf);
  if (!reflection) return reflection.error();
  if (auto ok = parse_materials(request.material, scene, *reflection); !ok) return ok.error();
  return reflection;
}

Result<BlockShading> make_block_shading(const Baked& baked, const DrawRequest& request) {
  auto method = parse_method(request.method);
  if (!method) return method.error();
  auto reflection = block_reflection(baked.scene, request);
  if (!reflection) return reflection.error();
  const VertexPlacement* at = vertices_of(baked);
  if (!at) return Error{request.baked, "has visibility elsewhere than at vertices"};
  const Visibility& visibility = visibility_of(baked);
  RelighterOptions options{.product = method->product, .haar_fraction = method->haar_fraction};
  options.receivers = make_product_receivers(
      baked.scene, at->front, at->back, visibility.receivers, *reflection, make_cube(visibility.size),
      {sampling_rule(request.brdf_samples), request.tolerance > 0 ? request.tolerance : lobe_tolerance});
  if (!(request.tolerance > 0))
    for (ProductMaterial& m : options.receivers.materials) m.tolerance = m.by_values ? values_tolerance : m.tolerance;
  std::vector<Vec3> albedo;
  for (uint32_t material : options.receivers.material_of)
    albedo.push_back(diffuse_albedo(options.receivers.materials[material].brdf));
  auto relighter = Relighter::make(baked.surface, std::move(options));
  if (!relighter) return Error{request.baked, relighter.error().message};
  return BlockShading{&baked, std::move(*relighter), std::move(albedo)};
}

Result<void> set_environment(BlockShading& s, const Environment& env, const Mat3& rotation, const Job* job) {
  const Visibility& visibility = visibility_of(*s.baked);
  auto start = Clock::now();
  const CubeLight cube = cube_light(env, visibility.size, rotation);
  s.project_seconds += seconds_since(start), start = Clock::now();
  auto ok = s.relighter.set_light(cube);
  s.forms_seconds += seconds_since(start);
  if (const float share = largest_share(cube); job && share > 0.5f && visibility.bits == 1)
    job->warn(
        fmt::format("{}: one texel of the cube has {:.0f} % of the light, whose shadows show as steps: bake with "
                    "--visibility bits:6",
                    env.name, 100 * share));
  return ok;
}

Result<void> shade_view(BlockShading& s, const View& view) {
  const VertexPlacement& at = *vertices_of(*s.baked);
  auto start = Clock::now();
  s.in_view = seen_receivers(s.baked->scene, at.front, at.back, visibility_of(*s.baked).receivers, view.camera,
                             view.width, view.height);
  s.cull_seconds += seconds_since(start), start = Clock::now();
  const std::span<const uint32_t> seen(s.in_view);
  auto ok = s.relighter.relight({.eye = view.camera.eye, .seen = seen, .breakdown = &s.breakdown}, s.relit);
  s.shade_seconds += seconds_since(start), s.seen += seen.size();
  return ok;
}

Result<void> add_indirect(BlockShading& s, const Tracer& tracer, const Surroundings& around, const Job& job) {
  const Scene& scene = s.baked->scene;
  const VertexPlacement& at = *vertices_of(*s.baked);
  const Receivers receivers = make_vertex_receivers(scene);
  if (receivers.front != at.front || receivers.back != at.back)
    return Error{"--indirect", "the file's receivers are not those of its scene", true};
  BakeOptions options{.order = 5, .samples = 512, .precision = Precision::single};
  auto all = bake(scene, tracer, receivers, options, nullptr, job.progress);
  if (!all) return all.error();
  options.bounces = 0;
  auto direct = bake(scene, tracer, receivers, options, nullptr, job.progress);
  if (!direct) return direct.error();
  const LightProjection light = project_light(*around.env, all->light, around.rotation);
  Relit bounced, straight;
  relight(*all, light.light, bounced);
  relight(*direct, light.light, straight);
  for (size_t r = 0; r < receivers.count(); ++r)
    s.relit.set(r, 0, s.relit.at(r) + s.albedo[r] * max(bounced.at(r) - straight.at(r), Vec3(0)));
  return {};
}

nlohmann::json describe(const Breakdown& b) {
  const double all = double(std::max<size_t>(1, b.light_brdf + b.light_visibility + b.triple));
  const double samples = double(std::max<size_t>(1, b.all_samples()));
  nlohmann::json shares = nlohmann::json::array();
  for (size_t n : b.samples) shares.push_back(100 * double(n) / samples);
  nlohmann::json out = {{"light_brdf", 100 * double(b.light_brdf) / all},
                        {"light_visibility", 100 * double(b.light_visibility) / all},
                        {"triple", 100 * double(b.triple) / all},
                        {"samples_1_4_16_64_256", shares}};
  if (const StageTimes& t = b.times; t.receivers > 0) {
    const double n = double(t.receivers);
    out["ns_a_receiver"] = {{"visibility", t.visibility / n}, {"brdf", t.brdf / n}, {"integral", t.integral / n}};
  }
  return out;
}

Result<Drawing> draw_blocks(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto view = parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  auto shading = make_block_shading(baked, request);
  if (!shading) return shading.error();
  if (auto ok = set_environment(*shading, *around->env, around->rotation, &job); !ok) return ok.error();
  if (auto ok = shade_view(*shading, *view); !ok) return ok.error();
  auto tracer = Tracer::build(baked.scene);
  if (!tracer) return tracer.error();
  if (request.indirect == "sh")
    if (auto ok = add_indirect(*shading, *tracer, *around, job); !ok) return ok.error();
  // Colour is in what was shaded.
  const RenderOptions options{.width = view->width,
                              .height = view->height,
                              .samples = request.spp,
                              .background = around->background(),
                              .show = RenderOptions::Show::radiosity};
  auto image = render(baked.scene, *tracer, baked.basis, shading->relit, view->camera, options, job.progress);
  if (!image) return image.error();
  Drawing drawing;
  drawing.frames.push_back(std::move(*image));
  drawing.summary.json = {{"receivers", visibility_of(baked).receivers},
                          {"frames", 1},
                          {"seen", shading->seen},
                          {"method", request.method},
                          {"project_seconds", shading->project_seconds},
                          {"forms_seconds", shading->forms_seconds},
                          {"shade_seconds", shading->shade_seconds},
                          {"breakdown", describe(shading->breakdown)}};
  drawing.summary.lines.emplace_back(
      "shaded", fmt::format("{} of {} receivers in {:.2f} ms, by {}", human_count(shading->seen),
                            human_count(visibility_of(baked).receivers), 1e3 * shading->shade_seconds, request.method));
  return drawing;
}

}  // namespace lambent

#include <lambent/pipeline/live_state.h>

#include <lambent/core/clock.h>
#include <lambent/light/cube_light.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr size_t kept_rays = size_t(4) << 20;
constexpr size_t many_receivers = 20000;
constexpr double worth_a_part = 0.8;  // of all receivers
constexpr int coarse_sky = 256;       // texels around, of light that turns
constexpr double a_piece = 0.1;       // seconds of shading at a time, of a picture that is at rest
constexpr int rows_a_piece = 8;       // at least
constexpr int hurried_samples = 16;   // of BRDFs in a block, while something moves

LiveLight live_light(Environment env, const DrawRequest& request, const LightBasis& basis) {
  LiveLight out{std::make_shared<const Environment>(std::move(env)), nullptr};
  out.known = know_harmonics(*out.env, request, basis, request.window == "auto");
  return out;
}

}  // namespace

LiveSkies LivePicture::State::skies() const {
  LiveSkies out{.turn = turn};
  for (size_t k = 0; k < 2; ++k) out.env[k] = light[k].env, out.known[k] = light[k].known;
  return out;
}

Result<void> LivePicture::State::make_environment_due() {
  light = {};
  if (asked.env.empty()) return {};
  auto env = asked.environment ? Result<Environment>(*asked.environment) : load_environment(asked.env);
  if (!env) return env.error();
  for (const std::string& warning : env->warnings) job.warn(warning);
  light[1] = live_light(reduced(*env, coarse_sky), asked, light_basis());
  light[0] = live_light(std::move(*env), asked, light_basis());
  return {};
}

// All that is made once; parts of it anew when the request changes.
Result<void> LivePicture::State::make_kind() {
  const bool textured = !asked.transfer_texture.empty();
  if (textured || kind_of(baked.surface) == DrawKind::indirect) {
    auto made = (textured ? make_live_texture : make_live_indirect)(baked, asked, skies(), job);
    if (!made) return made.error();
    kind = std::move(*made), due.values = due.objects = false;  // of others
    return {};
  }
  if (auto ok = make_materials(); !ok) return ok;
  if (auto ok = make_pose(); !ok) return ok;
  return make_objects();
}

void LivePicture::State::forget_rays() {
  for (auto& kept : rays) kept.clear();
  seen.clear(), extra.reset(), fresh_rays = due.shades = true, due.rays = false;
}

Result<void> LivePicture::State::make_materials() {
  if (kind_of(baked.surface) == DrawKind::blocks) {
    auto made = make_block_shading(baked, asked);
    if (!made) return made.error();
    if (blocks) made->relit = std::move(blocks->relit);  // shows until it is shaded anew
    blocks.emplace(std::move(*made));
    return {};
  }
  auto begun = begin_columns(baked, asked, job);
  if (!begun) return begun.error();
  if (auto ok = make_insertions(*begun, columns ? columns->inserted : decltype(columns->inserted)()); !ok) return ok;
  columns.emplace(std::move(*begun));
  rows = columns->rows;
  return {};
}

// Objects of --place; those of --insert are among the materials.
Result<void> LivePicture::State::make_objects() {
  if (asked.place.empty()) return moving.reset(), Result<void>();
  if (moving) return moving->change(asked);
  auto made = MovingDrawing::make(baked, asked, job);
  if (!made) return made.error();
  moving.emplace(std::move(*made));
  due.light = true;  // that comes to them
  return {};
}

Result<void> LivePicture::State::make_pose() {
  auto poses = make_poses(Motion{asked.animation, "", asked.deform, asked.time}, baked.scene);
  if (!poses) return poses.error();
  pose = std::move(poses->front());
  if (pose) moved = posed(baked.scene, *pose);
  if (is_fixed()) return {};
  auto built = Tracer::build(scene(), job.progress);
  if (!built) return built.error();
  tracer.emplace(std::move(*built));
  return {};
}

Result<void> LivePicture::State::project(bool hurry) {
  const LiveLight& by = light[hurry ? 1 : 0];
  draft_light = hurry && light[1].env && light[0].env->image.width > light[1].env->image.width;
  if (blocks) {
    const Environment dark{"", Image(2, 1), {}};
    const Environment& env = by.env ? *by.env : dark;
    return set_environment(*blocks, env, turn, nullptr);
  }
  ColumnDrawing& d = *columns;
  d.around = {.env = by.env, .rotation = turn, .seen = asked.background == "env", .known = by.known};
  d.time = asked.time;
  if (auto ok = choose_light(d); !ok) return ok;
  if (look == Look::coefficient) {
    std::vector<Vec3>& of = d.light.projection.light;
    std::fill(of.begin(), of.end(), Vec3(0.0f)), d.light.peaks.clear(), d.emission.clear();
    of[size_t(number)] = Vec3(1.0f);
  }
  if (auto ok = d.relighters.empty() ? make_relighters(d) : set_lights(d); !ok) return ok;
  return moving ? moving->set_light(d) : Result<void>();
}

// The scene with its objects, and all of its light in `relit`. Where they stand is looked at only if it has changed:
// who holds the scene meanwhile has let go of it then.
Result<void> LivePicture::State::join_objects() {
  if (moving && due.objects)
    if (auto ok = moving->move_to(asked.time); !ok) return ok;
  std::vector<Vec3> emission = columns->emission;
  auto drawn = moving ? moving->lit(*columns, emission) : with_insertions(*columns, std::move(relit));
  if (!drawn) return drawn.error();
  relit = std::move(drawn->relit), peaks = std::move(drawn->peaks);
  if (!emission.empty()) emission.resize(drawn->scene.materials.size(), Vec3(0.0f));
  if (!due.objects) return company->outgoing = std::move(drawn->outgoing), company->emission = emission, Result<void>();
  SpatialBasis corners = corner_receivers(drawn->scene, drawn->front, drawn->back);
  company = Company{std::move(drawn->scene), std::move(corners), std::move(drawn->outgoing), std::move(emission), {}};
  if (moving)
    for (const auto& part : moving->parts()) company->first.push_back(part.second);
  size_t first = baked.scene.triangles.size();
  for (const auto& object : columns->inserted)
    company->first.push_back(std::exchange(first, first + object->scene.triangles.size()));
  auto built = Tracer::build(company->scene, job.progress);
  if (!built) return built.error();
  tracer.emplace(std::move(*built));
  for (auto& kept : rays) kept.clear();
  extra.reset();
  return due.objects = false, Result<void>();
}

// Whether receivers that are not seen may be left as they are: of blocks, and where there are enough of others.
bool LivePicture::State::can_shade_what_is_seen() const {
  if (blocks) return true;
  return columns && !has_objects() && look == Look::picture && columns->receivers() >= many_receivers &&
         std::holds_alternative<CornerReceivers>(baked.basis) && relights_in_part(*columns);
}

// Those of the triangles that rays have met: of a picture that moves, no others are wanted.
const std::vector<uint32_t>& LivePicture::State::receivers_in_view() {
  if (seen_scale != scale) seen.clear();
  if (!seen.empty() || rays[size_t(scale)].empty()) return seen;
  seen_scale = scale;
  const auto& corners = std::get<CornerReceivers>(baked.basis);
  std::vector<uint8_t> wanted(receivers_of(baked.surface.store), 0);
  for (const ViewRay& ray : rays[size_t(scale)].front().rays)
    if (ray.hit.triangle != none)
      if (const Corners* at = corners.find(ray.hit.triangle, ray.hit.front))
        for (uint32_t r : at->receiver) wanted[r] = 1;
  size_t blocks_seen = 0, last = SIZE_MAX;
  for (size_t r = 0; r < wanted.size(); ++r) {
    if (!wanted[r]) continue;
    seen.push_back(uint32_t(r));
    if (r / transfer_block != last) ++blocks_seen, last = r / transfer_block;
  }
  seen_share = double(blocks_seen * transfer_block) / double(std::max<size_t>(wanted.size(), 1));
  return seen;
}

Result<void> LivePicture::State::shade_blocks_seen(bool hurry, double budget) {
  BlockShading& s = *blocks;
  s.breakdown = {};
  const auto start = Clock::now();
  if (!hurry) {
    s.seen = 0;
    auto ok = shade_view(s, view);
    times.shaded = s.seen, draft_values = false;
    has_value.assign(receivers_of(baked.surface.store), 0);
    for (uint32_t r : s.in_view) has_value[r] = 1;
    if (s.seen > 0) receiver_cost = seconds_from(start) / double(s.seen);
    return ok;
  }
  const std::vector<uint32_t>& all = receivers_in_view();
  const size_t parts = std::clamp<size_t>(size_t(std::ceil(double(all.size()) * receiver_cost / budget)), 1, 16);
  std::vector<uint32_t> part;  // with what has come into view
  const size_t turn = turn_of++ % parts;
  has_value.resize(receivers_of(baked.surface.store), 0);
  for (size_t i = 0; i < all.size(); ++i)
    if (i % parts == turn || !has_value[all[i]]) part.push_back(all[i]), has_value[all[i]] = 1;
  draft_values = true, times.shaded = part.size();
  auto ok = s.relighter.relight({.eye = view.camera.eye,
                                 .keep = true,
                                 .most_samples = hurried_samples,
                                 .seen = std::span<const uint32_t>(part),
                                 .breakdown = &s.breakdown},
                                s.relit);
  if (!part.empty()) receiver_cost = 0.5 * (receiver_cost + seconds_from(start) / double(part.size()));
  return ok;
}

Result<void> LivePicture::State::make_values(bool hurry, double budget) {
  if (blocks) return shade_blocks_seen(hurry, budget);
  const bool part = hurry && can_shade_what_is_seen() && !receivers_in_view().empty() && seen_share < worth_a_part;
  times.shaded = part ? seen.size() : columns->receivers();
  if (!moving)
    if (auto ok = relight(*columns, pose, relit, peaks, part ? &seen : nullptr); !ok) return ok;
  draft_values = part;
  rows = posed_rows(*columns, pose);
  return has_objects() ? join_objects() : Result<void>();
}

void LivePicture::State::choose_scale(bool hurry, double budget) {
  if (is_fixed()) return;
  int next = 1;
  const double pixels = double(view.width) * double(view.height);
  for (; hurry && next < coarsest_live; ++next)
    if (pixels / (next * next) * ((rays[size_t(next)].empty() ? trace_cost : 0.0) + shade_cost) <= budget) break;
  if (next != scale) scale = next, due.shades = true, due.values |= draft_values;
}

std::function<RayShade()> LivePicture::State::shade_maker(RenderOptions& options, const ViewRays& pass, bool hurry) {
  if (look != Look::picture) return by_number(pass, look_shade({look, number, scene(), basis(), relit, measured}));
  if (kind) return kind->shade({pass, sums.samples, scale, std::exchange(fresh_rays, false), hurry, view.camera.eye});
  if (blocks) {
    options.show = RenderOptions::Show::radiosity;  // colour is in what was shaded
    return by_number(pass, relit_shade(scene(), baked.basis, blocks->relit, options));
  }
  options.show = columns->show.colour, options.emission = company ? company->emission : columns->emission;
  if (!peaks.values.empty()) options.peaks = &peaks;
  if (const auto* directional = std::get_if<DirectionalRows>(&rows)) options.directional = directional->kind;
  options.outgoing = !company ? std::get_if<Outgoing>(&rows) : company->outgoing ? &*company->outgoing : nullptr;
  return relit_shade(pass, scene(), basis(), relit, options);
}

std::function<Vec3(Vec3)> LivePicture::State::background() const {
  const std::shared_ptr<const Environment>& env = light[0].env;
  if (asked.background != "env" || !env || look != Look::picture) return nullptr;
  return [&env, back = transpose(turn)](Vec3 d) { return radiance_bilinear(*env, back * d); };
}

void LivePicture::State::draw_fixed() {
  const auto behind = background();
  const auto& fixed = std::get<FixedView>(baked.surface.where);
  image = pixels_image(relit, fixed.coverage, view.camera, view.width, view.height, nullptr);
  const CameraRays from(view.camera, view.width, view.height);
  for (size_t i = 0; behind && i < image.rgb.size(); ++i)
    if (fixed.coverage[i] < 1)
      image.rgb[i] += (1 - fixed.coverage[i]) * behind(from.direction(float(i % size_t(view.width)) + 0.5f,
                                                                      float(i / size_t(view.width)) + 0.5f));
  if (behind) image.alpha.clear();
  sums.samples = asked.spp;
}

// The rays of the next sample: those that are kept, or traced now.
Result<const ViewRays*> LivePicture::State::trace_pass() {
  auto& kept = rays[size_t(scale)];
  const int sample = sums.samples;
  if (size_t(sample) < kept.size()) return &kept[size_t(sample)];
  if (extra) return &*extra;
  const auto start = Clock::now();
  auto traced = trace_view(scene(), *rays_of(), view.camera, width(), height(), sample, 1, nullptr);
  if (!traced) return traced.error();
  times.trace = 1e3 * seconds_from(start), trace_cost = seconds_from(start) / (double(width()) * double(height()));
  const bool room = size_t(sample + 1) * traced->rays.size() <= kept_rays;
  if (size_t(sample) == kept.size() && (sample == 0 || room)) return &kept.emplace_back(std::move(*traced));
  return &extra.emplace(std::move(*traced));
}

// At rest as many rows as make a short piece of work; the picture changes with the last of them.
Result<void> LivePicture::State::add_sample(bool hurry) {
  if (is_fixed()) return draw_fixed(), Result<void>();
  auto pass = trace_pass();
  if (!pass) return pass.error();
  if (due.values && seen.empty() && hurry && can_shade_what_is_seen()) return {};  // shaded first, now that rays tell
  const auto start = Clock::now();
  auto& kept = rays[size_t(scale)];
  if (columns && !kind && look == Look::picture && size_t(sums.samples) < kept.size() &&
      kept[size_t(sums.samples)].colours.empty())
    find_colours(scene(), kept[size_t(sums.samples)]);
  if (is_overlay(look)) {
    image = paint_look({look, number, scene(), basis(), relit, measured}, baked, *rays_of(), **pass, view);
    sums.samples = asked.spp, shade_cost = seconds_from(start) / double((*pass)->begin.size());
    times.shade = 1e3 * seconds_from(start);
    return {};
  }
  const int rows_at_once = int(std::min(1e6, a_piece / (shade_cost * double(width()))));
  const int last = hurry ? height() : std::min(height(), row + std::max(rows_at_once, rows_a_piece));
  const auto behind = background();
  RenderOptions options;
  shade_rays(**pass, shade_maker(options, **pass, hurry), behind, sums, row, last);
  times.shade = 1e3 * seconds_from(start);
  shade_cost = seconds_from(start) / (double(width()) * double(last - row));
  draft_shades = hurry && kind && kind->shades_coarsely();
  row = last;
  if (last < height()) return {};
  row = 0, extra.reset();
  image = mean_of(sums, width(), height());
  if (!behind) image.alpha = image.coverage;
  return {};
}

// Of a kind with steps of its own: its light, as far as it comes in a piece of work.
Result<void> LivePicture::State::light_kind(bool hurry, double budget) {
  auto made = kind->light(hurry, budget, times);
  if (!made) return made.error();
  using Light = LiveKind::Light;
  due.light = *made == Light::unfinished || *made == Light::partial;
  draft_light = *made != Light::whole;
  if (*made != Light::unfinished) due.shades = true;
  return {};
}

}  // namespace lambent

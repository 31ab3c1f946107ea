#include <lambent/pipeline/live.h>

#include <lambent/core/overloaded.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/lamps.h>
#include <lambent/light/peaks.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/draw_columns.h>
#include <lambent/pipeline/draw_moving.h>
#include <lambent/pipeline/live_look.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

namespace lambent {
namespace {

using LiveClock = std::chrono::steady_clock;
double since(LiveClock::time_point start) { return std::chrono::duration<double>(LiveClock::now() - start).count(); }

constexpr int coarsest = 4;  // a side's share of pixels in a hurry, at least
constexpr size_t kept_rays = size_t(4) << 20;
constexpr int coarse_sky = 256;  // texels around, of light that turns

bool is_same(const DrawRequest& a, const DrawRequest& b, std::initializer_list<const char*> names) {
  for (const Option<DrawRequest>& o : draw_options())
    if (std::find(names.begin(), names.end(), std::string(o.name)) != names.end() &&
        !std::visit([&](auto member) { return a.*member == b.*member; }, o.member))
      return false;
  return true;
}

// A light to draw by, and what --window auto asks of it.
struct LiveLight {
  std::optional<Environment> env;
  std::shared_ptr<const Peakless> known;
};

LiveLight live_light(const Environment& env, const DrawRequest& request, const LightBasis& basis) {
  LiveLight out{env, nullptr};
  const int order = request.light_order ? std::min(request.light_order, basis.order) : basis.order;
  if (order > 0 && request.window == "auto")
    out.known =
        std::make_shared<const Peakless>(Peakless{order, without_peaks(env, order), int(find_lamps(env, 8).size())});
  return out;
}

// The scene with objects in it that were not baked with it.
struct Company {
  Scene scene;
  SpatialBasis basis;
  std::optional<Outgoing> outgoing;
  std::vector<Vec3> emission;
  std::vector<size_t> first;  // triangle of each object
};

}  // namespace

struct LivePicture::State {
  const Baked& baked;
  DrawRequest asked;
  Job job;
  View view = {};
  Look look = Look::picture;
  int coefficient = 0;
  Mat3 turn{1.0f};

  // What has to be made anew, first to last; `draft`: made in a hurry, and to be made again.
  struct {
    bool environment = true, materials = true, pose = true, light = true, values = true, rays = true, shades = true,
         objects = true;
  } due = {};
  bool draft_light = false, draft_values = false;

  std::array<LiveLight, 2> light = {};  // as it is, and coarse
  std::optional<ColumnDrawing> columns = std::nullopt;
  std::optional<BlockShading> blocks = std::nullopt;
  std::optional<Pose> pose = std::nullopt;
  Scene moved = {};
  std::optional<MovingDrawing> moving = std::nullopt;  // of --place
  std::optional<Company> company = std::nullopt;
  std::optional<Tracer> tracer = std::nullopt;
  Relit relit = {}, peaks = {};
  Rows rows = {};
  std::vector<uint32_t> seen = {};  // of blocks, in the picture; empty: not known yet
  size_t turn_of = 0;               // of their parts, in a hurry

  std::array<std::vector<ViewRays>, coarsest + 1> rays = {};  // by scale
  int scale = 1;
  ViewSums sums = {};
  Image image = {};
  double trace_cost = 2e-7, shade_cost = 1e-7, receiver_cost = 1e-6;  // seconds each, as measured
  LiveTimes times = {};

  const Scene& scene() const { return company ? company->scene : pose ? moved : baked.scene; }
  const SpatialBasis& basis() const { return company ? company->basis : baked.basis; }
  bool has_objects() const { return moving || (columns && !columns->insertions.empty()); }
  LightBasis light_basis() const { return light_of(baked.surface.store); }
  bool is_fixed() const { return std::holds_alternative<FixedView>(baked.surface.where); }
  int width() const { return std::max(1, view.width / scale); }
  int height() const { return std::max(1, view.height / scale); }

  Result<void> make_environment_due();
  Result<void> make_materials();
  Result<void> make_pose();
  Result<void> make_objects();
  Result<void> join_objects();
  Result<void> project(bool hurry);
  Result<void> make_values(bool hurry, double budget);
  Result<void> shade_blocks_seen(bool hurry, double budget);
  void choose_scale(bool hurry, double budget);
  Result<void> add_sample();
  std::function<SurfaceShade()> shade_maker(RenderOptions& options);
  const std::vector<uint32_t>& receivers_in_view();
};

Result<void> LivePicture::State::make_environment_due() {
  light = {};
  if (asked.env.empty()) return {};
  auto env = asked.environment ? Result<Environment>(*asked.environment) : load_environment(asked.env);
  if (!env) return env.error();
  for (const std::string& warning : env->warnings) job.warn(warning);
  light[1] = live_light(reduced(*env, coarse_sky), asked, light_basis());
  light[0] = live_light(*env, asked, light_basis());
  return {};
}

Result<void> LivePicture::State::make_materials() {
  if (kind_of(baked.surface) == DrawKind::blocks) {
    auto made = make_block_shading(baked, asked);
    if (!made) return made.error();
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
  if (auto ok = choose_light(d); !ok) return ok;
  if (look == Look::coefficient) {
    std::vector<Vec3>& of = d.light.projection.light;
    std::fill(of.begin(), of.end(), Vec3(0.0f)), d.light.peaks.clear(), d.emission.clear();
    of[size_t(coefficient)] = Vec3(1.0f);
  }
  if (auto ok = d.relighters.empty() ? make_relighters(d) : set_lights(d); !ok) return ok;
  return moving ? moving->set_light(d) : Result<void>();
}

// The scene with its objects, and all of its light in `relit`. Where they stand is looked at only if it has changed:
// who holds the scene meanwhile has let go of it then.
Result<void> LivePicture::State::join_objects() {
  if (moving && due.objects) moving->move_to(asked.time);
  std::vector<Vec3> emission = columns->emission;
  auto drawn = moving ? moving->lit(*columns, emission) : with_insertions(*columns, std::move(relit));
  if (!drawn) return drawn.error();
  relit = std::move(drawn->relit), peaks = {};
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
  return due.objects = false, Result<void>();
}

// Those of the triangles that rays have met: of a picture that moves, no others are wanted.
const std::vector<uint32_t>& LivePicture::State::receivers_in_view() {
  if (!seen.empty() || rays[size_t(scale)].empty()) return seen;
  const auto& corners = std::get<CornerReceivers>(baked.basis);
  std::vector<uint8_t> wanted(receivers_of(baked.surface.store), 0);
  for (const ViewRay& ray : rays[size_t(scale)].front().rays)
    if (ray.hit.triangle != none)
      if (const Corners* at = corners.find(ray.hit.triangle, ray.hit.front))
        for (uint32_t r : at->receiver) wanted[r] = 1;
  for (size_t r = 0; r < wanted.size(); ++r)
    if (wanted[r]) seen.push_back(uint32_t(r));
  return seen;
}

Result<void> LivePicture::State::shade_blocks_seen(bool hurry, double budget) {
  BlockShading& s = *blocks;
  const auto start = LiveClock::now();
  if (!hurry) {
    s.seen = 0;
    auto ok = shade_view(s, view);
    times.shaded = s.seen, draft_values = false;
    if (s.seen > 0) receiver_cost = since(start) / double(s.seen);
    return ok;
  }
  const std::vector<uint32_t>& all = receivers_in_view();
  const size_t parts = std::clamp<size_t>(size_t(std::ceil(double(all.size()) * receiver_cost / budget)), 1, 16);
  std::vector<uint32_t> part;
  for (size_t i = turn_of++ % parts; i < all.size(); i += parts) part.push_back(all[i]);
  draft_values = true, times.shaded = part.size();
  auto ok = s.relighter.relight(
      {.eye = view.camera.eye, .keep = true, .seen = std::span<const uint32_t>(part), .breakdown = &s.breakdown},
      s.relit);
  if (!part.empty()) receiver_cost = 0.5 * (receiver_cost + since(start) / double(part.size()));
  return ok;
}

Result<void> LivePicture::State::make_values(bool hurry, double budget) {
  if (blocks) return shade_blocks_seen(hurry, budget);
  times.shaded = columns->receivers();
  if (!moving)
    if (auto ok = relight(*columns, pose, relit, peaks); !ok) return ok;
  rows = posed_rows(*columns, pose);
  return has_objects() ? join_objects() : Result<void>();
}

void LivePicture::State::choose_scale(bool hurry, double budget) {
  if (is_fixed()) return;
  int next = 1;
  const double pixels = double(view.width) * double(view.height);
  for (; hurry && next < coarsest; ++next)
    if (pixels / (next * next) * ((rays[size_t(next)].empty() ? trace_cost : 0.0) + shade_cost) <= budget) break;
  if (next != scale) scale = next, due.shades = true;
}

std::function<SurfaceShade()> LivePicture::State::shade_maker(RenderOptions& options) {
  if (look != Look::picture) return look_shade(look, scene(), basis(), relit);
  if (blocks) {
    options.show = RenderOptions::Show::radiosity;  // colour is in what was shaded
    return relit_shade(scene(), baked.basis, blocks->relit, options);
  }
  options.show = columns->show.colour, options.emission = company ? company->emission : columns->emission;
  if (!peaks.values.empty()) options.peaks = &peaks;
  if (const auto* directional = std::get_if<DirectionalRows>(&rows)) options.directional = directional->kind;
  options.outgoing = !company ? std::get_if<Outgoing>(&rows) : company->outgoing ? &*company->outgoing : nullptr;
  return relit_shade(scene(), basis(), relit, options);
}

Result<void> LivePicture::State::add_sample() {
  std::function<Vec3(Vec3)> background;
  const std::optional<Environment>& env = light[0].env;
  if (asked.background == "env" && env && look == Look::picture)
    background = [&env, back = transpose(turn)](Vec3 d) { return radiance_bilinear(*env, back * d); };
  if (is_fixed()) {
    const auto& fixed = std::get<FixedView>(baked.surface.where);
    image = pixels_image(relit, fixed.coverage, view.camera, view.width, view.height, nullptr);
    const CameraRays from(view.camera, view.width, view.height);
    for (size_t i = 0; background && i < image.rgb.size(); ++i)
      if (fixed.coverage[i] < 1)
        image.rgb[i] += (1 - fixed.coverage[i]) * background(from.direction(float(i % size_t(view.width)) + 0.5f,
                                                                            float(i / size_t(view.width)) + 0.5f));
    if (background) image.alpha.clear();
    sums.samples = asked.spp;
    return {};
  }
  const double pixels = double(width()) * double(height());
  auto& kept = rays[size_t(scale)];
  const int sample = sums.samples;
  ViewRays fresh;
  const ViewRays* pass = nullptr;
  if (size_t(sample) < kept.size()) {
    pass = &kept[size_t(sample)];
  } else {
    const auto start = LiveClock::now();
    auto traced = trace_view(scene(), *tracer, view.camera, width(), height(), sample, 1, nullptr);
    if (!traced) return traced.error();
    times.trace = 1e3 * since(start), trace_cost = since(start) / pixels;
    fresh = std::move(*traced), pass = &fresh;
    const bool room = size_t(sample + 1) * fresh.rays.size() <= kept_rays;
    if (size_t(sample) == kept.size() && (sample == 0 || room)) pass = &kept.emplace_back(std::move(fresh));
  }
  if (blocks && draft_values && seen.empty()) return {};  // shaded first, now that rays tell what is seen
  const auto start = LiveClock::now();
  RenderOptions options;
  shade_rays(*pass, shade_maker(options), background, sums);
  image = mean_of(sums, width(), height());
  if (!background) image.alpha = image.coverage;
  times.shade = 1e3 * since(start), shade_cost = since(start) / pixels;
  return {};
}

LivePicture::LivePicture(std::unique_ptr<State> state) : state_(std::move(state)) {}
LivePicture::LivePicture(LivePicture&&) noexcept = default;
LivePicture& LivePicture::operator=(LivePicture&&) noexcept = default;
LivePicture::~LivePicture() = default;

namespace {

struct Parsed {
  View view;
  Mat3 turn{1.0f};
};

// All of a request that can be wrong but for its files.
Result<Parsed> parse_live(const Baked& baked, const DrawRequest& request) {
  for (const char* option : {"transfer-texture", "frames", "indirect"})
    if (is_given(request, json_name(option)))
      return Error{std::string("--") + option, "is not shown live: `lambent render` draws it", true};
  if (auto ok = check_draw(request, baked); !ok) return ok.error();
  auto turn = parse_rotation(request.env_rotate, "--env-rotate");
  if (!turn) return turn.error();
  if (const auto* fixed = std::get_if<FixedView>(&baked.surface.where))
    return Parsed{View{fixed->camera, fixed->width, fixed->height}, *turn};
  auto view = parse_view(request.camera, request.size, baked.scene);
  if (!view) return view.error();
  return Parsed{*view, *turn};
}

}  // namespace

Result<LivePicture> LivePicture::make(const Baked& baked, const DrawRequest& request, const Job& job) {
  if (std::holds_alternative<IndirectTransfer>(baked.surface.store))
    return Error{request.baked, "holds direct-to-indirect transport, which is not drawn live: see `lambent render`"};
  auto parsed = parse_live(baked, request);
  if (!parsed) return parsed.error();
  auto state = std::unique_ptr<State>(new State{baked, request, job, parsed->view});
  state->turn = parsed->turn;
  if (auto ok = state->make_environment_due(); !ok) return ok.error();
  if (auto ok = state->make_materials(); !ok) return ok.error();
  if (auto ok = state->make_pose(); !ok) return ok.error();
  if (auto ok = state->make_objects(); !ok) return ok.error();
  state->due.environment = state->due.materials = state->due.pose = false;
  return LivePicture(std::move(state));
}

Result<void> LivePicture::ask(const DrawRequest& request) {
  State& s = *state_;
  auto parsed = parse_live(s.baked, request);
  if (!parsed) return parsed.error();
  const DrawRequest before = s.asked;
  const bool sky = !is_same(before, request, {"env", "light-order", "window"}) ||
                   before.environment != request.environment;
  const bool materials =
      !is_same(before, request, {"brdf", "show", "method", "brdf-samples", "tolerance", "terms", "insert"});
  const bool places = !is_same(before, request, {"place", "move"});
  const bool time = before.time != request.time;
  const bool objects = places || !is_same(before, request, {"insert"}) || (time && !request.move.empty());
  const bool left_alone = s.has_objects() && request.place.empty() && request.insert.empty();
  const bool pose = left_alone || !is_same(before, request, {"animation", "deform"}) ||
                    (time && !request.animation.empty());
  s.asked = request;
  auto made = [&]() -> Result<void> {
    if (sky)
      if (auto ok = s.make_environment_due(); !ok) return ok;
    if (materials)
      if (auto ok = s.make_materials(); !ok) return ok;
    if (places)
      if (auto ok = s.make_objects(); !ok) return ok;
    if (left_alone) s.company.reset();  // the pose is of the scene alone
    return pose ? s.make_pose() : Result<void>();
  }();
  if (!made) {  // back to what was, which did not fail
    s.asked = before;
    if (sky) (void)s.make_environment_due();
    if (materials) (void)s.make_materials();
    if (places) (void)s.make_objects();
    if (pose) (void)s.make_pose();
    if (s.has_objects()) s.due.objects = s.due.values = true;
    if (materials || sky) s.due.light = true;
    return made;
  }
  const View& old = s.view;
  const bool moved = !(old.camera.eye == parsed->view.camera.eye && old.camera.target == parsed->view.camera.target &&
                       old.camera.fov == parsed->view.camera.fov && old.width == parsed->view.width &&
                       old.height == parsed->view.height);
  s.due.light |= sky || materials || !is_same(before, request, {"env-rotate", "lamp", "sphere-lamp"});
  s.due.values |= pose || objects, s.due.rays |= pose || moved;
  s.due.objects |= objects;
  s.due.shades |= !is_same(before, request, {"background"}) || before.spp > request.spp;
  s.view = parsed->view, s.turn = parsed->turn;
  return {};
}

const DrawRequest& LivePicture::request() const { return state_->asked; }

Result<void> LivePicture::look_as(Look look, int coefficient) {
  State& s = *state_;
  const size_t columns = s.light_basis().count();
  if (look == Look::coefficient && (s.blocks || size_t(std::max(0, coefficient)) >= columns || coefficient < 0))
    return Error{"look",
                 columns == 0 ? "blocks and wavelets have no coefficients to show"
                              : "the file has coefficients 0 to " + std::to_string(columns - 1),
                 true};
  if (look == Look::coefficient && !std::holds_alternative<DiffuseRows>(s.rows))
    return Error{"look", "one coefficient is of diffuse transfer", true};
  if (s.is_fixed() && look != Look::picture) return Error{"look", "a fixed view has its picture alone", true};
  s.due.light |= s.look != look || s.coefficient != coefficient;
  s.look = look, s.coefficient = coefficient;
  return {};
}

Result<bool> LivePicture::work(bool hurry, double budget) {
  State& s = *state_;
  s.times = {};
  auto step = [](double& ms, auto&& run) -> Result<void> {
    const auto start = LiveClock::now();
    auto ok = run();
    ms = 1e3 * since(start);
    return ok;
  };
  if (done()) return false;
  if (s.due.light || (s.draft_light && !hurry)) {
    if (auto ok = step(s.times.project, [&] { return s.project(hurry); }); !ok) return ok.error();
    s.due.light = false, s.due.values = true;
  }
  if (s.due.rays) {
    for (auto& kept : s.rays) kept.clear();
    s.seen.clear(), s.due.rays = false, s.due.shades = true;
    if (s.blocks) s.due.values = true;  // their radiance depends on the eye
  }
  s.choose_scale(hurry, budget);
  if (s.blocks && hurry && s.receivers_in_view().empty() && s.due.values) {  // rays first: they tell what is seen
    s.draft_values = true, s.sums = {};
    if (auto ok = s.add_sample(); !ok) return ok.error();
  }
  if (s.due.values || (s.draft_values && !hurry)) {
    if (auto ok = step(s.times.relight, [&] { return s.make_values(hurry, budget); }); !ok) return ok.error();
    s.due.values = false, s.due.shades = true;
  }
  if (s.due.shades) s.sums = {}, s.due.shades = false;
  if (s.sums.samples < s.asked.spp)
    if (auto ok = s.add_sample(); !ok) return ok.error();
  return true;
}

bool LivePicture::done() const {
  const State& s = *state_;
  return !s.due.light && !s.due.values && !s.due.rays && !s.due.shades && !s.draft_light && !s.draft_values &&
         s.scale == 1 && s.sums.samples >= s.asked.spp;
}

int LivePicture::samples() const { return state_->sums.samples; }
const Image& LivePicture::image() const { return state_->image; }
const View& LivePicture::view() const { return state_->view; }
const Scene& LivePicture::scene() const { return state_->scene(); }
const Environment* LivePicture::environment() const { return state_->light[0].env ? &*state_->light[0].env : nullptr; }
const LiveTimes& LivePicture::times() const { return state_->times; }

Hit LivePicture::pick(Vec2 at) const {
  const State& s = *state_;
  if (!s.tracer) return {};
  const CameraRays rays(s.view.camera, s.view.width, s.view.height);
  return s.tracer->closest(rays.eye, rays.direction(at.x * float(s.view.width), at.y * float(s.view.height)));
}

std::optional<size_t> LivePicture::object_of(const Hit& hit) const {
  const std::optional<Company>& with = state_->company;
  if (!with || hit.triangle == none) return std::nullopt;
  const auto after = std::upper_bound(with->first.begin(), with->first.end(), size_t(hit.triangle));
  if (after == with->first.begin()) return std::nullopt;
  return size_t(after - with->first.begin()) - 1;
}

}  // namespace lambent

// Lamps under the hand: leaves are lit part by part, the bounces follow, and pixels send shadow rays of their own.
#include <lambent/pipeline/draw_indirect.h>
#include <lambent/core/clock.h>
#include <lambent/pipeline/live_kind.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

double since(Clock::time_point start) { return seconds_since(start); }

constexpr size_t leaves_a_piece = 2048;
constexpr size_t kept_kernels = size_t(2) << 20;
constexpr size_t kept_lights = size_t(16) << 20;
// The bounces of a picture that moves.
constexpr double coarse_tolerance = 1e-2;
constexpr int coarse_bounces = 8;

// All leaves, in pieces.
struct Sweep {
  size_t next = 0, left = 0;
  bool coarse = false;  // some of what was done
  void begin(size_t count) { left = count, coarse = false; }
  // Calls run(first, count) until all was done or `seconds` have gone. How many leaves that were.
  size_t go_on(size_t leaves, bool coarsely, double seconds, auto run) {
    const auto start = Clock::now();
    const size_t before = left;
    coarse |= coarsely && left > 0;
    while (left > 0) {
      if (next >= leaves) next = 0;
      const size_t count = std::min({leaves_a_piece, left, leaves - next});
      run(next, count), next += count, left -= count;
      if (since(start) > seconds) break;
    }
    return before - left;
  }
};

// What rays of the first sample have of each lamp and, last, of what stands still: [ray][light], NaN where it is not
// known.
struct RayLights {
  size_t each = 0;
  std::vector<Vec3> values = {};

  void begin(size_t rays, size_t count) {
    if (each == count && values.size() == rays * count) return;
    each = count, values.assign(rays * count, Vec3(NAN));
  }
  void forget(size_t light) {
    for (size_t i = light; light < each && i < values.size(); i += each) values[i] = Vec3(NAN);
  }
  void forget_all() { values.clear(); }
  std::span<Vec3> of(size_t ray) { return std::span(values).subspan(ray * each, each); }
};

class LiveIndirect : public LiveKind {
 public:
  LiveIndirect(const Baked& baked, const DrawRequest& request, const Job& job)
      : LiveKind(baked, request, job), d_{request_, job_, std::get<IndirectTransfer>(baked.surface.store), {}} {}

  Result<void> begin(const LiveSkies& skies) {
    if (auto ok = check(); !ok) return ok;
    auto show = parse_show(request_.show);
    if (!show) return show.error();
    at_receivers_.show = RenderOptions::Show::radiosity, at_receivers_.directional = directional_of(baked_.surface);
    d_.show = *show, d_.scene = baked_.scene, skies_ = skies;
    set_sky(d_, turned(0));
    if (auto ok = read_lamps(d_); !ok) return ok;
    move_lamps();
    if (auto ok = paint(); !ok) return ok;
    return make_places(d_);
  }

  const Scene& scene() const override { return d_.scene; }
  const Tracer& tracer() const override { return d_.tracer; }
  std::shared_ptr<const Scene> lit_scene() const override {
    return std::make_shared<const Scene>(scene_with_lamps(d_));
  }
  std::vector<std::string> lamp_names() const override { return d_.still.lamps.names; }

  Result<Light> light(bool hurry, double budget, LiveTimes& times) override {
    const size_t leaves = d_.transfer.surfels.count();
    auto start = Clock::now();
    if (sky_due_ || (sky_coarse_ && !hurry)) {
      turn_sky(hurry), sky_due_ = false, still_due_ = true;
      sky_coarse_ = hurry && skies_.env[0] && skies_.env[0]->image.width > skies_.env[1]->image.width;
    }
    times.project = 1e3 * since(start), start = Clock::now();
    const IndirectQuality quality = hurry ? hurried_indirect : IndirectQuality();
    if (d_.still.shines() && (still_due_ || (still_.coarse && !hurry))) still_.begin(leaves), still_due_ = false;
    still_.go_on(leaves, hurry, budget / 2,
                 [&](size_t first, size_t count) { light_leaves(d_, first, count, quality); });
    bool more = still_.left > 0;
    times.shaded = 0;
    for (size_t k = 0; k < d_.lit.size(); ++k) {
      if (!hurry && sweeps_[k].coarse) sweeps_[k].begin(leaves);
      times.shaded += sweeps_[k].go_on(leaves, hurry, budget - since(start),
                                       [&](size_t first, size_t count) { light_lamp(d_, k, first, count, quality); });
      more |= sweeps_[k].left > 0;
    }
    if (!hurry && more) return times.relight = 1e3 * since(start), Light::unfinished;
    sum_direct(d_);
    if (solve_due_) d_.solve = make_indirect_solve(d_.transfer, albedos_), solve_due_ = false;
    if (hurry) solve_indirect(d_.transfer, d_.solve, d_.direct, coarse_tolerance, coarse_bounces);
    else solve_indirect(d_.transfer, d_.solve, d_.direct);
    if (!hurry) part_near_light(d_);
    if (request_.at == "receivers") read_receivers(d_, directional_of(baked_.surface));
    times.relight = 1e3 * since(start);
    return more ? Light::partial : hurry ? Light::draft : Light::whole;
  }

  std::function<RayShade()> shade(const Pass& pass) override {
    std::vector<Kernels>& kept = kernels_[size_t(pass.scale)];
    RayLights& lights = lights_[size_t(pass.hurry ? pass.scale : 0)];
    if (pass.fresh) {
      for (auto& kernels : kernels_) kernels.clear();
      for (RayLights& l : lights_) l.forget_all();
    }
    const size_t count = pass.rays.rays.size(), each = d_.lamps.size() + 1;
    const bool keeps = pass.sample == 0 && d_.show.part != Show::Part::direct && count <= kept_kernels;
    if (keeps && kept.size() != count) kept.assign(count, Kernels{.count = SIZE_MAX});
    const bool lit = pass.sample == 0 && d_.show.part != Show::Part::indirect && count * each <= kept_lights;
    if (lit) lights.begin(count, each);
    const IndirectQuality quality = pass.hurry ? hurried_indirect : quality_of(request_);
    return [this, &kept, keeps, &lights, lit, quality, &rays = pass.rays.rays, eye = pass.eye]() -> RayShade {
      const IndirectShade bounced = bounced_light(d_, baked_, at_receivers_, at_receivers_);
      return [this, &kept, keeps, &lights, lit, quality, &rays, eye, bounced](size_t ray) {
        const Hit& hit = rays[ray].hit;
        KnownPlace known{nullptr, lit ? lights.of(ray) : std::span<Vec3>()};
        if (keeps && !bounced) {
          if (kept[ray].count == SIZE_MAX) kept[ray] = kernels_at(d_, hit);
          known.kernels = &kept[ray];
        }
        return shade_indirect(d_, eye, quality, hit, rays[ray].direction, known, bounced);
      };
    };
  }
  bool shades_coarsely() const override { return true; }

 private:
  std::optional<Environment> turned(bool coarse) const {
    const Environment* env = skies_.env[coarse ? 1 : 0].get();
    if (!env) return std::nullopt;
    return request_.env_rotate.empty() ? *env : rotated(*env, skies_.turn);
  }
  // What was known of leaves shows until they are lit anew.
  void turn_sky(bool coarse) {
    auto kept = std::move(d_.still.at_leaves);
    const size_t groups = d_.still.lamps.groups();
    set_sky(d_, turned(coarse));
    if (groups == d_.still.lamps.groups()) d_.still.at_leaves = std::move(kept);
    forget_still();
  }
  void forget_still() {
    for (RayLights& l : lights_) l.forget(l.each - 1);
  }
  void forget_light(size_t light) {
    for (RayLights& l : lights_) l.forget(light);
  }
  // Lamps that stand as one did keep its light; others have that of the one in their place until they are lit.
  void move_lamps() {
    for (const LampPath& path : d_.paths) move_lamp(d_.lamps, path, request_.time);
    std::vector<LitLamp> lit = std::exchange(d_.lit, {});
    std::vector<Sweep> sweeps = std::exchange(sweeps_, {});
    const size_t leaves = d_.transfer.surfels.count(), count = d_.lamps.size();
    d_.lit.resize(count), sweeps_.resize(count);
    std::vector<bool> moved(count, true);
    for (size_t k = 0; k < count; ++k)
      for (size_t i = 0; i < lit.size() && moved[k]; ++i) {
        if (lit[i].at_leaves.empty() || !is_same(lit[i].lamp, d_.lamps[k])) continue;
        d_.lit[k] = std::move(lit[i]), sweeps_[k] = sweeps[i], moved[k] = false;
        lit[i].at_leaves.clear();
        if (i != k) forget_light(k);  // whose rays are keyed by its place in the list
      }
    for (size_t k = 0; k < count; ++k) {
      if (!moved[k]) continue;
      if (k < lit.size()) d_.lit[k].at_leaves = std::move(lit[k].at_leaves);
      d_.lit[k].lamp = d_.lamps[k], d_.lit[k].at_leaves.resize(leaves, Vec3(0.0f));
      sweeps_[k].begin(leaves), forget_light(k);
    }
  }
  Result<void> paint() {
    d_.scene.materials = baked_.scene.materials, d_.scene.colors = baked_.scene.colors;
    albedos_ = d_.transfer.surfels.albedos, solve_due_ = true, d_.near.clear();
    return repaint(request_, d_.scene, d_.transfer.surfels, albedos_);
  }
  // What pictures one by one have alone.
  Result<void> check() const {
    const char* const option = !request_.insert.empty()   ? "--insert"
                             : request_.frame_bounces > 0 ? "--frame-bounces"
                             : request_.frame_leaves > 0  ? "--frame-leaves"
                                                          : nullptr;
    if (option) return Error{option, "is of `render` where light is direct to indirect: no window draws it", true};
    return {};
  }
  void restore_sky() override { sky_due_ = sky_due_ || skies_.env[0]; }
  Result<void> change(const DrawRequest& before, Due& due) override {
    if (auto ok = check(); !ok) return ok;
    auto show = parse_show(request_.show);
    if (!show) return show.error();
    due.shades = before.show != request_.show;
    d_.show = *show;
    if (before.env != request_.env || before.env_rotate != request_.env_rotate ||
        before.environment != request_.environment)
      sky_due_ = due.light = true;
    if (bool(skies_.env[0]) != bool(d_.still.sky)) {  // groups are others
      set_sky(d_, turned(0)), still_due_ = true;
      for (RayLights& l : lights_) l.forget_all();
    }
    const bool shone = d_.still.shines();
    const std::vector<Vec3> scales = d_.still.scales;
    if (auto ok = read_lamps(d_); !ok) return ok;
    if (scales != d_.still.scales) forget_still();
    move_lamps();
    due.light |= before.lamp != request_.lamp || before.move != request_.move || before.time != request_.time ||
                 before.at != request_.at || before.near_rays != request_.near_rays || before.albedo != request_.albedo;
    if (!shone && d_.still.shines()) still_due_ = true;
    if (before.albedo == request_.albedo) return {};
    if (auto ok = paint(); !ok) return ok;
    if (!d_.tracer.lets_pass()) return {};
    due.rays = still_due_ = true;  // paint is solid
    for (Sweep& sweep : sweeps_) sweep.begin(d_.transfer.surfels.count());
    return make_places(d_);
  }

  IndirectDrawing d_;
  std::vector<Vec3> albedos_ = {};
  RenderOptions at_receivers_ = {};  // light alone, where it is read there
  bool sky_due_ = false, sky_coarse_ = false, still_due_ = true, solve_due_ = true;
  Sweep still_ = {};
  std::vector<Sweep> sweeps_ = {};  // of each lamp
  // Of the first sample's rays, by scale.
  std::array<std::vector<Kernels>, 5> kernels_ = {};
  std::array<RayLights, 5> lights_ = {};  // in a hurry; 0: at rest
};

}  // namespace

Result<std::unique_ptr<LiveKind>> make_live_indirect(const Baked& baked, const DrawRequest& request,
                                                     const LiveSkies& skies, const Job& job) {
  return make_live<LiveIndirect>(baked, request, skies, job);
}

}  // namespace lambent

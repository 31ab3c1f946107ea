// A transfer texture under the hand: over any scene, moving or not, baked or not.
#include <lambent/light/lamps.h>
#include <lambent/core/clock.h>
#include <lambent/pipeline/draw_texture.h>
#include <lambent/pipeline/live_kind.h>
#include <lambent/pipeline/motion.h>

#include <algorithm>
#include <chrono>

namespace lambent {
namespace {

class LiveTexture : public LiveKind {
 public:
  using LiveKind::LiveKind;

  Result<void> begin(const LiveSkies& skies) {
    skies_ = skies;
    if (auto ok = load_texture(); !ok) return ok;
    if (auto ok = load_use(); !ok) return ok;
    if (auto ok = read_request(); !ok) return ok;
    const bool is_bake = receivers_of(baked_.surface.store) > 0;
    const std::string why = is_bake ? cannot_light(baked_, request_) : "";
    if (!why.empty()) job_.warn(request_.baked + ": what was baked is left out, its shadows too, since " + why);
    if (baked_.scene.texcoords[0].empty())
      job_.warn(request_.baked + ": has no texture coordinates, so that the transfer texture shows as one colour");
    return make_pose();
  }

  const Scene& scene() const override { return pose_ ? moved_ : baked_.scene; }
  const Tracer& tracer() const override { return *tracer_; }

  Result<Light> light(bool hurry, double, LiveTimes& times) override {
    const auto start = Clock::now();
    const auto &env = skies_.env[hurry ? 1 : 0], &whole = skies_.env[0];
    const Surroundings around{.env = env,
                              .rotation = skies_.turn,
                              .seen = request_.background == "env",
                              .known = skies_.known[hurry ? 1 : 0]};
    auto light = column_light(request_, around, LightBasis{.order = texture_.transfer.order}, scene().origin, false);
    if (!light) return light.error();
    local_ = light->local();
    const auto then = Clock::now();
    arriving_ = {};
    const bool lights = receivers_of(baked_.surface.store) > 0 && cannot_light(baked_, request_).empty();
    if (lights && !relighter_) {
      auto made = Relighter::make(baked_.surface);
      if (!made) return Error{request_.baked, made.error().message};
      relighter_.emplace(std::move(*made));
    }
    if (lights) {
      auto parts = relight_arriving(*relighter_, baked_, request_, around);
      if (!parts) return parts.error();
      arriving_ = std::move(*parts), times.shaded = receivers_of(baked_.surface.store);
    }
    using Milliseconds = std::chrono::duration<double, std::milli>;
    times.project = Milliseconds(then - start).count();
    times.relight = Milliseconds(Clock::now() - then).count();
    return hurry && env && env->image.width < whole->image.width ? Light::draft : Light::whole;
  }

  std::function<RayShade()> shade(const Pass& pass) override {
    at_.reset();
    if (arriving_.all)
      at_.emplace(ArrivingAt{*arriving_.all, std::get<CornerReceivers>(baked_.basis),
                             arriving_.peaks ? &*arriving_.peaks : nullptr});
    return by_number(pass.rays,
                     transfer_texture_shade(scene(), texture_, use_, local_, show_.colour, at_ ? &*at_ : nullptr));
  }

 private:
  Result<void> load_texture() {
    auto texture = load_zonal_texture(request_.transfer_texture);
    if (!texture) return texture.error();
    texture_ = std::move(*texture);
    return {};
  }
  Result<void> load_use() {
    auto use = texture_use(request_, texture_, job_);
    if (!use) return use.error();
    use_ = std::move(*use);
    return {};
  }
  // What can be wrong with the light, before it is made.
  Result<void> read_request() {
    auto show = parse_show(request_.show);
    if (!show) return show.error();
    if (auto lamps = parse_sphere_lamps(request_.sphere_lamp, baked_.scene.origin); !lamps) return lamps.error();
    show_ = *show;
    return {};
  }
  Result<void> make_pose() {
    auto poses = make_poses({request_.animation, "", request_.deform, request_.time}, baked_.scene);
    if (!poses) return poses.error();
    pose_ = std::move(poses->front());
    if (pose_) moved_ = posed(baked_.scene, *pose_);
    if (auto ok = press(); !ok) return ok;
    auto built = Tracer::build(scene(), job_.progress);
    if (!built) return built.error();
    tracer_.emplace(std::move(*built));
    return {};
  }
  Result<void> press() {
    const DrawRequest& r = request_;
    std::vector<std::string> of{r.transfer_texture, r.wrinkle, r.tile, r.animation, r.deform};
    if (of != pressed_of_) {
      auto wrinkles = Wrinkles::make(r, use_, baked_.scene, job_);
      if (!wrinkles) return wrinkles.error();
      wrinkles_ = std::move(*wrinkles), pressed_of_ = std::move(of);
    }
    wrinkles_.press(baked_.scene, pose_, use_);
    return {};
  }
  Result<void> change(const DrawRequest& was, Due& due) override {
    const DrawRequest& is = request_;
    const auto use = [](const DrawRequest& r) {
      return std::tie(r.tile, r.groove_map, r.groove_depth, r.groove_width, r.wrinkle);
    };
    const auto pose = [](const DrawRequest& r) { return std::tie(r.animation, r.deform, r.time); };
    const auto sky = [](const DrawRequest& r) {
      return std::tie(r.env, r.env_rotate, r.environment, r.window, r.light_order, r.sphere_lamp);
    };
    if (auto ok = read_request(); !ok) return ok;
    const bool other = was.transfer_texture != is.transfer_texture;
    if (other)
      if (auto ok = load_texture(); !ok) return ok;
    if (other || use(was) != use(is)) {
      if (auto ok = load_use(); !ok) return ok;
      if (pose(was) == pose(is))
        if (auto ok = press(); !ok) return ok;
    }
    due.light = other || sky(was) != sky(is) || (pose(was) != pose(is));
    due.shades = other || use(was) != use(is) || was.show != is.show;
    due.rays = pose(was) != pose(is);
    return due.rays ? make_pose() : Result<void>();
  }

  Show show_ = {};
  ZonalTexture texture_ = {};
  TextureUse use_ = {};
  Wrinkles wrinkles_ = {};
  std::vector<std::string> pressed_of_ = {};  // what they are made of
  LocalLight local_ = {};
  std::optional<Relighter> relighter_ = std::nullopt;
  ArrivingParts arriving_ = {};
  std::optional<ArrivingAt> at_ = std::nullopt;
  std::optional<Pose> pose_ = std::nullopt;
  Scene moved_ = {};
  std::optional<Tracer> tracer_ = std::nullopt;
};

}  // namespace

Result<std::unique_ptr<LiveKind>> make_live_texture(const Baked& baked, const DrawRequest& request,
                                                    const LiveSkies& skies, const Job& job) {
  return make_live<LiveTexture>(baked, request, skies, job);
}

}  // namespace lambent

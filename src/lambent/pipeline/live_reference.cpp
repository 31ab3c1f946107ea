#include <lambent/pipeline/live_reference.h>

#include <lambent/light/project.h>
#include <lambent/pipeline/bake_request.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/relight/light.h>

#include <atomic>
#include <charconv>
#include <mutex>
#include <thread>

namespace lambent {

struct LiveReference::State {
  std::thread thread;
  std::unique_ptr<Progress> progress;
  std::mutex mutex;
  Image sum;
  std::vector<Vec3> behind;  // each pixel's environment, as the live picture shows it; empty: black
  int paths = 0;
  std::string error;
  std::atomic<bool> running{false};

  void trace(const Scene& scene, const Environment& env, const View& view, ReferenceOptions options) {
    options.width = view.width, options.height = view.height, options.spp = 1;
    for (uint32_t pass = 0; !progress->cancelled() && pass < 1u << 16; ++pass) {
      options.seed = pass + 1;
      auto traced = path_trace(scene, env, view.camera, options, progress.get());
      std::lock_guard lock(mutex);
      if (!traced) {
        if (!progress->cancelled()) error = traced.error().text();
        break;
      }
      if (paths == 0) sum = std::move(traced->image);
      else
        for (size_t i = 0; i < sum.rgb.size(); ++i)
          sum.rgb[i] += traced->image.rgb[i], sum.alpha[i] += traced->image.alpha[i];
      paths += options.spp;
    }
    running = false;
  }
};

LiveReference::LiveReference() : state_(std::make_unique<State>()) {}
LiveReference::LiveReference(LiveReference&&) noexcept = default;
LiveReference& LiveReference::operator=(LiveReference&&) noexcept = default;
LiveReference::~LiveReference() {
  if (state_) stop();
}

void LiveReference::stop() {
  if (!state_->thread.joinable()) return;
  state_->progress->cancel();
  state_->thread.join();
}

void LiveReference::start(const LivePicture& picture, const ReferenceOptions& options, int order) {
  stop();
  State& s = *state_;
  s.paths = 0, s.error.clear(), s.progress = std::make_unique<Progress>(), s.running = true;
  const Mat3 turn = *parse_rotation(picture.request().env_rotate, "--env-rotate");
  Environment env = picture.environment() ? *picture.environment() : Environment{"", Image(2, 1), {}};
  ReferenceOptions of = options;
  of.background = false;  // that of all of the light is put behind
  s.behind.clear();
  if (picture.request().background == "env" && picture.environment()) {
    const View& view = picture.view();
    const CameraRays rays(view.camera, view.width, view.height);
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x)
        s.behind.push_back(radiance_bilinear(env, transpose(turn) * rays.direction(float(x) + 0.5f, float(y) + 0.5f)));
  }
  s.thread = std::thread([&s, scene = picture.lit_scene(), view = picture.view(), of, order, turn,
                          turned = picture.request().env_rotate != "", env = std::move(env)]() mutable {
    if (order > 0) {
      const LightProjection bands = project_light(env, LightBasis{.order = order}, turn);
      env = reconstruct_environment(bands.basis, bands.light);
    } else if (turned) {
      env = rotated(env, turn, 2);
    }
    s.trace(*scene, env, view, of);
  });
}

bool LiveReference::running() const { return state_->running; }

LiveReference::Seen LiveReference::seen() const {
  std::lock_guard lock(state_->mutex);
  Seen out{state_->sum, state_->paths, state_->error};
  const float each = 1.0f / float(std::max(out.paths, 1));
  for (size_t i = 0; i < out.image.rgb.size(); ++i) {
    out.image.rgb[i] *= each, out.image.alpha[i] *= each;
    if (!state_->behind.empty()) out.image.rgb[i] += (1 - out.image.alpha[i]) * state_->behind[i];
  }
  return out;
}

int LiveReference::paths() const {
  std::lock_guard lock(state_->mutex);
  return state_->paths;
}

ReferenceOptions reference_options(const Baked& baked, const DrawRequest& request) {
  ReferenceOptions out;
  std::string brdf = request.brdf;
  if (auto baked_by = request_of_baked_file(request.baked, ""); baked_by) {
    const std::string& bounces = baked_by->bounces;
    int count = 0;
    if (std::from_chars(bounces.data(), bounces.data() + bounces.size(), count).ec == std::errc()) out.bounces = count;
    else out.bounces = 16;  // until they converge
    if (brdf.empty() && outgoing_of(baked.surface)) brdf = baked_by->brdf;
    if (kind_of(baked.surface) == DrawKind::blocks) out.bounces = 0;
  }
  if (!request.material.empty()) {
    if (auto reflection = block_reflection(baked.scene, request)) out.reflection = std::move(*reflection);
  } else if (!brdf.empty())
    if (auto reflection = parse_reflection(brdf)) out.reflection = std::move(*reflection);
  const bool by_lamps = kind_of(baked.surface) == DrawKind::indirect;
  if (by_lamps) out.bounces = 16;
  out.lamps = by_lamps || !light_of(baked.surface.store).groups.empty();
  return out;
}

}  // namespace lambent

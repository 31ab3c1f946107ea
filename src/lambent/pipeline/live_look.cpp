#include <lambent/pipeline/live_look.h>

#include <lambent/bake/gather.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace lambent {
namespace {

constexpr int hit_rays = 64;

Vec3 signed_color(float x) { return x < 0 ? Vec3(-x, -0.25f * x, 0) : Vec3(0, 0.5f * x, x); }

// A colour of the receiver's own, darker towards the borders between receivers.
Vec3 receiver_color(uint32_t receiver, float weight) {
  const uint64_t h = hash64(receiver, 0x5eed);
  const Vec3 hue(float(h & 255), float(h >> 8 & 255), float(h >> 16 & 255));
  return (0.15f + 0.85f * weight) * (0.3f + 0.7f / 255 * hue);
}

// The receivers that a file was baked at, again; none where they are not made from its scene alone.
std::optional<Receivers> receivers_again(const Baked& baked) {
  if (const auto* at = vertices_of(baked)) {
    Receivers made = make_vertex_receivers(baked.scene);
    if (made.front == at->front && made.back == at->back) return made;
  }
  if (const auto* at = std::get_if<PatchPlacement>(&baked.surface.where)) {
    Receivers made = make_patch_receivers(baked.scene);
    const auto again = placement_of(baked.scene, made);
    const auto* same = std::get_if<PatchPlacement>(&again);
    if (same && same->front == at->front && same->back == at->back) return made;
  }
  return std::nullopt;
}

// The share of cosine-distributed rays that meet something.
float share_of_hits(const Tracer& tracer, const Receivers& receivers, size_t r) {
  const Mat3 frame = frame_about(receivers.normals[r]);
  int met = 0;
  for (int i = 0; i < hit_rays; ++i) {
    const Vec3 local = square_to_cosine_hemisphere(sobol_owen(uint32_t(i), uint32_t(hash64(r, 0x417))));
    met += tracer.closest(receivers.origins[r], frame * local).triangle != none;
  }
  return float(met) / hit_rays;
}

}  // namespace

struct LookMeasure::State {
  std::thread thread;
  Progress progress;
  std::atomic<bool> rays_known = false, error_known = false;
  bool rays_begun = false, error_begun = false;
  std::vector<float> hits;
  std::vector<uint8_t> buried;
  ErrorView error;
  std::string failure;

  void find_rays(const Baked& baked) {
    const auto receivers = receivers_again(baked);
    auto tracer = Tracer::build(baked.scene, &progress);
    if (!tracer || !receivers) {
      failure = tracer ? "its receivers are not those of its scene" : tracer.error().text();
    } else {
      const size_t count = receivers->count();
      hits.assign(count, 0.0f), buried.assign(count, 0);
      parallel_for(count, 64, [&](size_t begin, size_t end) {
        if (progress.cancelled()) return;
        for (size_t r = begin; r < end; ++r)
          hits[r] = share_of_hits(*tracer, *receivers, r), buried[r] = is_buried(*tracer, *receivers, r);
      });
    }
    rays_known = true;
  }
  void find_error(const Baked& baked) {
    auto tracer = Tracer::build(baked.scene, &progress);
    auto made = tracer ? measure_error(baked, *tracer, {&progress, [](const std::string&) {}}) : tracer.error();
    if (made) error = std::move(*made);
    else failure = made.error().text();
    error_known = true;
  }
};

LookMeasure::LookMeasure() : state_(std::make_unique<State>()) {}
LookMeasure::LookMeasure(LookMeasure&&) noexcept = default;
LookMeasure& LookMeasure::operator=(LookMeasure&&) noexcept = default;
LookMeasure::~LookMeasure() {
  if (!state_ || !state_->thread.joinable()) return;
  state_->progress.cancel();
  state_->thread.join();
}

Result<void> LookMeasure::check(Look look, const Baked& baked) {
  if (look == Look::error) return can_measure_error(baked);
  const bool known = vertices_of(baked) || std::holds_alternative<PatchPlacement>(baked.surface.where);
  if (!known) return Error{"look", "hits and buried ones are of bakes at vertices and patches", true};
  return {};
}

void LookMeasure::start(Look look, const Baked& baked) {
  State& s = *state_;
  bool& begun = look == Look::error ? s.error_begun : s.rays_begun;
  if (begun) return;
  if (s.thread.joinable()) {
    if (!(s.rays_begun ? s.rays_known : s.error_known)) return;  // one at a time
    s.thread.join();
  }
  begun = true, s.failure.clear();
  s.thread = std::thread([&s, &baked, look] { look == Look::error ? s.find_error(baked) : s.find_rays(baked); });
}

bool LookMeasure::knows(Look look) const { return look == Look::error ? state_->error_known : state_->rays_known; }
std::string LookMeasure::failure() const { return state_->failure; }
const std::vector<float>& LookMeasure::hits() const { return state_->hits; }
const std::vector<uint8_t>& LookMeasure::buried() const { return state_->buried; }
const ErrorView& LookMeasure::error() const { return state_->error; }

namespace {

Vec3 look_of_receivers(const LookAt& at, const Hit& hit) {
  Vec3 out(0.0f);
  std::visit(
      [&](const auto& b) {
        const auto* corners = b.find(hit.triangle, hit.front);
        if (!corners) return;
        uint32_t nearest = none;
        float most = -1, value = 0;
        Vec3 row(0.0f);
        b.spread(*corners, hit.u, hit.v, [&](uint32_t receiver, float weight) {
          if (weight > most) nearest = receiver, most = weight;
          if (at.look == Look::coefficient) value += weight * at.relit.at(receiver).x;
          if (at.look == Look::hits) value += weight * at.measured.hits()[receiver];
          if (at.look == Look::rows) row += weight * at.relit.at(receiver, at.number);
        });
        if (nearest == none) return;
        switch (at.look) {
          case Look::coefficient: out = signed_color(value); return;
          case Look::hits: out = false_color(value); return;
          case Look::rows:
            out = largest(row) <= 0 ? signed_color((row.x + row.y + row.z) / 3) : max(row, Vec3(0));
            return;
          case Look::receivers: out = receiver_color(nearest, most); return;
          case Look::buried: out = at.measured.buried()[nearest] ? Vec3(1, 0.05f, 0) : Vec3(0.35f); return;
          default: return;
        }
      },
      at.basis);
  return out;
}

}  // namespace

std::function<SurfaceShade()> look_shade(const LookAt& at) {
  const Bounds box = bounds(at.scene);
  const float unit = length(box.max - box.min) / 1000;
  return [at, unit]() -> SurfaceShade {
    return [at, unit](const Hit& hit, Vec3) {
      if (at.look != Look::density) return look_of_receivers(at, hit);
      // Triangles for each thousandth of the scene's size squared, from 1/16 to 65,536.
      const float area = length(area_normal(at.scene, at.scene.triangles[hit.triangle])) / 2;
      return false_color((std::log2(unit * unit / std::max(area, 1e-30f)) + 4) / 20);
    };
  };
}

}  // namespace lambent

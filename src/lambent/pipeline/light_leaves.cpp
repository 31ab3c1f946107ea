#include <lambent/pipeline/draw_indirect.h>

#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <cmath>
#include <limits>

// Direct light at leaves, of what stands still and of lamps that move.
namespace lambent {
namespace {

constexpr float near_a_lamp = 3;  // spacings
constexpr uint32_t still_seed = 0x57111;

}  // namespace

std::vector<LampLight>& still_light(const IndirectDrawing& d, const Scene& scene, const Tracer& tracer, Vec3 origin,
                                    Vec3 normal, int samples, uint64_t key) {
  const StillLight& still = d.still;
  thread_local std::vector<LampLight> arrived;
  arrived.clear();
  if (!still.shines()) return arrived;
  const bool spreads = still.lamps.sky || !still.lamps.area.empty();
  const size_t rays = spreads ? size_t(samples) : 0;
  sample_lamps(scene, tracer, still.lamps, origin, normal, samples, rays, still_seed, key, arrived);
  const Mat3 frame = frame_about(normal);
  for (size_t i = 0; i < rays; ++i) {
    const Vec3 local = square_to_cosine_hemisphere(sobol_owen(uint32_t(i), uint32_t(hash64(key, still_seed))));
    const Vec3 direction = frame * local;
    const Hit hit = tracer.closest(origin, direction);
    if (hit.triangle == none && still.lamps.sky)
      arrived.push_back(met_sky(still.lamps, direction, local.z, samples, rays));
    if (hit.triangle == none || still.lamps.of_triangle.empty()) continue;
    const uint32_t lamp = still.lamps.of_triangle[hit.triangle];
    if (lamp != none && emits(scene, scene.triangles[hit.triangle], hit.front))
      arrived.push_back(met_lamp(scene, still.lamps, lamp, hit, direction, local.z, samples, rays));
  }
  return arrived;
}

Vec3 scaled_sum(const StillLight& still, const std::vector<LampLight>& arrived) {
  Vec3 sum(0.0f);
  for (const LampLight& l : arrived) sum += still.scales[l.group] * l.value;
  return sum;
}

namespace {

bool is_near(const IndirectDrawing& d, size_t leaf, Vec3 lamp) {
  return length(d.transfer.surfels.positions[leaf] - lamp) < near_a_lamp * d.transfer.surfels.spacings.back();
}

// Calls light(place's lifted origin, its normal, number of places, key) for the places of a leaf. From any thread, but
// of one leaf from one at a time.
size_t over_leaf(IndirectDrawing& d, size_t leaf, bool near, const IndirectQuality& quality, auto light) {
  near = near && quality.places_near > quality.places;
  std::vector<SurfacePlace>& many = d.near_places[leaf];
  if (near && many.empty())
    many = places_of_leaf(d.scene, d.tracer, d.transfer.surfels, *d.search, uint32_t(leaf), quality.places_near);
  const std::vector<SurfacePlace>& places = near ? many : d.places[leaf];
  const size_t count = near ? places.size() : std::min(places.size(), quality.places);
  for (size_t k = 0; k < count; ++k) {
    const Vec3 p = places[k].position, n = places[k].normal;
    light(p + n * receiver_lift(p, 0, d.diagonal), n, count, hash64(leaf, k));
  }
  return count;
}

}  // namespace

void light_leaves(IndirectDrawing& d, size_t first, size_t count, const IndirectQuality& quality,
                  ProgressStage* stage) {
  d.still.at_leaves.resize(d.transfer.surfels.count());
  if (!d.still.shines()) return;
  parallel_for(count, 64, [&](size_t begin, size_t end) {
    for (size_t i = first + begin; i < first + end; ++i) {
      if (stage && stage->cancelled()) return;
      const bool near = std::any_of(d.scene.lights.begin(), d.scene.lights.end(), [&](const PunctualLight& l) {
        return l.kind != PunctualLight::Kind::directional && is_near(d, i, l.position);
      });
      std::vector<LampLight>& sums = d.still.at_leaves[i];
      sums.clear();
      const size_t places = over_leaf(d, i, near, quality, [&](Vec3 origin, Vec3 normal, size_t, uint64_t key) {
        for (const LampLight& l : still_light(d, d.scene, d.tracer, origin, normal, quality.still_samples, key)) {
          auto sum = std::find_if(sums.begin(), sums.end(), [&](const LampLight& s) { return s.group == l.group; });
          if (sum == sums.end()) sums.push_back({l.group, normal, l.value});
          else sum->value += l.value;
        }
      });
      for (LampLight& sum : sums) sum.value /= float(places);
      if (stage) stage->advance();
    }
  });
}

namespace {

// Direct light by a lamp that moves, of leaves leaf_of(0), ..., leaf_of(count - 1).
void light_by(IndirectDrawing& d, const MovingLamp& lamp, size_t count, auto leaf_of, const IndirectQuality& quality,
              std::vector<Vec3>& at_leaves) {
  parallel_for(count, 128, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t leaf = leaf_of(i);
      const bool near = lamp.kind != MovingLamp::Kind::sun && is_near(d, leaf, lamp.light.position);
      Vec3 sum(0.0f);
      const size_t places = over_leaf(d, leaf, near, quality, [&](Vec3 origin, Vec3 normal, size_t of, uint64_t key) {
        sum += direct_light(d.tracer, {&lamp, 1}, origin, normal, std::max(quality.lamp_samples / int(of), 1), key);
      });
      at_leaves[leaf] = sum / float(places);
    }
  });
}

Vec3 still_at_leaf(const IndirectDrawing& d, size_t leaf) {
  return d.still.at_leaves.empty() ? Vec3(0.0f) : scaled_sum(d.still, d.still.at_leaves[leaf]);
}

}  // namespace

void light_lamp(IndirectDrawing& d, size_t k, size_t first, size_t count, const IndirectQuality& quality) {
  light_by(
      d, d.lit[k].lamp, count, [first](size_t i) { return first + i; }, quality, d.lit[k].at_leaves);
}

void light_some_leaves(IndirectDrawing& d, const MovingLamp& lamp, std::span<const uint32_t> leaves,
                       std::vector<Vec3>& at_leaves) {
  light_by(
      d, lamp, leaves.size(), [&](size_t i) { return leaves[i]; }, {}, at_leaves);
}

size_t follow_lamp(IndirectDrawing& d, size_t k, size_t most) {
  constexpr float brighter = 4;  // than what was found, at most
  LitLamp& lit = d.lit[k];
  const Surfels& s = d.transfer.surfels;
  const Vec3 place = lit.lamp.light.position;
  std::vector<float> due(s.count());
  parallel_for(s.count(), 1024, [&](size_t begin, size_t end) {
    MovingLamp then = lit.lamp;
    for (size_t i = begin; i < end; ++i) {
      const Vec3 p = s.positions[i], moved = place - lit.from[i];
      if (moved == Vec3(0.0f)) continue;
      then.light.position = then.centre = lit.from[i];
      const float now = largest(clear_light(lit.lamp, p, s.normals[i])),
                  before = largest(clear_light(then, p, s.normals[i]));
      if (before > 0) lit.at_leaves[i] = lit.found[i] * std::min(now / before, brighter);
      const float angle = std::min(length(moved) / std::max(length(place - p), 1e-6f * d.diagonal), 1.0f);
      due[i] = std::max(s.areas[i] * (now + before) * angle, std::numeric_limits<float>::min());
    }
  });
  std::vector<uint32_t> leaves;
  for (size_t i = 0; i < due.size(); ++i)
    if (due[i] > 0) leaves.push_back(uint32_t(i));
  const size_t count = std::min(most, leaves.size());
  lit.behind = leaves.size() - count;
  if (lit.behind > 0) {
    std::nth_element(leaves.begin(), leaves.begin() + ptrdiff_t(count), leaves.end(),
                     [&](uint32_t a, uint32_t b) { return due[a] != due[b] ? due[a] > due[b] : a < b; });
    leaves.resize(count), std::sort(leaves.begin(), leaves.end());  // rays side by side
  }
  light_some_leaves(d, lit.lamp, leaves, lit.at_leaves);
  for (const uint32_t i : leaves) lit.found[i] = lit.at_leaves[i], lit.from[i] = place;
  return count;
}

void sum_direct(IndirectDrawing& d) {
  parallel_for(d.direct.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      d.direct[i] = still_at_leaf(d, i);
      for (const LitLamp& lit : d.lit) d.direct[i] += lit.at_leaves[i];
    }
  });
}

}  // namespace lambent

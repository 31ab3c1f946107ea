#include <lambent/bake/directions.h>
#include <lambent/bake/enclosure.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <atomic>

namespace lambent {
namespace {

constexpr size_t few = 256;
constexpr int most_walls = 256;  // along one way
constexpr float beyond = 1e-4f;  // of the distance to a wall, and its other side begins

bool sees_out(const Tracer& tracer, const Receivers& r, size_t i) {
  const FixedFan out(r.normals[i]);
  float visible[FixedFan::count];
  tracer.visible_fan(r.origins[i], {out.x, out.y, out.z, FixedFan::count}, visible);
  return std::any_of(visible, visible + FixedFan::count, [](float v) { return v > 0; });
}

uint32_t last_part(const Scene& scene, const Tracer& tracer, Vec3 origin, Vec3 d) {
  uint32_t part = none;
  float from = 0;
  for (int walls = 0; walls < most_walls; ++walls) {
    const Hit hit = tracer.closest(origin, d, from);
    if (hit.triangle == none) break;
    part = scene.triangles[hit.triangle].part, from = hit.distance * (1 + beyond);
  }
  return part;
}

std::vector<uint32_t> parts_of_receivers(const Scene& scene, const Receivers& receivers) {
  std::vector<uint32_t> parts(receivers.count(), 0);
  if (!receivers.places.empty()) {
    for (size_t r = 0; r < parts.size(); ++r) parts[r] = scene.triangles[receivers.places[r].triangle].part;
    return parts;
  }
  std::visit(
      [&](const auto& basis) {
        for (uint32_t t = 0; t < scene.triangles.size(); ++t)
          for (bool front : {true, false})
            if (const auto* at = basis.find(t, front))
              basis.spread(*at, 0.3f, 0.3f, [&](uint32_t r, float) { parts[r] = at->part; });
      },
      receivers.basis);
  return parts;
}

bool holds_all_others(const Scene& scene, uint32_t part) {
  Bounds own, others;
  for (const Triangle& t : scene.triangles)
    for (uint32_t v : t.v) (t.part == part ? own : others).extend(scene.positions[v]);
  return all_at_most(own.min, others.min) && all_at_most(others.max, own.max);
}

// What the ways outwards from a few receivers meet last, most often met first.
std::vector<uint32_t> outermost_parts(const Scene& scene, const Tracer& tracer, const Receivers& receivers) {
  std::vector<uint32_t> parts;
  std::vector<size_t> met(scene.parts.size(), 0);
  const size_t n = receivers.count(), some = std::min(n, few);
  for (size_t k = 0; k < some; ++k) {
    const size_t i = k * n / some;
    const FixedFan out(receivers.normals[i]);
    for (size_t w = 0; w < FixedFan::count; ++w)
      if (const uint32_t p = last_part(scene, tracer, receivers.origins[i], out[w]); p != none)
        if (met[p]++ == 0) parts.push_back(p);
  }
  std::stable_sort(parts.begin(), parts.end(), [&](uint32_t a, uint32_t b) { return met[a] > met[b]; });
  return parts;
}

}  // namespace

Enclosure find_enclosure(const Scene& scene, const Tracer& tracer, const Receivers& receivers, Progress* progress) {
  const std::vector<uint32_t> owner = parts_of_receivers(scene, receivers);
  std::vector<std::atomic<bool>> sees(scene.parts.size());
  std::atomic<size_t> seeing{0};
  auto look = [&](size_t i) {
    if (seeing < 2 && !sees[owner[i]] && sees_out(tracer, receivers, i) && !sees[owner[i]].exchange(true)) ++seeing;
  };
  const size_t n = receivers.count(), some = std::min(n, few);
  for (size_t k = 0; k < some; ++k) look(k * n / some);
  if (seeing >= 2) return {};
  ProgressStage stage(progress, "ways out", n);
  parallel_for(n, 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) look(i);
    stage.advance(end - begin);
  });
  if (stage.cancelled()) return {};
  if (seeing == 0) return {outermost_parts(scene, tracer, receivers), false};
  const auto part = uint32_t(std::find(sees.begin(), sees.end(), true) - sees.begin());
  const bool has_others = std::any_of(owner.begin(), owner.end(), [&](uint32_t p) { return p != part; });
  if (seeing >= 2 || !has_others || !holds_all_others(scene, part)) return {};
  return {{part}, true};
}

}  // namespace lambent

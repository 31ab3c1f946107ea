#include <lambent/bake/surfels.h>

#include <lambent/bake/surfel_near.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace lambent {
namespace {

// A plane apart counts as so many times its distance.
constexpr float apart = 3;
// Where nothing like it is near, what lies around an edge is better than darkness.
constexpr float around_an_edge = -0.1f;
// Kernels reach so many spacings, where fewer than kernel_slots surfels are nearer.
constexpr float kernel_reach = 2.3f;
constexpr float least_weight = -0.25f;

}  // namespace

SurfacePlace surface_place(const Scene& scene, const Hit& hit) {
  const Triangle& t = scene.triangles[hit.triangle];
  const Vec3 face = unit_normal(scene, t, Vec3(0, 1, 0));
  Vec3 n = normalize_or(interpolate(scene.normals, t, hit.u, hit.v), face);
  if (dot(n, face) < 0) n = -n;
  return {interpolate(scene.positions, t, hit.u, hit.v), hit.front ? n : -n, scene.parts[t.part].material};
}

float distance_between(Vec3 p, Vec3 n, Vec3 q, Vec3 m, float least) {
  if (dot(n, m) < least) return INFINITY;
  const Vec3 d = q - p;
  const float off = dot(d, normalize_or(n + m, n));
  return std::sqrt(std::max(dot(d, d) + (apart * apart - 1) * off * off, 0.0f));
}

float headroom_above(const Tracer& tracer, Vec3 p, Vec3 n, float smallest, float most) {
  const Hit hit = tracer.closest(p + n * smallest, n, 0, most);
  return hit.triangle == none ? INFINITY : hit.distance;
}

bool is_open(const Tracer& tracer, const SurfacePlace& a, const SurfacePlace& b, float smallest, bool over_edge) {
  // Over a ball a chord of normals that differ by t is tan(t/4)/2 of its length below, and rises cos(t/2) of what its
  // ends do: at most 0.16 |a - b|, for t up to 60 degrees. The rest is for facets.
  const float apart_by = length(a.normal - b.normal);
  // The edge between two planes at that angle is tan(t/2)/2 of the chord above it: as far, by cos(t/2).
  const float part = over_edge ? apart_by / (2 + 2 * dot(a.normal, b.normal)) : 0.16f * apart_by;
  const float rise = length(b.position - a.position) * (0.02f + part);
  auto above = [&](const SurfacePlace& at) {
    return at.position + at.normal * (smallest + std::min(rise, 0.4f * at.headroom));
  };
  const Vec3 from = above(a), way = above(b) - from;
  const float distance = length(way);
  if (!(distance > 2 * smallest)) return true;
  return tracer.closest(from, way / distance, 0, distance).triangle == none;
}

struct SurfelSearch::Impl {
  const Surfels& surfels;
  const Tracer& tracer;
  uint32_t level;
  float diagonal;
  PointGrid leaves, gathering;
  float height = 0;            // over its surface, in which
  std::vector<float> clear{};  // so far around a surfel nothing stands in the way
  std::vector<float> headroom{};

  bool stands_for(SurfacePlace& at, const NearSurfel& n, bool over_edge = false) const {
    const Vec3 q = surfels.positions[n.index], m = surfels.normals[n.index];
    const bool in_gap = headroom[n.index] < surfels.spacings.back();
    if (!over_edge && !in_gap && n.distance < clear[n.index] && std::abs(dot(at.position - q, m)) <= height)
      return true;
    const float smallest = receiver_lift(at.position, 0, diagonal);
    if (at.headroom < 0) at.headroom = headroom_above(tracer, at.position, at.normal, smallest, diagonal);
    if (in_gap && is_outside(at.headroom, headroom[n.index], surfels.spacings.back())) return false;
    return is_open(tracer, at, {q, m, none, headroom[n.index]}, smallest, over_edge);
  }
  void find(const PointGrid& grid, const SurfacePlace& at, float reach, bool same_material, float least,
            std::vector<NearSurfel>& out) const {
    out.clear();
    grid.near(at.position, reach, [&](uint32_t i) {
      if (same_material && surfels.materials[i] != at.material) return;
      const float d = distance_between(at.position, at.normal, surfels.positions[i], surfels.normals[i], least);
      if (d < reach) out.push_back({d, i});
    });
  }
};

SurfelSearch::SurfelSearch(const Surfels& s, const Tracer& tracer, uint32_t kernel_level) {
  Bounds box;
  for (Vec3 p : s.positions) box.extend(p);
  impl_ = std::make_unique<Impl>(Impl{s, tracer, kernel_level, box.diagonal(), PointGrid(s.spacings.back(), s.count()),
                                      PointGrid(1.2f * s.spacings[kernel_level], s.counts[kernel_level])});
  for (Vec3 p : s.positions) impl_->leaves.insert(p);
  for (size_t i = 0; i < s.counts[kernel_level]; ++i) impl_->gathering.insert(s.positions[i]);
  // Sixteen ways around each surfel, just above its surface.
  impl_->clear.resize(s.count()), impl_->headroom.resize(s.count()), impl_->height = 0.02f * s.spacings.back();
  parallel_for(s.count(), 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const bool gathers = i < s.counts[kernel_level];
      const float spacing = gathers ? s.spacings[kernel_level] : s.spacings.back();
      const float reach = spacing * (gathers ? kernel_reach : 1.5f);
      const Mat3 frame = frame_about(s.normals[i]);
      const float smallest = receiver_lift(s.positions[i], 0, impl_->diagonal);
      impl_->headroom[i] = headroom_above(tracer, s.positions[i], s.normals[i], smallest, impl_->diagonal);
      const Vec3 from = s.positions[i] + s.normals[i] * (smallest + std::min(impl_->height, 0.4f * impl_->headroom[i]));
      float nearest = reach;
      for (int k = 0; k < 16; ++k) {
        const float turn = 2 * pi * (float(k) + 0.5f) / 16;
        const Hit hit = tracer.closest(from, frame[0] * std::cos(turn) + frame[1] * std::sin(turn), 0, nearest);
        if (hit.triangle != none) nearest = std::min(nearest, hit.distance);
      }
      impl_->clear[i] = nearest;
    }
  });
}
SurfelSearch::~SurfelSearch() = default;
float SurfelSearch::diagonal() const { return impl_->diagonal; }

uint32_t SurfelSearch::leaf(SurfacePlace at) const {
  thread_local std::vector<NearSurfel> found;
  const float spacing = impl_->surfels.spacings.back();
  const auto nearest = [&](float reach, bool same_material, float least) {
    impl_->find(impl_->leaves, at, reach * spacing, same_material, least, found);
    while (!found.empty()) {
      const auto next = std::min_element(found.begin(), found.end());
      if (impl_->stands_for(at, *next, least < alike_normals)) return next->index;
      *next = found.back(), found.pop_back();
    }
    return none;
  };
  uint32_t leaf = nearest(1, at.material != none, alike_normals);
  if (leaf == none) leaf = nearest(1.5f, false, alike_normals);
  if (leaf == none) leaf = nearest(4, false, alike_normals);
  return leaf != none ? leaf : nearest(1.5f, false, around_an_edge);
}

namespace {

// Weights of kernels about `at`, given bell-shaped ones: made to sum to 1 and to keep linear functions of the plane.
void keep_linear(const SurfacePlace& at, const Surfels& s, std::span<const float> bells, float scale, Kernels& k) {
  const Mat3 frame = frame_about(at.normal);
  double m[6] = {};  // of 1, x, y: 11 1x 1y xx xy yy
  std::array<Vec2, kernel_slots> place;
  for (size_t i = 0; i < k.count; ++i) {
    const Vec3 d = (s.positions[k.surfel[i]] - at.position) / scale;
    place[i] = {dot(d, frame[0]), dot(d, frame[1])};
    const double w = double(bells[i]), x = double(place[i].x), y = double(place[i].y);
    m[0] += w, m[1] += w * x, m[2] += w * y, m[3] += w * x * x, m[4] += w * x * y, m[5] += w * y * y;
  }
  for (size_t i = 0; i < k.count; ++i) k.weight[i] = float(double(bells[i]) / m[0]);
  // First row of the inverse, by cofactors.
  const double a = m[3] * m[5] - m[4] * m[4], b = m[2] * m[4] - m[1] * m[5], c = m[1] * m[4] - m[2] * m[3];
  const double determinant = m[0] * a + m[1] * b + m[2] * c;
  if (!(determinant > 1e-4 * m[0] * m[0] * m[0] * 0.01)) return;
  float share = 1;
  std::array<float, kernel_slots> linear;
  for (size_t i = 0; i < k.count; ++i) {
    linear[i] = float(double(bells[i]) * (a + b * double(place[i].x) + c * double(place[i].y)) / determinant);
    if (linear[i] < least_weight) share = std::min(share, (k.weight[i] - least_weight) / (k.weight[i] - linear[i]));
  }
  for (size_t i = 0; i < k.count; ++i) k.weight[i] += share * (linear[i] - k.weight[i]);
}

}  // namespace

Kernels SurfelSearch::kernels(SurfacePlace at) const {
  thread_local std::vector<NearSurfel> found;
  const Surfels& s = impl_->surfels;
  const float spacing = s.spacings[impl_->level];
  Kernels k;
  for (float widened : {1.0f, 2.0f, 4.0f}) {
    const float reach = widened * kernel_reach * spacing;
    impl_->find(impl_->gathering, at, reach, false, alike_normals, found);
    std::sort(found.begin(), found.end());
    // The nearest that can be seen; the next one after them says how far the bells reach.
    float edge = reach;
    std::array<float, kernel_slots> distance;
    for (const NearSurfel& n : found) {
      if (!impl_->stands_for(at, n)) continue;
      if (k.count == kernel_slots) {
        edge = n.distance;
        break;
      }
      distance[k.count] = n.distance, k.surfel[k.count++] = n.index;
    }
    if (k.count == 0) continue;
    std::array<float, kernel_slots> bells;
    float sum = 0;
    for (size_t i = 0; i < k.count; ++i) {
      const float t = distance[i] / std::max(edge, 1e-30f), bell = std::max(1 - t * t, 0.0f);
      const float facing =
          std::clamp((dot(at.normal, s.normals[k.surfel[i]]) - alike_normals) / (1 - alike_normals), 0.0f, 1.0f);
      sum += bells[i] = bell * bell * facing * facing;
    }
    if (sum > 1e-8f) {
      keep_linear(at, s, {bells.data(), k.count}, spacing, k);
      return k;
    }
    k.weight[0] = 1, k.count = 1;
    return k;
  }
  impl_->find(impl_->gathering, at, kernel_reach * spacing, false, around_an_edge, found);
  std::sort(found.begin(), found.end());
  for (const NearSurfel& n : found)
    if (impl_->stands_for(at, n, true)) {
      k.surfel[0] = n.index, k.weight[0] = 1, k.count = 1;
      break;
    }
  return k;
}

std::vector<SurfacePlace> places_of_leaf(const Scene& scene, const Tracer& tracer, const Surfels& surfels,
                                         const SurfelSearch& search, uint32_t leaf, size_t most) {
  // Tries on a disk that is wider than most cells; their surfaces are looked for from a little above.
  constexpr size_t tries_a_place = 3;
  const float reach = 0.8f * surfels.spacings.back();
  const Vec3 p = surfels.positions[leaf], n = surfels.normals[leaf];
  const Mat3 frame = frame_about(n);
  const float smallest = receiver_lift(p, 0, search.diagonal());
  const Hit above = tracer.closest(p + n * smallest, n, 0, reach);
  const Vec3 from = p + n * (0.5f * std::min(reach, above.triangle == none ? reach : above.distance));
  const float height = length(from - p);
  std::vector<SurfacePlace> found;
  for (uint32_t k = 0; k < tries_a_place * most && found.size() < most; ++k) {
    const Vec2 on_disk = square_to_disk(sobol_owen(k, uint32_t(hash64(0x1eaf, leaf))));
    const Vec3 aside = frame[0] * (on_disk.x * reach) + frame[1] * (on_disk.y * reach);
    const float distance = length(aside);
    if (distance > 0 && tracer.closest(from, aside / distance, 0, distance).triangle != none) continue;
    const Hit hit = tracer.closest(from + aside, -n, 0, 2 * height + reach);
    if (hit.triangle == none) continue;
    const SurfacePlace at = surface_place(scene, hit);
    if (search.leaf(at) == leaf) found.push_back(at);
  }
  if (found.empty()) found.push_back({p, n});
  return found;
}

}  // namespace lambent

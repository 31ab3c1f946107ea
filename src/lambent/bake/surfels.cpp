#include <lambent/bake/surfels.h>

#include <lambent/bake/directions.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lambent {
namespace {

// Candidates a leaf; surfels of the coarsest level, about; normals alike: cosine at least.
constexpr size_t candidates_a_leaf = 16, coarsest = 64;
constexpr float alike = 0.5f;
// A plane apart counts as so many times its distance.
constexpr float apart = 3;
// Kernels reach so many spacings, where fewer than kernel_slots surfels are nearer.
constexpr float kernel_reach = 2.3f;
constexpr float least_weight = -0.25f;

// Points in cells of a lattice of their own, found by hashes of the cells; grows.
class PointGrid {
 public:
  PointGrid(float cell, size_t expected) : cell_(double(cell)) {
    size_t size = 64;
    while (size < 2 * expected) size *= 2;
    heads_.assign(size, none);
  }
  void insert(Vec3 p) {
    const uint64_t key = key_of(place(p.x), place(p.y), place(p.z));
    uint32_t& head = heads_[key & (heads_.size() - 1)];
    next_.push_back(head), keys_.push_back(key), head = uint32_t(next_.size() - 1);
  }
  // Calls f with the points of all cells that come within `radius`.
  void near(Vec3 p, float radius, auto f) const {
    const double r = double(radius);
    const int64_t x1 = place(double(p.x) + r), y1 = place(double(p.y) + r), z1 = place(double(p.z) + r);
    for (int64_t z = place(double(p.z) - r); z <= z1; ++z)
      for (int64_t y = place(double(p.y) - r); y <= y1; ++y)
        for (int64_t x = place(double(p.x) - r); x <= x1; ++x) {
          const uint64_t key = key_of(x, y, z);
          for (uint32_t i = heads_[key & (heads_.size() - 1)]; i != none; i = next_[i])
            if (keys_[i] == key) f(i);
        }
  }

 private:
  int64_t place(double x) const { return int64_t(std::floor(std::clamp(x / cell_, -1e15, 1e15))); }
  static uint64_t key_of(int64_t x, int64_t y, int64_t z) {
    return hash64(hash64(uint64_t(x), uint64_t(y)), uint64_t(z));
  }
  double cell_;
  std::vector<uint32_t> heads_, next_;
  std::vector<uint64_t> keys_;
};

// How far two places are from standing for one another; infinite where their normals differ.
float distance_between(Vec3 p, Vec3 n, Vec3 q, Vec3 m) {
  if (dot(n, m) < alike) return INFINITY;
  const Vec3 d = q - p;
  const float off = dot(d, normalize_or(n + m, n));
  return std::sqrt(std::max(dot(d, d) + (apart * apart - 1) * off * off, 0.0f));
}

// How far above a place something else is; what is farther than `most` does not matter.
float headroom_above(const Tracer& tracer, Vec3 p, Vec3 n, float smallest, float most) {
  const Hit hit = tracer.closest(p + n * smallest, n, 0, most);
  return hit.triangle == none ? INFINITY : hit.distance;
}

// A surfel in a gap that is narrower than surfels are apart does not stand for a place outside, which is seen and lit
// otherwise.
bool is_outside(float place, float surfel, float gap) { return surfel < gap && place > 3 * surfel; }

// Whether a straight way leads from one to the other just above the surface; both know their headroom.
bool is_open(const Tracer& tracer, const SurfacePlace& a, const SurfacePlace& b, float smallest) {
  const float rise = length(b.position - a.position) * (0.02f + 0.15f * (1 - dot(a.normal, b.normal)));
  auto above = [&](const SurfacePlace& at) {
    return at.position + at.normal * (smallest + std::min(rise, 0.4f * at.headroom));
  };
  const Vec3 from = above(a), way = above(b) - from;
  const float distance = length(way);
  if (!(distance > 2 * smallest)) return true;
  return tracer.closest(from, way / distance, 0, distance).triangle == none;
}

// What stands for a place, nearest first.
struct Near {
  float distance;
  uint32_t index;
  bool operator<(const Near& o) const { return distance != o.distance ? distance < o.distance : index < o.index; }
};

struct Candidate {
  SurfacePlace at;
  Vec3 albedo;
};

// Uniform over the surfaces' sides, stratified by area and then shuffled.
struct SideAreas {
  std::vector<double> sums;                        // running
  std::vector<std::pair<uint32_t, bool>> side_of;  // triangle, front
};
SideAreas side_areas(const Scene& scene) {
  SideAreas a;
  double sum = 0;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const double area = double(area_length(area_normal(scene, scene.triangles[t]))) / 2;
    if (!(area > 0) || !std::isfinite(area)) continue;
    for (bool front : {true, false}) {
      if (!front && !scene.triangles[t].two_sided) continue;
      a.sums.push_back(sum += area), a.side_of.emplace_back(t, front);
    }
  }
  return a;
}

// Most rays meet backs of one-sided surfaces.
bool is_buried(const Scene& scene, const Tracer& tracer, const SurfacePlace& at, float smallest) {
  constexpr size_t rays = 8;
  const FixedFan fan(at.normal);
  size_t backs = 0;
  for (size_t k = 0; k < rays; ++k) {
    const Hit hit = tracer.closest(at.position + at.normal * smallest, fan[k * FixedFan::count / rays]);
    backs += hit.triangle != none && !hit.front && !scene.triangles[hit.triangle].two_sided;
  }
  return 2 * backs > rays;
}

std::vector<Candidate> make_candidates(const Scene& scene, const Tracer& tracer, const SideAreas& areas, size_t count,
                                       uint32_t seed, float diagonal) {
  std::vector<Candidate> all(count);
  std::vector<uint8_t> wanted(count, 0);
  const bool has_backs =
      std::any_of(scene.triangles.begin(), scene.triangles.end(), [](const Triangle& t) { return !t.two_sided; });
  parallel_for(count, 256, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Random random(seed, i);
      const double at = (double(i) + double(random.next())) / double(count) * areas.sums.back();
      const size_t k = std::min(size_t(std::upper_bound(areas.sums.begin(), areas.sums.end(), at) - areas.sums.begin()),
                                areas.sums.size() - 1);
      const auto [triangle, front] = areas.side_of[k];
      const Vec2 square = random.next2();
      const float root = std::sqrt(square.x);
      const Hit hit{triangle, root * (1 - square.y), root * square.y, front, 0};
      all[i] = {surface_place(scene, hit), albedo(scene, scene.triangles[triangle], hit.u, hit.v)};
      const Vec3 p = all[i].at.position;
      const float smallest = receiver_lift(p, 0, diagonal);
      wanted[i] = is_finite(p) && !(has_backs && is_buried(scene, tracer, all[i].at, smallest));
      all[i].at.headroom = headroom_above(tracer, p, all[i].at.normal, smallest, diagonal);
    }
  });
  std::vector<Candidate> out;
  for (size_t i = 0; i < count; ++i)
    if (wanted[i]) out.push_back(all[i]);
  Random random(seed, 0x5f1e);
  for (size_t i = out.size(); i > 1; --i) std::swap(out[i - 1], out[random.next64() % i]);
  return out;
}

// Irradiance changes over the harmonic mean distance of what is seen. Source: G. Ward, F. Rubinstein and R. Clear, "A
// ray tracing solution for diffuse interreflection", 1988.
size_t count_by_distance(const Tracer& tracer, const SideAreas& areas, const std::vector<Candidate>& some,
                         float diagonal) {
  constexpr size_t rays = 16, least = 16384, most = 65536;
  constexpr double part = 1.0 / 12;
  std::vector<double> inverse(some.size());
  parallel_for(some.size(), 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const SurfacePlace& at = some[i].at;
      const FixedFan fan(at.normal);
      const float smallest = receiver_lift(at.position, 0, diagonal);
      for (size_t k = 0; k < rays; ++k) {
        const Hit hit = tracer.closest(at.position + at.normal * smallest, fan[k * FixedFan::count / rays]);
        if (hit.triangle != none) inverse[i] += 1 / double(std::max(hit.distance, smallest)) / double(rays);
      }
    }
  });
  if (inverse.empty()) return least;
  const auto median = inverse.begin() + ptrdiff_t(inverse.size() / 2);
  std::nth_element(inverse.begin(), median, inverse.end());
  const double wanted = 0.7 * areas.sums.back() * (*median / part) * (*median / part);
  return size_t(std::clamp(wanted, double(least), double(most)));
}

// Dart throwing, level by level.
struct Throwing {
  const Scene& scene;
  const Tracer& tracer;
  const std::vector<Candidate>& candidates;
  float diagonal, gap;  // gap: the leaves' spacing
  Surfels out{};
  std::vector<uint32_t> of_candidate{};  // surfel of each, or none yet
  std::vector<SurfacePlace> places{};    // of surfels

  // The nearest surfel of `grid` that stands for a place, within `reach`; none.
  uint32_t nearest(const PointGrid& grid, const SurfacePlace& at, float reach, bool same_material,
                   std::vector<Near>& found) const {
    found.clear();
    grid.near(at.position, reach, [&](uint32_t i) {
      if (same_material && out.materials[i] != at.material) return;
      if (is_outside(at.headroom, places[i].headroom, gap)) return;
      const float d = distance_between(at.position, at.normal, out.positions[i], out.normals[i]);
      if (d < reach) found.push_back({d, i});
    });
    std::sort(found.begin(), found.end());
    for (const Near& n : found)
      if (is_open(tracer, at, places[n.index], receiver_lift(at.position, 0, diagonal))) return n.index;
    return none;
  }
  void add(size_t candidate, PointGrid& grid) {
    const SurfacePlace& at = candidates[candidate].at;
    of_candidate[candidate] = uint32_t(out.count());
    out.positions.push_back(at.position), out.normals.push_back(at.normal), out.materials.push_back(at.material);
    places.push_back(at), grid.insert(at.position);
  }
  void throw_level(float spacing, bool leaves, Progress* progress);
  void tend_leaves(const PointGrid& grid);
};

void Throwing::throw_level(float spacing, bool leaves, Progress* progress) {
  PointGrid grid(spacing, std::max<size_t>(out.count() * 4, 64));
  for (Vec3 p : out.positions) grid.insert(p);
  const size_t before = out.count(), level = out.levels();
  std::vector<Near> found;
  for (size_t c = 0; c < candidates.size() && !is_cancelled(progress); ++c)
    if (of_candidate[c] == none && nearest(grid, candidates[c].at, spacing, leaves, found) == none) add(c, grid);
  // Parents: those of the level above are their own; every other was refused there, so that one stands for it.
  if (level > 0) {
    PointGrid above(out.spacings.back(), before);
    for (size_t i = 0; i < before; ++i) above.insert(out.positions[i]);
    const size_t first = out.parents.size();
    out.parents.resize(first + out.count());
    parallel_for(out.count(), 256, [&](size_t begin, size_t end) {
      std::vector<Near> around;
      for (size_t i = begin; i < end; ++i)
        out.parents[first + i] = i < before ? uint32_t(i)
                                            : nearest(above, places[i], out.spacings.back(), false, around);
    });
  }
  out.counts.push_back(uint32_t(out.count())), out.spacings.push_back(spacing);
  if (leaves) tend_leaves(grid);
}

// What each leaf stands for: the share of candidates that it is nearest to.
void Throwing::tend_leaves(const PointGrid& grid) {
  std::vector<uint32_t> leaf(candidates.size());
  const float spacing = out.spacings.back();
  parallel_for(candidates.size(), 256, [&](size_t begin, size_t end) {
    std::vector<Near> around;
    for (size_t c = begin; c < end; ++c)
      leaf[c] = of_candidate[c] != none ? of_candidate[c] : nearest(grid, candidates[c].at, spacing, true, around);
  });
  out.areas.assign(out.count(), 0.0f), out.albedos.assign(out.count(), Vec3(0.0f));
  for (size_t c = 0; c < candidates.size(); ++c)
    if (leaf[c] != none) out.areas[leaf[c]] += 1, out.albedos[leaf[c]] += candidates[c].albedo;
  for (size_t i = 0; i < out.count(); ++i) out.albedos[i] /= out.areas[i];
}

// Those that a level adds, along a curve: neighbours in space are neighbours in memory, and in files.
void order_along_curve(Surfels& s) {
  const Bounds box = surfel_box(s);
  std::vector<uint32_t> old;  // of each surfel's new place
  for (size_t l = 0; l < s.levels(); ++l) {
    const uint32_t first = l > 0 ? s.counts[l - 1] : 0;
    const std::vector<Vec3> added(s.positions.begin() + first, s.positions.begin() + s.counts[l]);
    for (uint32_t i : curve_order(added, box)) old.push_back(first + i);
  }
  std::vector<uint32_t> place(old.size());
  for (uint32_t i = 0; i < old.size(); ++i) place[old[i]] = i;
  const auto reorder = [&](auto& values) {
    auto was = values;
    for (size_t i = 0; i < old.size(); ++i) values[i] = was[old[i]];
  };
  reorder(s.positions), reorder(s.normals), reorder(s.areas), reorder(s.albedos), reorder(s.materials);
  const std::vector<uint32_t> parents = s.parents;
  for (size_t l = 1; l < s.levels(); ++l)
    for (size_t i = 0; i < s.counts[l]; ++i)
      s.parents[s.first_parent(l) + i] = place[parents[s.first_parent(l) + old[i]]];
}

}  // namespace

SurfacePlace surface_place(const Scene& scene, const Hit& hit) {
  const Triangle& t = scene.triangles[hit.triangle];
  const Vec3 face = unit_normal(scene, t, Vec3(0, 1, 0));
  Vec3 n = normalize_or(interpolate(scene.normals, t, hit.u, hit.v), face);
  if (dot(n, face) < 0) n = -n;
  return {interpolate(scene.positions, t, hit.u, hit.v), hit.front ? n : -n, scene.parts[t.part].material};
}

Result<Surfels> make_surfels(const Scene& scene, const Tracer& tracer, const SurfelOptions& options,
                             Progress* progress) {
  const SideAreas areas = side_areas(scene);
  if (areas.sums.empty()) return Error{scene.path, "has no surface that light could bounce off"};
  const float diagonal = bounds(scene).diagonal();
  const size_t wanted = options.count > 0
                          ? options.count
                          : count_by_distance(tracer, areas,
                                              make_candidates(scene, tracer, areas, 2048, options.seed, diagonal),
                                              diagonal);
  const size_t count = std::clamp<size_t>(wanted, 16, max_surfels / 4);
  ProgressStage stage(progress, "placing surfels", 8);
  const std::vector<Candidate> candidates =
      make_candidates(scene, tracer, areas, candidates_a_leaf * count, options.seed, diagonal);
  if (candidates.empty()) return Error{scene.path, "has no surface that is not inside something"};
  stage.advance();
  // Darts that are thrown until none fits cover about 0.7 of the squares of their spacing.
  const double leaf_spacing = std::sqrt(0.7 * areas.sums.back() * double(candidates.size()) /
                                        double(candidates_a_leaf * count) / double(count));
  Throwing t{scene, tracer, candidates, diagonal, float(leaf_spacing)};
  t.of_candidate.assign(candidates.size(), none);
  int levels = 1;
  while (levels < int(max_surfel_levels) && count >> (2 * levels) >= coarsest) ++levels;
  for (int l = levels - 1; l >= 0; --l) {
    t.throw_level(float(std::ldexp(leaf_spacing, l)), l == 0, progress);
    stage.advance();
    if (stage.cancelled()) return Error{"", "cancelled"};
  }
  if (t.out.count() > max_surfels) return Error{scene.path, "takes too many surfels"};
  for (float& a : t.out.areas) a *= float(areas.sums.back() / double(candidates_a_leaf * count));
  order_along_curve(t.out);
  return std::move(t.out);
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

  bool stands_for(SurfacePlace& at, const Near& n) const {
    const Vec3 q = surfels.positions[n.index], m = surfels.normals[n.index];
    const bool in_gap = headroom[n.index] < surfels.spacings.back();
    if (!in_gap && n.distance < clear[n.index] && std::abs(dot(at.position - q, m)) <= height) return true;
    const float smallest = receiver_lift(at.position, 0, diagonal);
    if (at.headroom < 0) at.headroom = headroom_above(tracer, at.position, at.normal, smallest, diagonal);
    if (in_gap && is_outside(at.headroom, headroom[n.index], surfels.spacings.back())) return false;
    return is_open(tracer, at, {q, m, none, headroom[n.index]}, smallest);
  }
  void find(const PointGrid& grid, const SurfacePlace& at, float reach, bool same_material,
            std::vector<Near>& out) const {
    out.clear();
    grid.near(at.position, reach, [&](uint32_t i) {
      if (same_material && surfels.materials[i] != at.material) return;
      const float d = distance_between(at.position, at.normal, surfels.positions[i], surfels.normals[i]);
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
  thread_local std::vector<Near> found;
  const float spacing = impl_->surfels.spacings.back();
  // Of its own material; of any; farther away.
  for (const auto& [reach, same] :
       {std::pair(1.0f, at.material != none), std::pair(1.5f, false), std::pair(4.0f, false)}) {
    impl_->find(impl_->leaves, at, reach * spacing, same, found);
    while (!found.empty()) {
      const auto nearest = std::min_element(found.begin(), found.end());
      if (impl_->stands_for(at, *nearest)) return nearest->index;
      *nearest = found.back(), found.pop_back();
    }
  }
  return none;
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
  thread_local std::vector<Near> found;
  const Surfels& s = impl_->surfels;
  const float spacing = s.spacings[impl_->level];
  Kernels k;
  for (float widened : {1.0f, 2.0f, 4.0f}) {
    const float reach = widened * kernel_reach * spacing;
    impl_->find(impl_->gathering, at, reach, false, found);
    std::sort(found.begin(), found.end());
    // The nearest that can be seen; the next one after them says how far the bells reach.
    float edge = reach;
    std::array<float, kernel_slots> distance;
    for (const Near& n : found) {
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
      const float facing = std::clamp((dot(at.normal, s.normals[k.surfel[i]]) - alike) / (1 - alike), 0.0f, 1.0f);
      sum += bells[i] = bell * bell * facing * facing;
    }
    if (sum > 1e-8f) {
      keep_linear(at, s, {bells.data(), k.count}, spacing, k);
      return k;
    }
    k.weight[0] = 1, k.count = 1;
    return k;
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

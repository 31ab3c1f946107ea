#include <lambent/bake/surfels.h>

#include <lambent/bake/directions.h>
#include <lambent/bake/surfel_near.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace lambent {
namespace {

// Candidates a leaf; surfels of the coarsest level, about.
constexpr size_t candidates_a_leaf = 16, coarsest = 64;

struct Candidate {
  SurfacePlace at;
  Vec3 albedo;
  float share = 1;  // of a stratum of the area
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
bool lies_within(const Scene& scene, const Tracer& tracer, const SurfacePlace& at, float smallest) {
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
      wanted[i] = is_finite(p) && !(has_backs && lies_within(scene, tracer, all[i].at, smallest));
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
  std::vector<uint8_t> known{};          // of the first candidates: what level_of() said before
  std::vector<uint32_t> of_candidate{};  // surfel of each, or none yet
  std::vector<SurfacePlace> places{};    // of surfels

  // The nearest surfel of `grid` that stands for a place, within `reach`; none.
  uint32_t nearest(const PointGrid& grid, const SurfacePlace& at, float reach, bool same_material,
                   std::vector<NearSurfel>& found) const {
    found.clear();
    grid.near(at.position, reach, [&](uint32_t i) {
      if (same_material && out.materials[i] != at.material) return;
      if (is_outside(at.headroom, places[i].headroom, gap)) return;
      const float d = distance_between(at.position, at.normal, out.positions[i], out.normals[i]);
      if (d < reach) found.push_back({d, i});
    });
    std::sort(found.begin(), found.end());
    for (const NearSurfel& n : found)
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
  // The level that each candidate is a surfel from; 255: none.
  std::vector<uint8_t> level_of() const {
    std::vector<uint8_t> levels(candidates.size(), 255);
    for (size_t c = 0; c < candidates.size(); ++c)
      if (of_candidate[c] != none)
        levels[c] =
            uint8_t(std::upper_bound(out.counts.begin(), out.counts.end(), of_candidate[c]) - out.counts.begin());
    return levels;
  }
  void tend_leaves(const PointGrid& grid);
};

void Throwing::throw_level(float spacing, bool leaves, Progress* progress) {
  PointGrid grid(spacing, std::max<size_t>(out.count() * 4, 64));
  for (Vec3 p : out.positions) grid.insert(p);
  const size_t before = out.count(), level = out.levels();
  std::vector<NearSurfel> found;
  for (size_t c = 0; c < candidates.size() && !is_cancelled(progress); ++c)
    if (c < known.size() ? known[c] == level
                         : of_candidate[c] == none && nearest(grid, candidates[c].at, spacing, leaves, found) == none)
      add(c, grid);
  // Parents: those of the level above are their own; every other was refused there, so that one stands for it.
  if (level > 0) {
    PointGrid above(out.spacings.back(), before);
    for (size_t i = 0; i < before; ++i) above.insert(out.positions[i]);
    const size_t first = out.parents.size();
    out.parents.resize(first + out.count());
    parallel_for(out.count(), 256, [&](size_t begin, size_t end) {
      std::vector<NearSurfel> around;
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
    std::vector<NearSurfel> around;
    for (size_t c = begin; c < end; ++c)
      leaf[c] = of_candidate[c] != none ? of_candidate[c] : nearest(grid, candidates[c].at, spacing, true, around);
  });
  out.areas.assign(out.count(), 0.0f), out.albedos.assign(out.count(), Vec3(0.0f));
  for (size_t c = 0; c < candidates.size(); ++c)
    if (const float share = candidates[c].share; leaf[c] != none)
      out.areas[leaf[c]] += share, out.albedos[leaf[c]] += share * candidates[c].albedo;
  for (size_t i = 0; i < out.count(); ++i) out.albedos[i] /= out.areas[i];
}

// Levels from the coarsest to leaves that are `spacing` apart; `known`: of the first candidates, which are not tried
// again.
Throwing throw_levels(const Scene& scene, const Tracer& tracer, const std::vector<Candidate>& candidates,
                      float diagonal, float spacing, int levels, std::vector<uint8_t> known, ProgressStage& stage,
                      Progress* progress) {
  Throwing t{scene, tracer, candidates, diagonal, spacing, {}, std::move(known)};
  t.of_candidate.assign(candidates.size(), none);
  for (int l = levels - 1; l >= 0 && !stage.cancelled(); --l, stage.advance())
    t.throw_level(std::ldexp(spacing, l), l == 0, progress);
  return t;
}

// What rays from surfels meet that no leaf stands for: pieces too small for a candidate, and yet seen from near.
std::vector<Candidate> seen_without_leaf(const Throwing& t) {
  constexpr size_t rays = 16;
  const float spacing = t.out.spacings.back();
  PointGrid grid(spacing, t.out.count());
  for (Vec3 p : t.out.positions) grid.insert(p);
  std::vector<std::vector<Candidate>> found(t.out.count());
  parallel_for(t.out.count(), 64, [&](size_t begin, size_t end) {
    std::vector<NearSurfel> around;
    for (size_t i = begin; i < end; ++i) {
      const SurfacePlace& from = t.places[i];
      const FixedFan fan(from.normal);
      const Vec3 origin = from.position + from.normal * receiver_lift(from.position, spacing, t.diagonal);
      for (size_t k = 0; k < rays; ++k) {
        const Hit hit = t.tracer.closest(origin, fan[k * FixedFan::count / rays]);
        if (hit.triangle == none) continue;
        const Triangle& triangle = t.scene.triangles[hit.triangle];
        if (!hit.front && !triangle.two_sided) continue;
        SurfacePlace at = surface_place(t.scene, hit);
        const float smallest = receiver_lift(at.position, 0, t.diagonal);
        at.headroom = headroom_above(t.tracer, at.position, at.normal, smallest, t.diagonal);
        if (t.nearest(grid, at, spacing, true, around) == none && !lies_within(t.scene, t.tracer, at, smallest))
          found[i].push_back({at, albedo(t.scene, triangle, hit.u, hit.v), 1e-3f});
      }
    }
  });
  std::vector<Candidate> out;
  for (const auto& some : found) out.insert(out.end(), some.begin(), some.end());
  return out;
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
  ProgressStage stage(progress, "placing surfels", 16);
  std::vector<Candidate> candidates =
      make_candidates(scene, tracer, areas, candidates_a_leaf * count, options.seed, diagonal);
  if (candidates.empty()) return Error{scene.path, "has no surface that is not inside something"};
  stage.advance();
  // Darts that are thrown until none fits cover about 0.7 of the squares of their spacing.
  const double leaf_spacing = std::sqrt(0.7 * areas.sums.back() * double(candidates.size()) /
                                        double(candidates_a_leaf * count) / double(count));
  int levels = 1;
  while (levels < int(max_surfel_levels) && count >> (2 * levels) >= coarsest) ++levels;
  const auto thrown = [&](std::vector<uint8_t> known) {
    return throw_levels(scene, tracer, candidates, diagonal, float(leaf_spacing), levels, std::move(known), stage,
                        progress);
  };
  std::optional<Throwing> t(thrown({}));
  if (stage.cancelled()) return Error{"", "cancelled"};
  if (const std::vector<Candidate> seen = seen_without_leaf(*t); !seen.empty()) {
    std::vector<uint8_t> known = t->level_of();
    candidates.insert(candidates.end(), seen.begin(), seen.end());
    t.emplace(thrown(std::move(known)));
    if (stage.cancelled()) return Error{"", "cancelled"};
  }
  if (t->out.count() > max_surfels) return Error{scene.path, "takes too many surfels"};
  for (float& a : t->out.areas) a *= float(areas.sums.back() / double(candidates_a_leaf * count));
  order_along_curve(t->out);
  return std::move(t->out);
}

}  // namespace lambent

#include <lambent/bake/certify.h>
#include <lambent/core/aligned.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr size_t fewest_of_part = 16;
constexpr size_t piece = 4;

struct SurfacePlace {
  uint32_t triangle;
  float u, v;
  bool front;
};

bool receives(const Receivers& receivers, uint32_t triangle, bool front) {
  return std::visit([&](const auto& basis) { return basis.find(triangle, front) != nullptr; }, receivers.basis);
}

double area_of(const Scene& scene, const Triangle& t) {
  const Vec3d a(scene.positions[t.v[0]]), b(scene.positions[t.v[1]]), c(scene.positions[t.v[2]]);
  return 0.5 * length(cross(b - a, c - a));
}

// One place in each of `count` equal shares of the area, in the order of triangles.
std::vector<SurfacePlace> draw_places(const Scene& scene, const Receivers& receivers, size_t count, uint32_t seed) {
  double total = 0;
  auto each_side = [&](auto f) {
    for (uint32_t t = 0; t < scene.triangles.size(); ++t)
      for (const bool front : {true, false})
        if (receives(receivers, t, front)) f(t, front, area_of(scene, scene.triangles[t]));
  };
  each_side([&](uint32_t, bool, double area) { total += area; });
  std::vector<SurfacePlace> places;
  if (!(total > 0)) return places;
  Random random(seed, 0xce47);
  double passed = 0, next = total / double(count) * double(random.next());
  each_side([&](uint32_t t, bool front, double area) {
    for (passed += area; next < passed && places.size() < count;) {
      const Vec2 r = random.next2();
      const float root = std::sqrt(r.x);
      places.push_back({t, root * (1 - r.y), root * r.y, front});
      next = total / double(count) * (double(places.size()) + double(random.next()));
    }
  });
  return places;
}

struct PlaceError {
  double error2 = 0, truth2 = 0, noise2 = 0;
  bool counts = false;
  Vec3 at{0}, normal{0};
};

}  // namespace

Result<Certificate> certify(const Scene& scene, const Receivers& receivers, const FieldRow& field, size_t width,
                            const GatherAt& gather, size_t count, uint32_t seed, Progress* progress,
                            const FieldRow* again) {
  const std::vector<SurfacePlace> places = draw_places(scene, receivers, count, seed);
  const float diagonal = bounds(scene).diagonal();
  std::vector<PlaceError> measured(places.size());
  ProgressStage stage(progress, "measuring the error", places.size());
  parallel_for(places.size(), piece, [&](size_t begin, size_t end) {
    AlignedVector<float> a(width), b(width), s(width), s2(width), row(width);
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
      const SurfacePlace& at = places[i];
      const Triangle& t = scene.triangles[at.triangle];
      const Vec3 weight(1 - at.u - at.v, at.u, at.v);
      Vec3 p(0), n(0);
      for (int k = 0; k < 3; ++k) p += weight[k] * scene.positions[t.v[k]], n += weight[k] * scene.normals[t.v[k]];
      Vec3 face = normalize(
          cross(scene.positions[t.v[1]] - scene.positions[t.v[0]], scene.positions[t.v[2]] - scene.positions[t.v[0]]));
      n = normalize_or(n, face);
      if (dot(n, face) < 0) n = -n;
      if (!at.front) n = -n, face = -face;
      const Vec3 origin = p + face * receiver_lift(p, float(std::sqrt(area_of(scene, t))), diagonal);
      if (!gather(origin, n, hash64(seed, 2 * i), a.data()) || !gather(origin, n, hash64(seed, 2 * i + 1), b.data()))
        continue;
      auto look_up = [&](const FieldRow& of, AlignedVector<float>& sum) {
        std::fill(sum.begin(), sum.end(), 0.0f);
        std::visit(
            [&](const auto& basis) {
              basis.spread(*basis.find(at.triangle, at.front), at.u, at.v, [&](uint32_t receiver, float w) {
                of(receiver, row.data());
                for (size_t k = 0; k < width; ++k) sum[k] += w * row[k];
              });
            },
            receivers.basis);
      };
      look_up(field, s);
      if (again) look_up(*again, s2);
      const AlignedVector<float>& other = again ? s2 : s;
      PlaceError& m = measured[i];
      m.counts = true, m.at = origin, m.normal = n;
      for (size_t k = 0; k < width; ++k) {
        m.error2 += double(a[k] - s[k]) * double(b[k] - other[k]);
        m.truth2 += double(a[k]) * double(b[k]);
        m.noise2 += 0.5 * double(a[k] - b[k]) * double(a[k] - b[k]);
      }
    }
    if (!stage.cancelled()) stage.advance(end - begin);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};

  Certificate c;
  double error2 = 0, truth2 = 0, noise2 = 0;
  std::vector<PlaceError> parts(scene.parts.size());
  std::vector<size_t> counts(scene.parts.size(), 0);
  for (size_t i = 0; i < places.size(); ++i) {
    if (!measured[i].counts) continue;
    const uint32_t part = scene.triangles[places[i].triangle].part;
    ++c.places, ++counts[part];
    c.measured.push_back({measured[i].at, measured[i].normal, measured[i].error2, measured[i].truth2});
    error2 += measured[i].error2, truth2 += measured[i].truth2, noise2 += measured[i].noise2;
    parts[part].error2 += measured[i].error2, parts[part].truth2 += measured[i].truth2;
  }
  for (size_t p = 0; p < parts.size(); ++p)
    c.parts.push_back(counts[p] < fewest_of_part || !(parts[p].truth2 > 0)
                          ? -1
                          : std::sqrt(std::max(0.0, parts[p].error2) / parts[p].truth2));
  if (c.places < fewest_of_part || !(truth2 > 0)) return c;
  c.error = std::sqrt(std::max(0.0, error2) / truth2), c.noise = std::sqrt(noise2 / truth2);
  double spread = 0;
  for (const PlaceError& m : measured)
    if (m.counts) spread += (m.error2 - error2 / double(c.places)) * (m.error2 - error2 / double(c.places));
  c.uncertain = std::sqrt(spread) / truth2 / std::max(2 * c.error, 1e-12);
  return c;
}

}  // namespace lambent

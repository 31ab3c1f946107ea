#pragma once
// Triangles of an atlas against its texels, row by row, so that slivers cost what they cover. Texel (i, j) is centred
// at (i + 1/2, j + 1/2).
#include <lambent/core/vec.h>

#include <array>

namespace lambent {

// Calls f(i, j) for every texel of a width x height grid whose square of half side `reach` about the centre meets the
// triangle (for 0: whose centre lies in the span of the triangle's row, which is inside or on its border).
template <class F>
void each_texel(const std::array<Vec2, 3>& t, float reach, int width, int height, F f) {
  float low = INFINITY, high = -INFINITY;
  for (Vec2 p : t) low = std::min(low, p.y), high = std::max(high, p.y);
  // A centre at exactly `reach` from the triangle does not meet the open square.
  const int first = std::max(0, int(std::floor(low - reach - 0.5f))),
            last = std::min(height - 1, int(std::ceil(high + reach - 0.5f)));
  for (int j = first; j <= last; ++j) {
    // Extent in x of the triangle within the row's band.
    const float y0 = float(j) + 0.5f - reach, y1 = float(j) + 0.5f + reach;
    float left = INFINITY, right = -INFINITY;
    auto include = [&](float x) { left = std::min(left, x), right = std::max(right, x); };
    for (size_t k = 0; k < 3; ++k) {
      const Vec2 a = t[k], b = t[(k + 1) % 3];
      if (a.y >= y0 && a.y <= y1) include(a.x);
      for (float y : {y0, y1})
        if ((a.y < y) != (b.y < y)) include(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)));
    }
    if (!(left <= right)) continue;
    const int begin = std::max(0, int(std::ceil(left - reach - 0.5f))),
              end = std::min(width - 1, int(std::floor(right + reach - 0.5f)));
    for (int i = begin; i <= end; ++i) f(i, j);
  }
}

// Weights (1-u-v, u, v), as (u, v), of the point of the triangle that is closest to p in the plane; and its distance.
struct ClosestPoint {
  float u, v, distance;
};
inline ClosestPoint closest_point(const std::array<Vec2, 3>& t, Vec2 p) {
  const Vec2d a(t[0]), ab = Vec2d(t[1]) - a, ac = Vec2d(t[2]) - a, ap = Vec2d(p) - a;
  const double area = ab.x * ac.y - ab.y * ac.x;
  if (area != 0) {
    const double u = (ap.x * ac.y - ap.y * ac.x) / area, v = (ab.x * ap.y - ab.y * ap.x) / area;
    if (u >= 0 && v >= 0 && u + v <= 1) return {float(u), float(v), 0.0f};
  }
  ClosestPoint best{0, 0, INFINITY};
  auto along = [&](Vec2d from, Vec2d to, auto weights) {
    const Vec2d d = to - from, q = Vec2d(p) - from;
    const double length2 = dot(d, d), s = length2 > 0 ? std::clamp(dot(q, d) / length2, 0.0, 1.0) : 0.0;
    const float distance = float(length(q - s * d));
    if (distance < best.distance) best = weights(float(s)), best.distance = distance;
  };
  const Vec2d b = a + ab, c = a + ac;
  along(a, b, [](float s) { return ClosestPoint{s, 0, 0}; });
  along(a, c, [](float s) { return ClosestPoint{0, s, 0}; });
  along(b, c, [](float s) { return ClosestPoint{1 - s, s, 0}; });
  return best;
}

}  // namespace lambent

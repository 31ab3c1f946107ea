#include <lambent/transfer/shells.h>

#include <algorithm>
#include <cmath>

namespace lambent {

Vec3 unfold_octahedron(Vec2 p) {
  const float z = 1 - std::abs(p.x) - std::abs(p.y), over = std::max(-z, 0.0f);
  return normalize_or(Vec3(p.x - std::copysign(over, p.x), p.y - std::copysign(over, p.y), z), Vec3(0, 0, 1));
}

Vec2 fold_octahedron(Vec3 d) {
  const float sum = std::abs(d.x) + std::abs(d.y) + std::abs(d.z), scale = sum > 0 ? 1 / sum : 0.0f;
  const Vec2 p(d.x * scale, d.y * scale);
  if (d.z >= 0) return p;
  return {std::copysign(1 - std::abs(p.y), p.x), std::copysign(1 - std::abs(p.x), p.y)};
}

Vec3 shell_direction(const Shells& s, size_t point) {
  const size_t side = size_t(s.side), at = point % (side * side);
  const float step = 2 / float(side - 1);
  return unfold_octahedron({float(at % side) * step - 1, float(at / side) * step - 1});
}

Vec3 shell_point(const Shells& s, size_t point) {
  return s.center + s.radii[point / (size_t(s.side) * size_t(s.side))] * shell_direction(s, point);
}

bool is_consistent(const Shells& s) {
  if (s.side < 2 || s.side > max_shell_side || s.radii.empty() || s.radii.size() > size_t(max_shells)) return false;
  if (!is_finite(s.center) || !(s.radius > 0) || !std::isfinite(s.radius)) return false;
  float last = 0;
  for (float r : s.radii) {
    if (!(r > last) || !std::isfinite(r)) return false;
    last = r;
  }
  return true;
}

ShellMix mix_shells(const Shells& s, const std::vector<float>& log_radii, Vec3 from) {
  const float distance = length(from);
  const Vec2 place = distance > 0 ? fold_octahedron(from) : Vec2(0);
  const float scale = 0.5f * float(s.side - 1), last = float(s.side - 2);
  const float x = (place.x + 1) * scale, y = (place.y + 1) * scale;
  const float i = std::clamp(std::floor(x), 0.0f, last), j = std::clamp(std::floor(y), 0.0f, last);
  const float u = std::clamp(x - i, 0.0f, 1.0f), v = std::clamp(y - j, 0.0f, 1.0f);
  const size_t shells = s.radii.size();
  size_t above = 0;
  while (above < shells && s.radii[above] <= distance) ++above;
  const size_t low = above == 0 ? 0 : above - 1, high = std::min(above, shells - 1);
  const float t =
      low == high ? 0.0f
                  : std::clamp((std::log2(distance) - log_radii[low]) / (log_radii[high] - log_radii[low]), 0.0f, 1.0f);
  ShellMix mix;
  // Outside of the object what is interpolated is the value times the squared distance, which tends to a constant.
  const auto spread = [&](size_t shell) {
    const float ratio = low != high && s.radii[low] >= s.radius ? s.radii[shell] / distance : 1.0f;
    return ratio * ratio;
  };
  const float near = (1 - t) * spread(low), far = t * spread(high);
  const float past = s.radii.back() / std::max(distance, s.radii.back());
  mix.fade = past * past;
  const auto side = uint32_t(s.side), at = uint32_t(j) * side + uint32_t(i);
  const uint32_t corner[4] = {at, at + 1, at + side, at + side + 1};
  const float share[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  for (size_t k = 0; k < 4; ++k) {
    mix.points[k] = uint32_t(low) * side * side + corner[k], mix.weights[k] = share[k] * near;
    mix.points[k + 4] = uint32_t(high) * side * side + corner[k], mix.weights[k + 4] = share[k] * far;
  }
  return mix;
}

}  // namespace lambent

#pragma once
// A grid over directions of the upper hemisphere, as of view maps (outgoing.h): of which of its nodes a direction is
// made.
#include <lambent/core/sampling.h>

#include <algorithm>
#include <array>

namespace lambent {

struct ViewMix {
  std::array<size_t, 4> nodes;  // [y][x] of the grid
  std::array<float, 4> weights;
};
// Bilinear. wo: a unit direction, lifted to the horizon where it lies below; grid: nodes a side, at least 2.
inline ViewMix mix_views(int grid, Vec3 wo) {
  const float z = std::clamp(wo.z, 0.0f, 1.0f);
  const Vec2 flat(normalize_or(Vec3(wo.x, wo.y, 0), Vec3(0)));
  const Vec2 square = disk_to_square(flat * std::sqrt(1 - z));
  const float last = float(grid - 1), sx = square.x * last, sy = square.y * last;
  const int x = std::min(int(sx), grid - 2), y = std::min(int(sy), grid - 2);
  const float fx = sx - float(x), fy = sy - float(y);
  const size_t first = size_t(y * grid + x), below = first + size_t(grid);
  return {{first, first + 1, below, below + 1}, {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy}};
}

}  // namespace lambent

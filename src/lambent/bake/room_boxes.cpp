#include <lambent/bake/room_boxes.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

constexpr int cells_along = 96;
constexpr double most_open = 1.0 / 3, most_open_of_large = 0.9;
constexpr double large_share = 1.0 / 8;   // of all that is solid: a box that is cut though nothing closes it
constexpr int least_cells = 4;            // of a room, along any axis that is cut
constexpr double least_share = 1.0 / 40;  // of what is solid in a box, in each part
constexpr float most_overlap = 1.0f / 8;  // of boxes that are asked for

// Which cells of a grid over the scene something is in.
struct Grid {
  Bounds box;
  float cell = 1;
  int n[3] = {1, 1, 1};
  std::vector<uint8_t> solid;

  explicit Grid(const Scene& scene) : box(room_bounds(scene)) {
    const Vec3 extent = box.max - box.min;
    cell = std::max({extent.x, extent.y, extent.z}) / float(cells_along);
    for (int a = 0; a < 3; ++a) n[a] = std::clamp(int(std::ceil(extent[a] / cell)), 1, cells_along);
    solid.assign(size_t(n[0]) * size_t(n[1]) * size_t(n[2]), 0);
    for (const Triangle& t : scene.triangles)
      mark(scene.positions[t.v[0]], scene.positions[t.v[1]], scene.positions[t.v[2]]);
  }
  int at(float x, int axis) const { return std::clamp(int((x - box.min[axis]) / cell), 0, n[axis] - 1); }
  uint8_t& of(int x, int y, int z) { return solid[(size_t(z) * size_t(n[1]) + size_t(y)) * size_t(n[0]) + size_t(x)]; }
  // Points half a cell apart.
  void mark(Vec3 a, Vec3 b, Vec3 c) {
    const float longest = std::max({length(b - a), length(c - a), length(c - b)});
    const int steps = std::max(1, int(std::ceil(2 * longest / cell)));
    for (int i = 0; i <= steps; ++i)
      for (int j = 0; i + j <= steps; ++j) {
        const float u = float(i) / float(steps), v = float(j) / float(steps);
        const Vec3 p = (1 - u - v) * a + u * b + v * c;
        of(at(p.x, 0), at(p.y, 1), at(p.z, 2)) = 1;
      }
  }
};

// Cells [low, high).
struct CellBox {
  int low[3], high[3];
};

struct Cut {
  int axis = -1, at = 0;
  double open = 1;
  size_t solid = 0;  // cells of the whole box
};

// The plane through the middle of a layer of cells with the least that is open.
Cut best_cut(Grid& grid, const CellBox& b) {
  Cut best;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3, layers = b.high[axis] - b.low[axis];
    std::vector<size_t> solid(size_t(layers), 0);
    int cell[3];
    for (cell[axis] = b.low[axis]; cell[axis] < b.high[axis]; ++cell[axis])
      for (cell[u] = b.low[u]; cell[u] < b.high[u]; ++cell[u])
        for (cell[v] = b.low[v]; cell[v] < b.high[v]; ++cell[v])
          solid[size_t(cell[axis] - b.low[axis])] += grid.of(cell[0], cell[1], cell[2]);
    const size_t layer = size_t(b.high[u] - b.low[u]) * size_t(b.high[v] - b.low[v]);
    size_t all = 0, before = 0;
    for (size_t s : solid) all += s;
    best.solid = all;
    for (int i = 0; i < layers; ++i) {
      const double open = 1 - double(solid[size_t(i)]) / double(layer);
      const size_t after = all - before - solid[size_t(i)];
      const bool parts = i >= least_cells && layers - 1 - i >= least_cells &&
                         double(std::min(before, after)) >= least_share * double(all);
      if (parts && open < best.open - 1e-9) best = {axis, b.low[axis] + i, open, all};
      before += solid[size_t(i)];
    }
  }
  return best;
}

}  // namespace

Bounds room_bounds(const Scene& scene) {
  Bounds box;
  for (const Triangle& t : scene.triangles)
    for (uint32_t v : t.v) box.extend(scene.positions[v]);
  const Vec3 around(0.01f * box.diagonal());
  return {box.min - around, box.max + around};
}

std::vector<Room> find_rooms(const Scene& scene, size_t most) {
  Grid grid(scene);
  struct Part {
    CellBox cells;
    Bounds box;
    Cut cut;
  };
  std::vector<Part> parts{{{{0, 0, 0}, {grid.n[0], grid.n[1], grid.n[2]}}, grid.box, {}}};
  parts[0].cut = best_cut(grid, parts[0].cells);
  const size_t solid = parts[0].cut.solid;
  while (parts.size() < most) {
    // The most closed cut of all, but large boxes are cut in any case.
    const auto rank = [&](const Part& part) {
      const bool large = double(part.cut.solid) > large_share * double(solid);
      return part.cut.axis < 0 || part.cut.open > (large ? most_open_of_large : most_open) ? 2.0 : part.cut.open;
    };
    const auto next =
        std::min_element(parts.begin(), parts.end(), [&](const Part& a, const Part& b) { return rank(a) < rank(b); });
    if (rank(*next) > 1) break;
    const Cut cut = next->cut;
    Part other = *next;
    const float plane = grid.box.min[cut.axis] + (float(cut.at) + 0.5f) * grid.cell;
    next->cells.high[cut.axis] = cut.at, next->box.max[cut.axis] = plane;
    other.cells.low[cut.axis] = cut.at + 1, other.box.min[cut.axis] = plane;
    next->cut = best_cut(grid, next->cells), other.cut = best_cut(grid, other.cells);
    parts.push_back(other);
  }
  std::vector<Room> rooms;
  for (size_t i = 0; i < parts.size(); ++i) rooms.push_back({"room " + std::to_string(i + 1), parts[i].box});
  return rooms;
}

namespace {

// Parts asked[first, last) of the box; grows `out`.
Result<void> part(const Bounds& box, std::vector<Room> asked, std::vector<Room>& out) {
  if (asked.size() == 1) {
    out.push_back({asked[0].name, box});
    return {};
  }
  // The plane with the widest gap, or the least overlap for its boxes' extent.
  int axis = -1;
  size_t split = 0;
  float plane = 0, best = -most_overlap;
  for (int a = 0; a < 3; ++a) {
    std::sort(asked.begin(), asked.end(), [a](const Room& l, const Room& r) { return l.box.min[a] < r.box.min[a]; });
    float reach = asked[0].box.max[a];
    for (size_t i = 1; i < asked.size(); ++i) {
      float least = INFINITY, extent = INFINITY;
      for (size_t j = 0; j < asked.size(); ++j) {
        if (j >= i) least = std::min(least, asked[j].box.min[a]);
        extent = std::min(extent, asked[j].box.max[a] - asked[j].box.min[a]);
      }
      const float gap = (least - reach) / std::max(extent, 1e-30f);
      if (gap > best) best = gap, axis = a, split = i, plane = 0.5f * (least + reach);
      reach = std::max(reach, asked[i].box.max[a]);
    }
  }
  if (axis < 0)
    return Error{"--rooms", "no plane parts \"" + asked[0].name + "\" from \"" + asked[1].name + "\": they overlap"};
  std::sort(asked.begin(), asked.end(),
            [axis](const Room& l, const Room& r) { return l.box.min[axis] < r.box.min[axis]; });
  Bounds low = box, high = box;
  plane = std::clamp(plane, box.min[axis], box.max[axis]);
  low.max[axis] = high.min[axis] = plane;
  const auto middle = asked.begin() + ptrdiff_t(split);
  if (auto ok = part(low, {asked.begin(), middle}, out); !ok) return ok;
  return part(high, {middle, asked.end()}, out);
}

}  // namespace

Result<std::vector<Room>> part_rooms(const Bounds& whole, const std::vector<Room>& asked) {
  std::vector<Room> out;
  if (auto ok = part(whole, asked, out); !ok) return ok.error();
  return out;
}

}  // namespace lambent

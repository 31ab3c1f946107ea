// Conservative by these margins: boxes are seen a thousandth of a tile larger than they are, and what lies behind a
// triangle's plane counts as behind it from 1e-3 of a direction on, where the rounding of rays is 1e-6.
#include <lambent/basis/cubemap.h>
#include <lambent/bake/open_sky.h>

#include <algorithm>
#include <numeric>

namespace lambent {
namespace {

constexpr uint32_t leaf_triangles = 4;
constexpr float tile_margin = 1e-3f, plane_margin = 1e-3f;
constexpr int few_tiles = 16;   // are closed by a box as it is, whatever is in it
constexpr int many_tiles = 16;  // are not closed by a triangle's box where its plane closes fewer

// Tiles of a face that a box may be seen through: columns and rows, first to last.
struct Footprint {
  int first[2] = {0, 0}, last[2] = {-1, -1};
  bool empty() const { return last[1] < first[1]; }
  int tiles() const { return empty() ? 0 : (last[0] - first[0] + 1) * (last[1] - first[1] + 1); }
  uint16_t columns() const { return uint16_t((2u << last[0]) - (1u << first[0])); }
};

struct Range {
  float lo, hi;
  Range operator-() const { return {-hi, -lo}; }
};

// Of a box, relative to the eye, on a face: `along` points out through the face.
Footprint footprint(Range along, Range u, Range v, int tiles) {
  Footprint out;
  if (!(along.hi > 0)) return out;
  const float half = 0.5f * float(tiles), near = half / std::max(along.lo, 1e-20f), far = half / along.hi;
  const Range sides[2] = {u, v};
  Footprint found;
  for (int k = 0; k < 2; ++k) {
    const float a = half - tile_margin + sides[k].lo * (sides[k].lo > 0 ? far : near),
                b = half + tile_margin + sides[k].hi * (sides[k].hi > 0 ? near : far);
    if (a >= float(tiles) || b <= 0) return out;
    found.first[k] = a > 0 ? int(a) : 0, found.last[k] = b < float(tiles) ? int(b) : tiles - 1;
  }
  return found;
}

// What is seen of a box on the faces where tiles are open, as cube_point() has them.
struct Seen {
  std::array<Footprint, 6> at;
  int tiles = 0;
  bool any = false;  // open tile

  Seen(Vec3 lo, Vec3 hi, Vec3 origin, const TileMask& open, int tiles_a_side) {
    const Vec3 hair = 1e-6f * (abs(origin) + max(abs(lo), abs(hi)));  // rounding of the differences
    lo = lo - origin - hair, hi = hi - origin + hair;
    const Range x{lo.x, hi.x}, y{lo.y, hi.y}, z{lo.z, hi.z};
    if (x.hi > 0) add(0, footprint(x, -z, -y, tiles_a_side), open);
    if (x.lo < 0) add(1, footprint(-x, z, -y, tiles_a_side), open);
    if (y.hi > 0) add(2, footprint(y, x, z, tiles_a_side), open);
    if (y.lo < 0) add(3, footprint(-y, x, -z, tiles_a_side), open);
    if (z.hi > 0) add(4, footprint(z, x, -y, tiles_a_side), open);
    if (z.lo < 0) add(5, footprint(-z, -x, -y, tiles_a_side), open);
  }
  void add(size_t face, const Footprint& f, const TileMask& open) {
    if (f.empty()) return;
    bool touched = false;
    for (int r = f.first[1]; r <= f.last[1] && !touched; ++r) touched = (open[face][size_t(r)] & f.columns()) != 0;
    if (touched) at[face] = f, tiles += f.tiles(), any = true;
  }
  void take_out(TileMask& open) const {
    for (size_t f = 0; f < 6; ++f)
      for (int r = at[f].first[1]; r <= at[f].last[1]; ++r) open[f][size_t(r)] &= uint16_t(~at[f].columns());
  }
};

// Whether all of a box lies below a plane.
bool is_below(Vec3 lo, Vec3 hi, Vec3 origin, Vec3 n) {
  const Vec3 highest(n.x > 0 ? hi.x : lo.x, n.y > 0 ? hi.y : lo.y, n.z > 0 ? hi.z : lo.z);
  return dot(n, highest - origin) < 0;
}

}  // namespace

OpenSky::OpenSky(const Scene& scene, int tiles_a_side) : tiles_(tiles_a_side) {
  const size_t n = scene.triangles.size();
  std::vector<Vec3> centres(n);
  std::vector<uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  facets_.resize(n);
  for (size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) facets_[i].v[k] = scene.positions[scene.triangles[i].v[k]];
    centres[i] = facets_[i].v[0] + facets_[i].v[1] + facets_[i].v[2];
  }
  if (n > 0) nodes_.resize(1), build(order, centres, 0, uint32_t(n), 0);
  std::vector<Facet> sorted(n);
  for (size_t i = 0; i < n; ++i) sorted[i] = facets_[order[i]];
  facets_.swap(sorted);
  for (int f = 0; f < 6; ++f)
    for (int r = 0; r <= tiles_; ++r)
      for (int c = 0; c <= tiles_; ++c) {
        const Vec3 d = normalize(cube_point(f, float(2 * c) / float(tiles_) - 1, float(2 * r) / float(tiles_) - 1));
        x_.push_back(d.x), y_.push_back(d.y), z_.push_back(d.z);
      }
}

uint32_t OpenSky::build(std::vector<uint32_t>& order, const std::vector<Vec3>& centres, uint32_t begin, uint32_t end,
                        uint32_t at) {
  Vec3 lo(INFINITY), hi(-INFINITY), low = lo, high = hi;
  for (uint32_t i = begin; i < end; ++i) {
    for (const Vec3& p : facets_[order[i]].v) lo = min(lo, p), hi = max(hi, p);
    low = min(low, centres[order[i]]), high = max(high, centres[order[i]]);
  }
  nodes_[at] = {lo, hi, begin, end - begin};
  if (end - begin <= leaf_triangles) return at;
  const Vec3 extent = high - low;
  const size_t axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end,
                   [&](uint32_t a, uint32_t b) { return centres[a][axis] < centres[b][axis]; });
  const auto child = uint32_t(nodes_.size());
  nodes_.resize(nodes_.size() + 2);
  nodes_[at].first = child, nodes_[at].count = 0;
  build(order, centres, begin, middle, child), build(order, centres, middle, end, child + 1);
  return at;
}

TileMask OpenSky::above(Vec3 n) const {
  TileMask out{};
  const size_t side = size_t(tiles_) + 1;
  std::array<float, (most_tiles + 1) * (most_tiles + 1)> height;
  for (size_t f = 0; f < 6; ++f) {
    const size_t at = f * side * side;
    for (size_t i = 0; i < side * side; ++i) height[i] = n.x * x_[at + i] + n.y * y_[at + i] + n.z * z_[at + i];
    for (size_t r = 0; r + 1 < side; ++r)
      for (size_t c = 0; c + 1 < side; ++c) {
        const float* h = &height[r * side + c];
        if (std::max({h[0], h[1], h[side], h[side + 1]}) > -plane_margin) out[f][r] |= uint16_t(1u << c);
      }
  }
  return out;
}

// Where its box is seen large, a triangle is what lies behind its plane: one next to the origin, say.
void OpenSky::close_triangle(const Facet& t, Vec3 origin, Vec3 up, TileMask& open) const {
  const Vec3 lo = min(t.v[0], min(t.v[1], t.v[2])), hi = max(t.v[0], max(t.v[1], t.v[2]));
  if (std::max({dot(up, t.v[0] - origin), dot(up, t.v[1] - origin), dot(up, t.v[2] - origin)}) < 0) return;
  const Seen seen(lo, hi, origin, open, tiles_);
  if (!seen.any) return;
  if (seen.tiles <= many_tiles) return seen.take_out(open);
  Vec3 n = normalize_or(cross(t.v[1] - t.v[0], t.v[2] - t.v[0]), Vec3(0));
  const float height = dot(n, origin - t.v[0]);
  if (height < 0) n = -n;
  const Vec3 magnitude = abs(origin) + abs(t.v[0]);
  // In its plane, or of no area: no side to tell.
  if (!(std::abs(height) > 1e-6f * (magnitude.x + magnitude.y + magnitude.z))) return seen.take_out(open);
  const size_t side = size_t(tiles_) + 1;
  for (size_t f = 0; f < 6; ++f)
    for (int r = seen.at[f].first[1]; r <= seen.at[f].last[1]; ++r) {
      const uint16_t may = uint16_t(open[f][size_t(r)] & seen.at[f].columns());
      if (!may) continue;
      const size_t at = (f * side + size_t(r)) * side;
      float least[most_tiles + 1];
      for (size_t c = 0; c < side; ++c) {
        const size_t i = at + c, j = i + side;
        least[c] = std::min(n.x * x_[i] + n.y * y_[i] + n.z * z_[i], n.x * x_[j] + n.y * y_[j] + n.z * z_[j]);
      }
      uint16_t behind = 0;
      for (size_t c = 0; c + 1 < side; ++c)
        behind |= uint16_t(uint32_t(std::min(least[c], least[c + 1]) < plane_margin) << c);
      open[f][size_t(r)] &= uint16_t(~(may & behind));
    }
}

void OpenSky::close(Vec3 origin, Vec3 n, TileMask& open) const {
  uint32_t stack[64];  // the tree is halved at each level
  size_t depth = 0;
  if (!nodes_.empty()) stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    if (is_below(node.lo, node.hi, origin, n)) continue;
    const Seen seen(node.lo, node.hi, origin, open, tiles_);
    if (!seen.any) continue;
    if (seen.tiles <= few_tiles) {
      seen.take_out(open);
    } else if (node.count > 0) {
      for (uint32_t i = 0; i < node.count; ++i) close_triangle(facets_[node.first + i], origin, n, open);
    } else {
      // The nearer one first: it closes more.
      const Node &a = nodes_[node.first], &b = nodes_[node.first + 1];
      const Vec3 da = a.lo + a.hi - 2 * origin, db = b.lo + b.hi - 2 * origin;
      const bool second = dot(db, db) < dot(da, da);
      stack[depth++] = node.first + (second ? 0 : 1), stack[depth++] = node.first + (second ? 1 : 0);
    }
  }
}

}  // namespace lambent

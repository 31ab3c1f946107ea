#pragma once
// WHERE light is received, and how values between receivers interpolate: the spatial basis.
//   vertices   hats: piecewise linear. A receiver is one side of one welded vertex: vertices that share position and
//   normal
//              share it, so that UV seams and part borders cost nothing.
//   texels     of a lightmap over an atlas (atlas.h): bilinear.
//   patches    boxes: one side of one triangle, constant over it.
//   points     kernels about points of surfaces that know nothing of the mesh (bake/meshless.h), looked up at vertices.
// Source: radiosity, "Piecewise Linear Basis Functions", "Texture Maps", "Unweighted Basis Functions".
#include <lambent/scene/scene.h>

#include <array>
#include <variant>
#include <vector>

namespace lambent {

// How a function on surfaces becomes numbers at receivers: its value where each is, or the coefficients that come
// nearest to it over all surfaces (receivers/project.h).
enum class Projection { collocation, least_squares };

// The receivers at the corners of every triangle, and its part, together, since both are wanted at every hit.
struct Corners {
  std::array<uint32_t, 3> receiver{none, none, none};
  uint32_t part = 0;
};
// Hats.
struct CornerReceivers {
  std::vector<Corners> front, back;  // by triangle; `back` is empty where the whole scene is one-sided
  // Corners as seen from a side, or null where that side receives nothing.
  const Corners* find(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (side.empty() || side[triangle].receiver[0] == none) return nullptr;
    return &side[triangle];
  }
  // Asks the caches for what find() will want.
  void prefetch(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (triangle < side.size()) __builtin_prefetch(&side[triangle]);
  }
  // Calls add(receiver, weight) for all receivers whose basis functions do not vanish at weights (1-u-v, u, v) of the
  // corners; their weights there sum to 1.
  template <class Add>
  void spread(const Corners& at, float u, float v, Add add) const {
    add(at.receiver[0], 1 - u - v), add(at.receiver[1], u), add(at.receiver[2], v);
  }
};

// Bilinear texels.
struct TexelTriangle {
  Vec2 at[3];            // the corners' places in the atlas, in texels
  uint32_t part = none;  // none: that side has no place in the atlas
};
struct TexelReceivers {
  int width = 0, height = 0;               // of the atlas
  std::vector<uint32_t> texels;            // receiver of each texel, row by row; none where no triangle comes near
  std::vector<TexelTriangle> front, back;  // by triangle, as in CornerReceivers
  const TexelTriangle* find(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (side.empty() || side[triangle].part == none) return nullptr;
    return &side[triangle];
  }
  void prefetch(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (triangle < side.size()) __builtin_prefetch(&side[triangle]);
  }
  template <class Add>
  void spread(const TexelTriangle& at, float u, float v, Add add) const {
    spread_at((1 - u - v) * at.at[0] + u * at.at[1] + v * at.at[2], add);
  }
  // The same for a place in the atlas; texel (i, j) is centred at (i + 1/2, j + 1/2).
  template <class Add>
  void spread_at(Vec2 place, Add add) const {
    const float x = std::clamp(place.x - 0.5f, 0.0f, float(width - 1)),
                y = std::clamp(place.y - 0.5f, 0.0f, float(height - 1));
    const int i = std::min(int(x), std::max(width - 2, 0)), j = std::min(int(y), std::max(height - 2, 0));
    const float s = x - float(i), t = y - float(j);
    const int right = width > 1, down = height > 1;
    const uint32_t* row = texels.data() + size_t(j) * size_t(width) + size_t(i);
    const uint32_t receiver[4] = {row[0], row[right], row[down * width], row[down * width + right]};
    const float weight[4] = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
    float total = 0;
    for (int k = 0; k < 4; ++k) total += receiver[k] == none ? 0.0f : weight[k];
    if (!(total > 0)) return;
    // Every texel whose tent reaches the surface is a receiver, so the total is 1 but for rounding at its very border.
    for (int k = 0; k < 4; ++k)
      if (receiver[k] != none && weight[k] > 0) add(receiver[k], weight[k] / total);
  }
};

// Boxes.
struct Patch {
  uint32_t receiver = none, part = 0;
};
struct PatchReceivers {
  std::vector<Patch> front, back;  // by triangle, as in CornerReceivers
  const Patch* find(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (side.empty() || side[triangle].receiver == none) return nullptr;
    return &side[triangle];
  }
  void prefetch(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (triangle < side.size()) __builtin_prefetch(&side[triangle]);
  }
  template <class Add>
  void spread(const Patch& at, float, float, Add add) const {
    add(at.receiver, 1.0f);
  }
};

// Kernels about points: what they sum to at each side of each welded vertex, and hats between.
struct PointReceivers {
  CornerReceivers corners;  // of vertices' own receivers
  // Of receiver v of a vertex, [first[v], first[v + 1]): points, and their weights, which sum to 1.
  std::vector<uint32_t> first{0}, points;
  std::vector<float> weights;
  const Corners* find(uint32_t triangle, bool front_side) const { return corners.find(triangle, front_side); }
  void prefetch(uint32_t triangle, bool front_side) const { corners.prefetch(triangle, front_side); }
  template <class Add>
  void spread(const Corners& at, float u, float v, Add add) const {
    corners.spread(at, u, v, [&](uint32_t vertex, float hat) {
      for (size_t k = first[vertex]; k < first[vertex + 1]; ++k) add(points[k], hat * weights[k]);
    });
  }
};

// How values at receivers make a function on surfaces.
using SpatialBasis = std::variant<CornerReceivers, TexelReceivers, PatchReceivers, PointReceivers>;

// The point of a triangle's side that a texel stands for.
struct TexelPlace {
  uint32_t triangle;
  float u, v;
};

// Where light is received, and how values between the places interpolate.
struct Receivers {
  // Where rays start: the place moved off its surface by a hair, and, where its faces do not surround it (borders,
  // creases), a hair towards them, so that a wall's foot does not lie in the wall.
  std::vector<Vec3> origins;
  std::vector<Vec3> normals;  // unit, towards the side that the receiver is on
  // Of vertices alone: receiver of each scene vertex, by side; `none` for vertices that no proper triangle uses, and on
  // the back of one-sided surfaces. `back` is empty where the whole scene is one-sided.
  std::vector<uint32_t> front, back;
  std::vector<TexelPlace> places;  // of texels alone, one a receiver
  SpatialBasis basis;

  size_t count() const { return origins.size(); }
};

// All of these lie along a space-filling curve, so that neighbours in memory are neighbours in space.
Receivers make_vertex_receivers(const Scene& scene);
// Gathered at the middle of each triangle.
Receivers make_patch_receivers(const Scene& scene);

// From the receiver of each vertex, by side (`back` may be empty).
CornerReceivers corner_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                 const std::vector<uint32_t>& back);

// From the places of vertices in an atlas, by side (`back` may be empty), and the receiver of each of its texels.
TexelReceivers texel_receivers(const Scene& scene, int width, int height, const std::vector<Vec2>& front,
                               const std::vector<Vec2>& back, std::vector<uint32_t> texels);

// Pairs (r, neighbour) for every marked receiver r, sorted, without repetition: receivers that share a triangle (hats),
// touch in the atlas (texels), share an edge (boxes) or a vertex (points).
std::vector<std::pair<uint32_t, uint32_t>> neighbours_of(const Scene& scene, const SpatialBasis& basis,
                                                         const std::vector<uint8_t>& marked);

// The order of points along a Morton curve through `box`: indices, ties by index.
std::vector<uint32_t> curve_order(const std::vector<Vec3>& points, const Bounds& box);

// How far a receiver at p starts above its surface, given the size of what it stands for (an edge, a texel) and of the
// scene.
float receiver_lift(Vec3 p, float size, float diagonal);

}  // namespace lambent

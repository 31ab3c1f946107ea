#pragma once
// Directions from a place in which a scene certainly has nothing: rays that need not be traced. By boxes around its
// triangles, seen from there as rectangles on the faces of a cube.
#include <lambent/scene/scene.h>

#include <array>
#include <vector>

namespace lambent {

// Tiles of a cube, at most 16 x 16 a face: a bit each, [face][row].
inline constexpr int most_tiles = 16;
using TileMask = std::array<std::array<uint16_t, most_tiles>, 6>;

// A tree of boxes around a scene's triangles. Does not change once it is built; any number of threads may ask.
class OpenSky {
 public:
  OpenSky(const Scene& scene, int tiles_a_side);

  // Tiles of which some direction lies above the horizon of n.
  TileMask above(Vec3 n) const;
  // Takes tiles out of `open` through which something above the horizon of n may be seen from the origin. What is left
  // is certain: no ray there meets a triangle, nor comes so near to one that rounding could tell otherwise.
  void close(Vec3 origin, Vec3 n, TileMask& open) const;

 private:
  struct Node {
    Vec3 lo, hi;
    uint32_t first = 0;  // child, the other behind it; of a leaf its first triangle
    uint32_t count = 0;  // of a leaf's triangles; 0: no leaf
  };
  struct Facet {
    Vec3 v[3];
  };
  uint32_t build(std::vector<uint32_t>& order, const std::vector<Vec3>& centres, uint32_t begin, uint32_t end,
                 uint32_t at);
  void close_triangle(const Facet& t, Vec3 origin, Vec3 n, TileMask& open) const;

  int tiles_;
  std::vector<Node> nodes_;
  std::vector<Facet> facets_;
  std::vector<float> x_, y_, z_;  // corners of tiles, [face][row][column], unit
};

}  // namespace lambent

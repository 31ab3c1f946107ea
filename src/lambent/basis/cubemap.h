#pragma once
// The sphere of directions as the six faces of a cube, each cut in blocks of 16 x 16 texels. Source:
// locally-adaptive-products, section 4.
//
// Faces are +X -X +Y -Y +Z -Z; on each, u grows along its columns and v along its rows, both over [-1, 1]. Texels are
// stored [block][row][column], blocks [face][block row][block column], so that a block is a run of 256.
#include <lambent/core/aligned.h>
#include <lambent/core/vec.h>

#include <array>
#include <cstddef>
#include <vector>

namespace lambent {

// Texels a side of a block and in it; texels a side of a cube at most.
inline constexpr int block_side = 16;
inline constexpr int block_texels = block_side * block_side;
inline constexpr int max_cube_size = 256;

// Sizes that are whole blocks: multiples of 16 up to max_cube_size.
constexpr bool is_cube_size(int size) { return size >= block_side && size <= max_cube_size && size % block_side == 0; }
constexpr int cube_blocks(int size) { return 6 * (size / block_side) * (size / block_side); }
constexpr size_t cube_texels(int size) { return 6 * size_t(size) * size_t(size); }
constexpr size_t cube_texel(int size, int face, int column, int row) {
  const int side = size / block_side, block = (face * side + row / block_side) * side + column / block_side;
  return size_t(block) * block_texels + size_t(row % block_side * block_side + column % block_side);
}

// The point of the cube's surface at (u, v) of a face, not of unit length; and the face and (u, v) that a direction
// meets.
Vec3 cube_point(int face, float u, float v);
struct CubePlace {
  int face;
  float u, v;
};
CubePlace cube_place(Vec3 direction);

// Solid angle of a texel, exact; those of a cube sum to 4 pi.
double cube_solid_angle(int size, int column, int row);

// Directions by array, as SIMD likes them; `count` rounded up to a multiple of 16 by copies of the last.
struct DirectionArray {
  AlignedVector<float> x, y, z;
  void push(Vec3 d) { x.push_back(d.x), y.push_back(d.y), z.push_back(d.z); }
  Vec3 at(size_t i) const { return {x[i], y[i], z[i]}; }
};

// Points a side at which a function on a block is sampled for 1, 4, 16 or 64 values, and what interpolates between
// them.
inline constexpr int node_sides[4] = {1, 2, 4, 8};
// Where along a side, in texels, the node of so many is: in the middle of equal parts; of 8 at Chebyshev's points.
double node_place(int nodes, int node);
// The polynomial of degree 7 that is 1 at that node of 8 and 0 at others, at x texels.
double fine_cardinal(int node, double x);

// What is known of a cube of so many texels a side, whatever lies on it.
struct Cube {
  int size = 0;
  DirectionArray texels;                // centres
  std::array<DirectionArray, 4> nodes;  // [block][row][column] for 1, 2, 4 and 8 a side
  std::vector<float> reach;             // by block: angle from its middle to its farthest corner, radians
  float widest = 0;                     // of these
  // Cardinal functions of the nodes along one side, [node][texel]: 1 at their own node, 0 at others, sums of as many
  // cosines cos(pi k (x + 1/2) / 16) (the DCT's) as there are nodes. eq. 4, solved once. Of 8 nodes polynomials:
  // cosines are level at a block's border, which a lobe is not.
  std::array<std::vector<float>, 4> cardinal;

  int blocks() const { return cube_blocks(size); }
  size_t count() const { return cube_texels(size); }
};
// `size` texels a side, which is_cube_size() takes.
Cube make_cube(int size);

}  // namespace lambent

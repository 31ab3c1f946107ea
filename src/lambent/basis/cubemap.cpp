// Follows: locally-adaptive-products, section 4 (blocks, solid angles) and eq. 4 (small inverses).
#include <lambent/basis/cubemap.h>
#include <lambent/core/check.h>

#include <Eigen/Dense>

namespace lambent {

Vec3 cube_point(int face, float u, float v) {
  switch (face) {
    case 0: return {1, -v, -u};
    case 1: return {-1, -v, u};
    case 2: return {u, 1, v};
    case 3: return {u, -1, -v};
    case 4: return {u, -v, 1};
    default: return {-u, -v, -1};
  }
}

CubePlace cube_place(Vec3 d) {
  const Vec3 a = abs(d);
  if (a.x >= a.y && a.x >= a.z)
    return d.x > 0 ? CubePlace{0, -d.z / a.x, -d.y / a.x} : CubePlace{1, d.z / a.x, -d.y / a.x};
  if (a.y >= a.z) return d.y > 0 ? CubePlace{2, d.x / a.y, d.z / a.y} : CubePlace{3, d.x / a.y, -d.z / a.y};
  return d.z > 0 ? CubePlace{4, d.x / a.z, -d.y / a.z} : CubePlace{5, -d.x / a.z, -d.y / a.z};
}

double cube_solid_angle(int size, int column, int row) {
  // Of the rectangle from the face's middle to (u, v).
  auto corner = [](double u, double v) { return std::atan2(u * v, std::sqrt(u * u + v * v + 1)); };
  const double u0 = 2.0 * column / size - 1, u1 = 2.0 * (column + 1) / size - 1, v0 = 2.0 * row / size - 1,
               v1 = 2.0 * (row + 1) / size - 1;
  return corner(u1, v1) - corner(u0, v1) - corner(u1, v0) + corner(u0, v0);
}

double node_place(int nodes, int node) {
  if (nodes < node_sides[3]) return (node + 0.5) * block_side / nodes;
  return 0.5 * block_side * (1 - std::cos(std::numbers::pi * (node + 0.5) / nodes));
}

double fine_cardinal(int node, double x) {
  constexpr int n = node_sides[3];
  double out = 1;
  for (int i = 0; i < n; ++i)
    if (i != node) out *= (x - node_place(n, i)) / (node_place(n, node) - node_place(n, i));
  return out;
}

Cube make_cube(int size) {
  LAMBENT_CHECK(is_cube_size(size));
  Cube cube;
  cube.size = size;
  const int side = size / block_side;
  auto coordinate = [&](float texel) { return 2 * texel / float(size) - 1; };
  for (int face = 0; face < 6; ++face)
    for (int block = 0; block < side * side; ++block) {
      const float column = float(block % side * block_side), row = float(block / side * block_side);
      auto direction = [&](float x, float y) {
        return normalize(cube_point(face, coordinate(column + x), coordinate(row + y)));
      };
      for (int t = 0; t < block_texels; ++t)
        cube.texels.push(direction(float(t % block_side) + 0.5f, float(t / block_side) + 0.5f));
      for (int k = 0; k < 4; ++k) {
        const int n = node_sides[k];
        for (int i = 0; i < n * n; ++i)
          cube.nodes[size_t(k)].push(direction(float(node_place(n, i % n)), float(node_place(n, i / n))));
      }
      const Vec3 middle = cube.nodes[0].at(cube.reach.size());
      float least = 1;
      for (float x : {0.0f, 16.0f})
        for (float y : {0.0f, 16.0f}) least = std::min(least, dot(middle, direction(x, y)));
      cube.reach.push_back(std::acos(least));
      cube.widest = std::max(cube.widest, cube.reach.back());
    }
  for (DirectionArray& nodes : cube.nodes)
    while (nodes.x.size() % 16) nodes.push(nodes.at(nodes.x.size() - 1));
  for (int k = 0; k < 3; ++k) {
    const int n = node_sides[k];
    Eigen::MatrixXd at_nodes(n, n), at_texels(block_side, n);  // [place][cosine]
    auto cosine = [](int u, double x) { return std::cos(std::numbers::pi * u * x / block_side); };
    for (int u = 0; u < n; ++u) {
      for (int i = 0; i < n; ++i) at_nodes(i, u) = cosine(u, (i + 0.5) * block_side / n);
      for (int x = 0; x < block_side; ++x) at_texels(x, u) = cosine(u, x + 0.5);
    }
    const Eigen::MatrixXd cardinal = at_texels * at_nodes.inverse();  // [texel][node]
    for (int i = 0; i < n; ++i)
      for (int x = 0; x < block_side; ++x) cube.cardinal[size_t(k)].push_back(float(cardinal(x, i)));
  }
  for (int i = 0; i < node_sides[3]; ++i)
    for (int x = 0; x < block_side; ++x) cube.cardinal[3].push_back(float(fine_cardinal(i, x + 0.5)));
  return cube;
}

}  // namespace lambent

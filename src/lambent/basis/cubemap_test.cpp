#include <lambent/basis/cubemap.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Cubemap, SolidAnglesSumToTheSphere) {
  for (int size : {16, 64, 128}) {
    double sum = 0;
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) sum += cube_solid_angle(size, column, row);
    EXPECT_NEAR(6 * sum, 4 * std::numbers::pi, 1e-11);
  }
}

TEST(Cubemap, ASolidAngleIsTheShareOfRandomDirections) {
  const int size = 16, draws = 1 << 20;
  std::vector<int> hits(cube_texels(size), 0);
  for (int i = 0; i < draws; ++i) {
    const CubePlace p = cube_place(square_to_sphere(sobol_owen(uint32_t(i), 7)));
    auto cell = [](float u) { return std::min(int((u + 1) / 2 * 16), 15); };
    ++hits[cube_texel(size, p.face, cell(p.u), cell(p.v))];
  }
  for (int face = 0; face < 6; ++face)
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) {
        const double expected = draws * cube_solid_angle(size, column, row) / (4 * std::numbers::pi);
        EXPECT_NEAR(hits[cube_texel(size, face, column, row)], expected, 6 * std::sqrt(expected));
      }
}

TEST(Cubemap, PlacesAreDirectionsAgain) {
  Random random(3);
  for (int i = 0; i < 10000; ++i) {
    const Vec3 d = square_to_sphere(random.next2());
    const CubePlace p = cube_place(d);
    EXPECT_LE(std::max(std::abs(p.u), std::abs(p.v)), 1.0f);
    EXPECT_LT(length(normalize(cube_point(p.face, p.u, p.v)) - d), 1e-6f);
  }
}

TEST(Cubemap, BlocksHoldTheirTexels) {
  for (int size : {16, 64, 128}) {
    const Cube cube = make_cube(size);
    ASSERT_EQ(cube.texels.x.size(), cube_texels(size));
    std::vector<int> seen(cube_texels(size), 0);
    for (int face = 0; face < 6; ++face)
      for (int row = 0; row < size; ++row)
        for (int column = 0; column < size; ++column) {
          const size_t t = cube_texel(size, face, column, row);
          ++seen[t];
          const CubePlace p = cube_place(cube.texels.at(t));
          EXPECT_EQ(p.face, face);
          EXPECT_NEAR((p.u + 1) / 2 * float(size), float(column) + 0.5f, 1e-3f);
          EXPECT_NEAR((p.v + 1) / 2 * float(size), float(row) + 0.5f, 1e-3f);
          EXPECT_LE(std::acos(dot(cube.texels.at(t), cube.nodes[0].at(t / block_texels))),
                    cube.reach[t / block_texels]);
        }
    for (int n : seen) EXPECT_EQ(n, 1);
  }
}

// eq. 4: what is made of so few cosines comes back from so few samples.
TEST(Cubemap, CardinalFunctionsInterpolateCosines) {
  const Cube cube = make_cube(16);
  for (int k = 0; k < 3; ++k) {
    const int n = node_sides[k];
    for (int u = 0; u < n; ++u)
      for (int x = 0; x < block_side; ++x) {
        double sum = 0;
        for (int i = 0; i < n; ++i)
          sum += std::cos(std::numbers::pi * u * (i + 0.5) / n) *
                 double(cube.cardinal[size_t(k)][size_t(i * block_side + x)]);
        EXPECT_NEAR(sum, std::cos(std::numbers::pi * u * (x + 0.5) / block_side), 1e-6);
      }
  }
}

TEST(Cubemap, EightNodesInterpolatePolynomials) {
  const Cube cube = make_cube(16);
  constexpr int n = node_sides[3];
  for (int power = 0; power < n; ++power)
    for (int x = 0; x < block_side; ++x) {
      double sum = 0;
      for (int i = 0; i < n; ++i)
        sum += std::pow(node_place(n, i) / 8 - 1, power) * double(cube.cardinal[3][size_t(i * block_side + x)]);
      EXPECT_NEAR(sum, std::pow((x + 0.5) / 8 - 1, power), 1e-6);
    }
}

}  // namespace
}  // namespace lambent

#include <lambent/core/file.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/core/vec.h>

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <unistd.h>

namespace lambent {
namespace {

TEST(Sampling, SobolOwenFillsEveryElementaryInterval) {
  for (uint32_t seed : {0u, 7u, 123456u})
    for (int rows = 1; rows <= 256; rows *= 2) {  // 256 points: one in each of 256 boxes, whatever their shape
      const int columns = 256 / rows;
      std::vector<int> count(256);
      for (uint32_t i = 256; i < 512; ++i) {
        const Vec2 u = sobol_owen(i, seed);
        ASSERT_TRUE(u.x >= 0 && u.x < 1 && u.y >= 0 && u.y < 1);
        ++count[size_t(int(u.x * float(columns)) + columns * int(u.y * float(rows)))];
      }
      for (int c : count) EXPECT_EQ(c, 1) << "seed " << seed << ", rows " << rows;
    }
}

TEST(Sampling, WarpsHaveTheirMoments) {
  // Means over 4,096 stratified points; the functions are smooth, so errors are far below this.
  constexpr float quadrature = 2e-3f;
  Vec3 cosine(0), sphere(0), sphere_squared(0);
  float cosine_z2 = 0;
  const int n = 4096;
  for (uint32_t i = 0; i < n; ++i) {
    const Vec3 a = square_to_cosine_hemisphere(sobol_owen(i, 1)), b = square_to_sphere(sobol_owen(i, 2));
    EXPECT_NEAR(length(a), 1, 1e-5f);
    EXPECT_NEAR(length(b), 1, 1e-5f);
    cosine += a / float(n), cosine_z2 += a.z * a.z / float(n);
    sphere += b / float(n), sphere_squared += b * b / float(n);
  }
  EXPECT_NEAR(cosine.x, 0, quadrature);
  EXPECT_NEAR(cosine.z, 2.0f / 3, quadrature);  // integral of z cos / pi
  EXPECT_NEAR(cosine_z2, 0.5f, quadrature);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(sphere[k], 0, quadrature);
    EXPECT_NEAR(sphere_squared[k], 1.0f / 3, quadrature);
  }
}

TEST(Sampling, DiskGoesBackToTheSquare) {
  constexpr float rounding = 1e-6f;
  for (uint32_t i = 0; i < 1000; ++i) {
    const Vec2 u = sobol_owen(i, 4), back = disk_to_square(square_to_disk(u));
    EXPECT_NEAR(back.x, u.x, rounding);
    EXPECT_NEAR(back.y, u.y, rounding);
  }
  EXPECT_EQ(disk_to_square({0, 0}), Vec2(0.5f));
  for (Vec2 corner : {Vec2(0, 0), Vec2(0, 1), Vec2(1, 0), Vec2(1, 1), Vec2(0.5f, 0), Vec2(1, 0.5f)}) {
    const Vec2 back = disk_to_square(square_to_disk(corner));
    EXPECT_NEAR(back.x, corner.x, rounding);
    EXPECT_NEAR(back.y, corner.y, rounding);
  }
}

TEST(Vec, YawTurnsXTowardsMinusZ) {
  // A right-handed turn about +Y takes +Z to +X and +X to -Z.
  const Mat3 yaw = rotation_from_yaw_pitch_roll({90, 0, 0});
  EXPECT_NEAR(length(yaw * Vec3(0, 0, 1) - Vec3(1, 0, 0)), 0, 1e-6f);
  const Mat3 pitch = rotation_from_yaw_pitch_roll({0, 90, 0});
  EXPECT_NEAR(length(pitch * Vec3(0, 1, 0) - Vec3(0, 0, 1)), 0, 1e-6f);
  const Mat3 roll = rotation_from_yaw_pitch_roll({0, 0, 90});
  EXPECT_NEAR(length(roll * Vec3(1, 0, 0) - Vec3(0, 1, 0)), 0, 1e-6f);
  const Mat3 all = rotation_from_yaw_pitch_roll({20, 30, 40});
  EXPECT_NEAR(determinant(all), 1, 1e-5f);
}

TEST(Vec, FramesAreRightHandedAndOrthonormal) {
  for (uint32_t i = 0; i < 200; ++i) {
    const Mat3 f = frame_about(square_to_sphere(sobol_owen(i, 3)));
    EXPECT_NEAR(dot(f[0], f[1]), 0, 1e-6f);
    EXPECT_NEAR(length(cross(f[0], f[1]) - f[2]), 0, 1e-5f);
  }
}

TEST(Parallel, PiecesCoverTheRangeOnceAndBeginAtMultiples) {
  std::vector<std::atomic<int>> seen(1003);
  parallel_for(seen.size(), 17, [&](size_t begin, size_t end) {
    EXPECT_EQ(begin % 17, 0u);
    for (size_t i = begin; i < end; ++i) ++seen[i];
  });
  for (const auto& s : seen) EXPECT_EQ(s, 1);
  ThreadLimit one(1);
  EXPECT_EQ(thread_count(), 1);
}

TEST(File, IsWrittenWholeOrNotAtAll) {
  const std::string folder =
      (std::filesystem::temp_directory_path() / ("lambent_core_" + std::to_string(::getpid()))).string();
  std::filesystem::create_directory(folder);
  ASSERT_TRUE(write_file_atomically(folder + "/a", "hello"));
  EXPECT_EQ(*read_file(folder + "/a"), std::vector<uint8_t>({'h', 'e', 'l', 'l', 'o'}));
  ASSERT_TRUE(write_file_atomically(folder + "/a", "other"));
  EXPECT_EQ((*read_file(folder + "/a"))[0], 'o');
  EXPECT_FALSE(write_file_atomically(folder + "/no/such/folder", "x"));
  EXPECT_FALSE(write_file_atomically(folder, "x"));
  size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++files;
  EXPECT_EQ(files, 1u);
  EXPECT_FALSE(read_file(folder));
  EXPECT_FALSE(read_file(folder + "/missing"));
  auto mapped = MappedFile::open(folder + "/a");
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->bytes().size(), 5u);
  std::filesystem::remove_all(folder);
  EXPECT_EQ(mapped->bytes()[4], 'r');  // the mapping outlives the name
}

TEST(File, KnowsExtensions) {
  EXPECT_EQ(file_extension("a/B.GLB"), "glb");
  EXPECT_EQ(file_extension("a.b/c"), "");
  EXPECT_EQ(file_extension("x.tar.gz"), "gz");
}

}  // namespace
}  // namespace lambent

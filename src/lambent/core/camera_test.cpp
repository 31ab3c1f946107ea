#include <lambent/core/camera.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Where a point lies in the picture, in shares of half its width and height from its middle: by the definition of a
// pinhole of this vertical field of view, in double, and not by camera_around's planes.
Vec2d seen(const Camera& camera, double aspect, Vec3 point) {
  const Vec3d forward = normalize(Vec3d(camera.target) - Vec3d(camera.eye)),
              side = normalize(cross(forward, Vec3d(camera.up))), up = cross(side, forward),
              d = Vec3d(point) - Vec3d(camera.eye);
  const double depth = dot(d, forward), half = std::tan(double(radians(camera.fov)) / 2);
  EXPECT_GT(depth, 0);
  return {dot(d, side) / (depth * half * aspect), dot(d, up) / (depth * half)};
}

TEST(CameraAround, JustFitsAnyBoxInAnyPicture) {
  Random random(1);
  constexpr double margin = 0.96, rounding = 2e-3;  // of float coordinates, seen from as near as a camera gets
  for (int i = 0; i < 3000; ++i) {
    const double scale = std::pow(10.0, -7 + 14 * double(random.next()));
    const float aspect = float(std::pow(8.0, 2 * double(random.next()) - 1));
    Vec3 size(random.next(), random.next(), random.next());
    if (i % 3 == 0) size[size_t(i / 3 % 3)] *= 1e-3f;
    size = size * float(scale);
    const Vec3 centre = (Vec3(random.next(), random.next(), random.next()) - 0.5f) * float(8 * scale);
    const Bounds box{centre - size * 0.5f, centre + size * 0.5f};
    const Camera camera = camera_around(box, aspect);
    double widest = 0, highest = 0, left = 0, right = 0, low = 0, high = 0;
    for (int k = 0; k < 8; ++k) {
      const Vec2d at =
          seen(camera, double(aspect),
               {k & 1 ? box.max.x : box.min.x, k & 2 ? box.max.y : box.min.y, k & 4 ? box.max.z : box.min.z});
      left = std::min(left, at.x), right = std::max(right, at.x);
      low = std::min(low, at.y), high = std::max(high, at.y);
      widest = std::max(widest, std::abs(at.x)), highest = std::max(highest, std::abs(at.y));
    }
    EXPECT_NEAR(std::max(widest, highest), margin, rounding) << i;
    // In the middle of what it touches: both sides of it.
    if (widest > highest) EXPECT_NEAR(-left, right, 2 * rounding) << i;
    else EXPECT_NEAR(-low, high, 2 * rounding) << i;
  }
}

TEST(CameraAround, LooksAtPointsAndAtNone) {
  const Vec3 one(3, 4, 5);
  for (std::span<const Vec3> points : {std::span<const Vec3>(&one, 1), std::span<const Vec3>()}) {
    const Camera camera = camera_around(points, 1.5f);
    EXPECT_NE(camera.eye, camera.target);
    EXPECT_TRUE(is_finite(camera.eye) && is_finite(camera.target));
  }
  EXPECT_LT(std::abs(seen(camera_around(std::span<const Vec3>(&one, 1), 1.5f), 1.5, one).x), 1e-6);
}

}  // namespace
}  // namespace lambent

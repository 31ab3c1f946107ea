#include <lambent/basis/quadrature.h>
#include <lambent/compress/parametric.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Membrane, IsTheProjectionOfEquation22) {
  const Vec3 normal = normalize(Vec3(0.3f, -0.8f, 0.5f));
  for (float alpha : {0.0f, 0.4f, 1.0f}) {
    const ZonalTransfer t = membrane_transfer(6, std::vector{normal}, std::vector{alpha}, Precision::single);
    const std::vector<float> sh = zonal_harmonics(t, load_receiver(t, 0));
    const std::vector<double> numeric = project_sh(
        6, [&](Vec3d d) { return std::max(dot(d, Vec3d(normal)), -alpha * dot(d, Vec3d(normal))) / std::numbers::pi; },
        400);
    // The quadrature does not know where the kink is: an error of the square of its spacing, 1/400.
    for (size_t k = 0; k < 36; ++k) EXPECT_NEAR(sh[k], numeric[k], 1e-5) << k;
  }
}

}  // namespace
}  // namespace lambent

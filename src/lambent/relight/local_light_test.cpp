#include <lambent/basis/sh.h>
#include <lambent/basis/zonal.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/local_light.h>
#include <lambent/relight/zonal.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Against the projection of the cap by quadrature, about +z, turned to the lamp.
TEST(LocalLight, ALampIsACapOfDirections) {
  const Vec3 place(0.3f, -1, 0.5f);
  for (const SphereLamp& lamp :
       {SphereLamp{{2, 3, -1}, 0.4f, {1, 2, 3}}, SphereLamp{{0.5f, -0.2f, 0.4f}, 0.8f, {1, 0, 5}},
        SphereLamp{{900, 3, -1}, 0.5f, {1, 2, 3}}}) {
    std::vector<Vec3> out(49), added(49);
    light_at({std::vector<Vec3>(49, Vec3(0.0f)), {lamp}, {}}, place, out);
    light_at({std::vector<Vec3>(49, Vec3(0.25f)), {lamp}, {}}, place, added);
    const double d = length(Vec3d(lamp.centre - place)), edge = std::sqrt(1 - std::pow(lamp.radius / d, 2));
    const double kinks[] = {edge};
    const std::vector<double> cap = project_zonal(
        7, [&](double x) { return x > edge ? 1.0 : 0.0; }, kinks);
    float y[49];
    evaluate_sh(7, normalize(lamp.centre - place), y);
    const double size = std::abs(cap[0]) + 1e-12;
    for (int k = 0; k < 49; ++k) EXPECT_EQ(added[size_t(k)], out[size_t(k)] + 0.25f) << k;
    for (int k = 0; k < 49; ++k)
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(out[size_t(k)][c] / size, lamp.radiance[c] * cap[size_t(sh_band(k))] * y[k] / size, 1e-5) << k;
  }
  // A window weighs its bands, and leaves out those beyond.
  const SphereLamp lamp{{2, 3, -1}, 0.4f, {1, 2, 3}};
  std::vector<Vec3> whole(16), windowed(16);
  light_at({std::vector<Vec3>(16, Vec3(0.0f)), {lamp}, {}}, place, whole);
  light_at({std::vector<Vec3>(16, Vec3(0.0f)), {lamp}, {1, 0.5f}}, place, windowed);
  for (int k = 0; k < 16; ++k)
    EXPECT_EQ(windowed[size_t(k)], whole[size_t(k)] * (k == 0 ? 1.0f : k < 4 ? 0.5f : 0.0f)) << k;
  // Within the lamp light comes from everywhere.
  std::vector<Vec3> out(9);
  light_at({std::vector<Vec3>(9, Vec3(0.0f)), {{{0, 0, 0}, 2, Vec3(1)}}, {}}, Vec3(0.5f), out);
  EXPECT_NEAR(out[0].x, std::sqrt(4 * std::numbers::pi), 1e-5);
  for (size_t k = 1; k < 9; ++k) EXPECT_NEAR(out[k].x, 0, 1e-6);
}

// An open plane under a lamp that it sees whole has irradiance pi L (r / d)^2 cos in closed form; six bands of it leave
// little out.
TEST(LocalLight, LightsAPlaneByTheInverseSquare) {
  const WritableZonalTransfer plane = make_zonal_transfer(6, 1, 1, 40, Precision::single);
  std::vector<float> values{float(clamped_cosine(0) / std::numbers::pi * std::sqrt(1 / (4 * std::numbers::pi))), 0, 0,
                            1};
  for (int l = 1; l < 6; ++l) values.push_back(float(clamped_cosine(l) / std::numbers::pi));
  std::vector<Vec3> places;
  for (size_t r = 0; r < 40; ++r) {
    store_receiver(plane, r, values);
    places.push_back({0.1f * float(r) - 2, 0.07f * float(r), 0});
  }
  const SphereLamp lamp{{0.2f, 0.5f, 1.5f}, 1.0f, {3, 2, 1}};
  Relit relit;
  relight_zonal(plane.transfer, nullptr, make_light_field({std::vector<Vec3>(36, Vec3(0)), {lamp}, {}}, places), relit);
  for (size_t r = 0; r < 40; ++r) {
    const Vec3 to = lamp.centre - places[r];
    const float d = length(to), cosine = to.z / d, truth = 3 * lamp.radius * lamp.radius / (d * d) * cosine;
    if (cosine < lamp.radius / d) continue;  // partly below the horizon
    EXPECT_NEAR(relit.at(r).x, truth, 0.05f * truth + 0.01f) << r;
    EXPECT_NEAR(relit.at(r).y, relit.at(r).x * 2 / 3, 1e-5);
  }
}

// Each receiver's own light, side by side in vectors, is what one receiver at a time gives.
TEST(LocalLight, EveryReceiverHasItsOwn) {
  for (int channels : {1, 3})
    for (Precision precision : {Precision::half, Precision::single}) {
      const size_t n = 45;
      const WritableZonalTransfer w = make_zonal_transfer(5, 3, channels, n, precision, 2);
      std::vector<Mat3> rotations;
      std::vector<Vec3> places;
      Random random(11);
      for (size_t r = 0; r < n; ++r) {
        std::vector<float> v(w.transfer.receiver_values());
        for (float& x : v) x = 2 * random.next() - 1;
        store_receiver(w, r, v);
        rotations.push_back(rotation_from_yaw_pitch_roll({360 * random.next(), 90 * random.next(), 0}));
        places.push_back({random.next(), random.next(), random.next()});
      }
      LocalLight light{
          std::vector<Vec3>(25), {{{2, 1, 0}, 0.5f, {4, 5, 6}}, {{0.5f, 0.5f, 0.5f}, 0.2f, {1, 0, 2}}}, {}};
      for (Vec3& e : light.distant) e = {random.next(), random.next(), random.next() - 0.5f};
      const ReceiverFrames frames = make_receiver_frames(rotations);
      Relit out;
      relight_zonal(w.transfer, &frames, make_light_field(light, places), out);
      std::vector<Vec3> at(25);
      for (size_t r = 0; r < n; ++r) {
        light_at(light, places[r], at);
        const std::vector<float> values = load_receiver(w.transfer, r);
        for (int row = 0; row < 2; ++row) {
          const Vec3 truth = shade_zonal(
              w.transfer, std::span(values).subspan(size_t(row) * w.transfer.row_values(), w.transfer.row_values()),
              rotations[r], at);
          EXPECT_LT(length(out.at(r, row) - truth), 1e-4f * (1 + length(truth))) << r;
        }
      }
    }
}

}  // namespace
}  // namespace lambent

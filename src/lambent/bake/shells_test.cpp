#include <lambent/bake/shells.h>
#include <lambent/basis/sh.h>
#include <lambent/relight/moving.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

// Harmonics of a cap about the unit vector d, where w . d > cosine: of band l, sqrt(4 pi / (2 l + 1)) times the zonal
// coefficient, by the integral of Legendre's polynomials.
std::vector<float> cap(int order, Vec3 d, double cosine) {
  std::vector<float> y(size_t(sh_count(order)));
  evaluate_sh(order, d, y);
  for (int k = 0; k < sh_count(order); ++k) {
    const int l = sh_band(k);
    // (2 l + 1) int P_l = P_(l-1) - P_(l+1), at the cap's edge.
    const auto legendre = [&](unsigned n) { return std::legendre(n, cosine); };
    const double integral = l == 0 ? 1 - cosine : (legendre(unsigned(l - 1)) - legendre(unsigned(l + 1))) / (2 * l + 1);
    y[size_t(k)] *= float(2 * std::numbers::pi * integral);
  }
  return y;
}

struct Ball {
  ShellOptions options{.order = 4, .shells = 14, .side = 24, .samples = 128};
  Scene scene = make_sphere(1, 4, Vec3(0.5f));
  Field field;
  HiddenLight light;
  PlacedObject placed;
  Ball() {
    auto tracer = Tracer::build(scene);
    auto shells = make_shells(scene, options);
    field = *bake_hidden(*tracer, *shells, options);
    light = hidden_light(field, 4);
    placed = place_object(light, {});
  }
};

const Ball& the_ball() {
  static const Ball ball;
  return ball;
}

TEST(ShellBake, ASphereHidesACapWhereverItStands) {
  const RigidPlace place{Vec3(3, -2, 1), rotation_from_yaw_pitch_roll({30, 40, 50}), 2};
  const PlacedObject placed = place_object(the_ball().light, place);
  std::vector<float> hidden(16);
  for (float distance : {2.05f, 2.4f, 3.0f, 5.0f, 11.0f, 30.0f})
    for (Vec3 way : {Vec3(0, 1, 0), Vec3(0.6f, 0, 0.8f), Vec3(-0.48f, -0.6f, 0.64f)}) {
      hidden_from(placed, place.position + distance * way, hidden);
      const double sine = 2.0 / double(distance);
      const std::vector<float> truth = cap(4, -way, std::sqrt(1 - sine * sine));
      // Of the constant: the share of the sphere. What interpolation and the facets leave.
      for (size_t k = 0; k < truth.size(); ++k)
        EXPECT_NEAR(hidden[k], truth[k], 0.1f * truth[0] + 0.004f) << distance << " " << k;
    }
}

TEST(ShellBake, FarAwayItTendsToTheSolidAngle) {
  const Ball& ball = the_ball();
  std::vector<float> hidden(16);
  for (float distance : {12.0f, 50.0f, 1000.0f}) {
    hidden_from(ball.placed, Vec3(0, 0, distance), hidden);
    EXPECT_NEAR(hidden[0] * std::sqrt(4 * pi) * distance * distance / pi, 1, 0.02f);  // the disk's angle: pi / d^2
  }
}

TEST(ShellBake, WhatSurroundsAPointHidesAll) {
  const Ball& ball = the_ball();
  std::vector<float> hidden(16);
  for (Vec3 p : {Vec3(0.0f), Vec3(0.1f, 0.2f, 0), Vec3(0, -0.7f, 0), Vec3(0.5f, 0.5f, 0.5f)}) {
    hidden_from(ball.placed, p, hidden);
    EXPECT_NEAR(hidden[0], std::sqrt(4 * pi), 2e-3f);
    for (size_t k = 1; k < hidden.size(); ++k) EXPECT_NEAR(hidden[k], 0, 0.04f);
  }
}

TEST(ShellBake, ASquareLampHasItsFormFactor) {
  // A square of side 2 that shines down, seen from below its middle: E = L * integral of cosines.
  Scene lamp = make_quad(Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 0, 2), 8, 8, Vec3(0.5f));
  lamp.materials[0].emissive = Vec3(3, 2, 1);
  const ShellOptions options{.order = 6, .shells = 9, .side = 9, .samples = 2048};
  auto tracer = Tracer::build(lamp);
  ASSERT_TRUE(tracer);
  auto shells = make_shells(lamp, options);
  ASSERT_TRUE(shells) << shells.error().text();
  auto field = bake_shining(lamp, *tracer, *shells, options);
  ASSERT_TRUE(field) << field.error().text();
  const bool down = lamp.normals[0].y < 0;
  const float side = down ? -1.0f : 1.0f;
  // At the shell's pole, or near it: harmonics of the light, against the cosine.
  for (size_t p = 0; p < shells->count(); p += 7) {
    const Vec3 at = shell_point(*shells, p) - shells->center;
    const float h = side * at.y;
    if (h < 1.0f || h > 4) continue;
    const std::vector<float> rows = load_receiver(std::get<Transfer>(field->store), p);
    const Vec3 n(0, -side, 0);
    std::vector<float> y(36);
    evaluate_sh(6, n, y);
    double ours = 0;
    for (int k = 0; k < 36; ++k) ours += clamped_cosine(sh_band(k)) * double(y[size_t(k)] * rows[size_t(3 * k)]);
    double truth = 0;
    const int cells = 64;
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j) {
        const Vec3 to = Vec3((float(i) + 0.5f) / cells * 2 - 1, 0, (float(j) + 0.5f) / cells * 2 - 1) - at;
        const float r2 = dot(to, to);
        truth += 3.0 * double(to.y * to.y / (r2 * r2)) * 4.0 / (cells * cells);
      }
    EXPECT_NEAR(ours, truth, 0.04 * truth + 0.02) << at.x << " " << at.y << " " << at.z;
  }
}

TEST(ShellBake, RefusesWhatHasNoSizeOrShells) {
  EXPECT_FALSE(make_shells(make_sphere(0, 1, Vec3(1)), {}));
  const Scene ball = make_sphere(1, 1, Vec3(1));
  EXPECT_FALSE(make_shells(ball, {.shells = 1}));
  EXPECT_FALSE(make_shells(ball, {.side = 65}));
  EXPECT_FALSE(make_shells(ball, {.inner = 2}));
  EXPECT_FALSE(bake_shining(ball, *Tracer::build(ball), *make_shells(ball, {}), {}));
}

}  // namespace
}  // namespace lambent

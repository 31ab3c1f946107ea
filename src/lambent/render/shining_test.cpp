// Light of objects that shine against closed forms.
#include <lambent/bake/shells.h>
#include <lambent/core/random.h>
#include <lambent/relight/shining.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

const Vec3 glow(3, 2, 1);

// What shines or hides, by its field.
struct Fields {
  Field hidden, shining;
  HiddenLight hides;
  ShiningLight shines;
  Fields(Scene scene, const ShellOptions& options, Vec3 emissive) {
    scene.materials[0].emissive = emissive;
    auto tracer = Tracer::build(scene);
    auto shells = make_shells(scene, options);
    hidden = *bake_hidden(*tracer, *shells, options);
    hides = hidden_light(hidden, options.order);
    if (emissive == Vec3(0.0f)) return;
    shining = *bake_shining(scene, *tracer, *shells, options);
    shines = shining_light(shining, options.order);
  }
};

Scene square_lamp() {  // faces -y
  return make_quad(Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 0, 2), 4, 4, Vec3(0.5f));
}

// Receivers without a transfer worth the name: places and normals.
MovingReceivers receivers_at(std::span<const Vec3> positions, std::span<const Vec3> normals) {
  const WritableTransfer t = make_transfer({.order = 1}, 1, 1, positions.size(), Precision::single);
  return moving_receivers(t.transfer, positions, normals);
}

Relit black(size_t count) {
  Relit out;
  out.values.assign((count + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  return out;
}

Relit lit(const MovingReceivers& r, const PlacedLamp& lamp, std::span<const PlacedObject* const> objects = {},
          const PlacedObject* itself = nullptr) {
  Relit out = black(r.count);
  const SeenLamp lamps[] = {{&lamp, itself}};
  LampShader().add(r, lamps, objects, LampResponse::cosine, out);
  return out;
}

// Lambert's formula: the irradiance of a polygon of radiance 1 that lies above the horizon.
double polygon_irradiance(std::span<const Vec3> corners, Vec3 at, Vec3 normal) {
  double sum = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = normalize(Vec3d(corners[i] - at)), b = normalize(Vec3d(corners[(i + 1) % corners.size()] - at));
    const Vec3d across = cross(a, b);
    sum += std::acos(std::clamp(dot(a, b), -1.0, 1.0)) * dot(across / length(across), Vec3d(normal));
  }
  return std::abs(sum) / 2;
}

TEST(Shining, ASquareLampHasItsFormFactorOverAFloor) {
  SKIP_UNDER_SANITIZERS();
  const Fields lamp(square_lamp(), {.order = 6, .samples = 512}, glow);
  const RigidPlace place{Vec3(0.2f, 2.5f, -0.1f), rotation_from_yaw_pitch_roll({30, 0, 0}), 0.8f};
  const PlacedLamp placed = place_lamp(lamp.shines, place);
  Vec3 corners[4];
  for (int i = 0; i < 4; ++i)
    corners[i] = place.position +
                 place.scale * (place.rotation * Vec3(i == 0 || i == 3 ? -1.0f : 1.0f, 0, i < 2 ? -1.0f : 1.0f));
  std::vector<Vec3> positions, normals;
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j < 15; ++j) {
      positions.emplace_back(0.4f * float(i - 7), 0.0f, 0.4f * float(j - 7));
      normals.emplace_back(0.0f, 1.0f, 0.0f);
    }
  const Relit relit = lit(receivers_at(positions, normals), placed);
  double squares = 0, peak = 0;
  for (size_t i = 0; i < positions.size(); ++i) {
    const double truth = polygon_irradiance(corners, positions[i], normals[i]) / double(pi) * double(glow.x);
    squares += std::pow(double(relit.at(i).x) - truth, 2), peak = std::max(peak, truth);
  }
  const double decibels = 10 * std::log10(peak * peak * double(positions.size()) / squares);
  RecordProperty("decibels", std::to_string(decibels));
  EXPECT_GT(decibels, 35);
}

TEST(Shining, ABallIsALampOfClosedForm) {
  SKIP_UNDER_SANITIZERS();
  const Fields ball(make_sphere(1, 4, Vec3(0.5f)), {.order = 6, .samples = 256}, glow);
  const RigidPlace place{Vec3(1, 3, 2), rotation_from_yaw_pitch_roll({10, 20, 30}), 0.5f};
  const PlacedLamp placed = place_lamp(ball.shines, place);
  std::vector<Vec3> positions, normals;
  std::vector<double> truth;
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const float distance = 0.8f + 4 * random.next();
    const Vec3 way = normalize(Vec3(random.next(), random.next(), random.next()) - 0.5f);
    const Vec3 normal = normalize(way + 0.6f * normalize(Vec3(random.next(), random.next(), random.next()) - 0.5f));
    const float sine = 0.5f / distance, cosine = dot(normal, way);
    if (std::asin(sine) + std::acos(cosine) > 1.5f) continue;  // crosses the horizon
    positions.push_back(place.position - distance * way), normals.push_back(normal);
    truth.push_back(double(sine * sine * cosine));
  }
  ASSERT_GT(truth.size(), 100u);
  const Relit relit = lit(receivers_at(positions, normals), placed);
  for (size_t i = 0; i < truth.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const double expected = truth[i] * double(glow[c]);
      EXPECT_NEAR(double(relit.at(i)[c]), expected, 0.05 * expected + 0.01) << i;
    }
}

TEST(Shining, FarAwayItTendsToRadianceTimesSolidAngle) {
  const Fields ball(make_sphere(1, 3, Vec3(0.5f)), {.order = 2, .samples = 64}, glow);
  const PlacedLamp placed = place_lamp(ball.shines, {Vec3(0, 1, 0), Mat3(1.0f), 2});
  Vec3 out[4];
  for (const float distance : {30.0f, 100.0f, 3000.0f}) {
    arriving_from(placed, Vec3(0, 1, distance), out);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(out[0][c] * std::sqrt(4 * pi) * distance * distance / (glow[c] * 4 * pi), 1, 0.03f);
  }
}

TEST(Shining, NearerObjectsAreInTheWayAndFartherOnesAreNot) {
  SKIP_UNDER_SANITIZERS();
  const Fields lamp(make_sphere(1, 3, Vec3(0.5f)), {.order = 6, .samples = 128}, glow);
  const Fields block(make_sphere(1, 3, Vec3(0.5f)), {.order = 6, .samples = 128}, Vec3(0.0f));
  const PlacedLamp placed = place_lamp(lamp.shines, {Vec3(0, 3, 0), Mat3(1.0f), 0.3f});
  const PlacedObject itself = place_object(lamp.hides, {Vec3(0, 3, 0), Mat3(1.0f), 0.3f}),
                     between = place_object(block.hides, {Vec3(0, 1.2f, 0), Mat3(1.0f), 0.9f}),
                     beyond = place_object(block.hides, {Vec3(0, 4.5f, 0), Mat3(1.0f), 0.9f});
  const std::vector<Vec3> positions{Vec3(0, 0, 0)}, normals{Vec3(0, 1, 0)};
  const MovingReceivers r = receivers_at(positions, normals);
  const Relit alone = lit(r, placed);
  const std::vector<const PlacedObject*> hidden{&itself, &between}, free{&itself, &beyond};
  EXPECT_LT(lit(r, placed, hidden, &itself).at(0).x, 0.05f * alone.at(0).x);
  EXPECT_EQ(lit(r, placed, free, &itself).at(0), alone.at(0));
}

TEST(Shining, WhatIsBelowTheHorizonOrOutOfSightIsNotLit) {
  const Fields ball(make_sphere(1, 2, Vec3(0.5f)), {.order = 4, .shells = 6, .side = 6, .samples = 32}, glow);
  const PlacedLamp placed = place_lamp(ball.shines, {Vec3(0, 3, 0), Mat3(1.0f), 0.5f});
  const std::vector<Vec3> positions{Vec3(0, 0, 0), Vec3(0, 0, 0)}, normals{Vec3(0, -1, 0), Vec3(0, 1, 0)};
  const MovingReceivers r = receivers_at(positions, normals);
  EXPECT_EQ(lit(r, placed).at(0), Vec3(0.0f));
  const float open[] = {1, 0.25f};
  Relit relit = black(2);
  const SeenLamp lamps[] = {{&placed, nullptr, open}};
  LampShader().add(r, lamps, {}, LampResponse::cosine, relit);
  EXPECT_NEAR(relit.at(1).x, 0.25f * lit(r, placed).at(1).x, 1e-6f);
}

}  // namespace
}  // namespace lambent

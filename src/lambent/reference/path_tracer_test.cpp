#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/reference/integrator.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>
#include <reference_checks.h>

#include <cstring>

namespace lambent {
namespace {

using reference::Strategy;

using test::expect_same;
using test::look;
using test::sigmas;

Environment uniform(float L) { return test::uniform_environment(L); }
Environment skewed() { return test::skewed_environment(); }
ReferenceOptions picture(int size, int spp, int bounces) { return test::small_picture(size, spp, bounces); }

void move(Scene& scene, const Mat3& R, Vec3 shift) {
  for (Vec3& p : scene.positions) p = R * p + shift;
  for (Vec3& n : scene.normals) n = R * n;
}

// A room without a front wall, a box in it, coloured: corners, shadows, bleeding. Looked into from +Z.
Scene small_room() {
  Scene scene;
  uint32_t white = add_material(scene, "white", Vec3(0.8f)), red = add_material(scene, "red", Vec3(0.8f, 0.2f, 0.1f));
  add_quad(scene, white, "floor", {-1, -1, 1}, {2, 0, 0}, {0, 0, -2}, 2, 2);
  add_quad(scene, red, "left", {-1, -1, 1}, {0, 0, -2}, {0, 2, 0}, 2, 2);
  add_quad(scene, white, "back", {-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, 2, 2);
  add_box(scene, white, "box", {-0.2f, -1, -0.4f}, {0.4f, 0, 0.2f}, 1);
  return scene;
}

TEST(PathTracer, ConvexBodyUnderUniformLight) {
  // Exit radiance a L everywhere. Facets of a level-5 icosphere turn up to 0.02 rad from their normals and so lose up
  // to 0.02^2 / 4 = 1e-4 of the light below their planes.
  constexpr float L = 2, terminator = 1e-4f;
  const Vec3 albedo(0.8f, 0.5f, 0.2f);
  Scene scene = make_sphere(1, 5, albedo);
  auto result = path_trace(scene, uniform(L), look({1, 2, 3}, Vec3(0)), picture(24, 64, 2));
  ASSERT_TRUE(result);
  int covered = 0;
  Vec3d sum(0), variance(0);
  for (size_t i = 0; i < result->image.rgb.size(); ++i) {
    if (result->image.alpha[i] < 1) continue;
    ++covered, sum += Vec3d(result->image.rgb[i]), variance += Vec3d(result->variance[i]);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(result->image.rgb[i][c], albedo[c] * L,
                  sigmas * std::sqrt(result->variance[i][c]) + terminator * albedo[c] * L);
  }
  EXPECT_GT(covered, 100);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(sum[c] / covered, albedo[c] * L,
                sigmas * std::sqrt(variance[c]) / covered + terminator * albedo[c] * L);
}

TEST(PathTracer, NeverMeetsTheSurfaceItLeaves) {
  // By BRDF sampling alone every path from a flat-faced convex body under uniform light is worth exactly a L, unless it
  // meets the body again. Only roundings of a mean of equal floats remain.
  constexpr float a = 0.5f, tolerance = 1e-6f;
  const Environment env = uniform(1);
  Random random(5);
  for (float size : {1e-4f, 0.01f, 1.0f, 550.0f, 1e5f})
    for (float shift : {0.0f, 1.0f, 30.0f}) {
      Scene scene;
      add_box(scene, add_material(scene, "grey", Vec3(a)), "box", Vec3(-1, -0.05f, -0.7f) * size,
              Vec3(1, 0.05f, 0.7f) * size, 3);
      Mat3 R = rotation_from_yaw_pitch_roll(360.0f * Vec3(random.next(), random.next(), random.next()));
      Vec3 centre = shift * size * square_to_sphere(random.next2());
      move(scene, R, centre);
      auto integrator = reference::make_integrator(scene, env, 0, Strategy::brdf_only);
      ASSERT_TRUE(integrator);
      Camera camera = look(centre + R * (Vec3(2, 1.5f, 3) * size), centre);
      auto result = reference::render(*integrator, camera, picture(32, 16, 0), nullptr);
      ASSERT_TRUE(result);
      for (size_t i = 0; i < result->image.rgb.size(); ++i)
        ASSERT_NEAR(result->image.rgb[i].x, a * result->image.alpha[i], tolerance)
            << "size " << size << " shift " << shift;
    }
}

TEST(PathTracer, ClosedRoomIsDark) {
  // Not one path may leave through a corner, an edge or a wall: exactly black.
  const Environment env = uniform(1);
  Random random(6);
  for (float size : {0.01f, 1.0f, 550.0f})
    for (bool ball : {false, true}) {
      Scene scene;
      uint32_t white = add_material(scene, "white", Vec3(1));
      if (ball) add_sphere(scene, white, "ball", Vec3(0), size, 2, true);
      else add_box(scene, white, "room", Vec3(-size), Vec3(size), 2, true);
      Mat3 R = rotation_from_yaw_pitch_roll(360.0f * Vec3(random.next(), random.next(), random.next()));
      Vec3 centre = 3 * size * square_to_sphere(random.next2());
      move(scene, R, centre);
      auto result = path_trace(scene, env, look(centre, centre + R * Vec3(1, 1, 1) * size, 100), picture(32, 16, 6));
      ASSERT_TRUE(result);
      for (size_t i = 0; i < result->image.rgb.size(); ++i) {
        ASSERT_EQ(result->image.rgb[i], Vec3(0)) << "size " << size;
        ASSERT_EQ(result->image.alpha[i], 1.0f);
      }
    }
}

TEST(PathTracer, FloorAtTheFootOfAWallSeesHalfTheSky) {
  // The wall is 1e4 times higher and wider than the point is far from it: it leaves 1/2 + O(1e-8) of the light.
  Scene scene;
  add_quad(scene, add_material(scene, "black", Vec3(0)), "wall", {0, -1e3f, 1e3f}, {0, 0, -2e3f}, {0, 2e3f, 0}, 1, 1);
  const Vec3 at[]{{0.1f, 0, 0}}, up[]{{0, 1, 0}};
  auto result = exit_radiances(scene, uniform(2), at, up, 3, 16384, 1);
  EXPECT_LT(result[0].variance.x, 1e-4f);
  EXPECT_NEAR(result[0].mean.x, 1.0f, sigmas * std::sqrt(result[0].variance.x));
  EXPECT_EQ(exit_radiance(scene, uniform(2), at[0], up[0], 3, 16384, 1), result[0].mean);
}

TEST(PathTracer, SphereWithAPort) {
  SKIP_UNDER_SANITIZERS();
  // Inside a sphere every point sees every patch under the same form factor, patch area / sphere area. With a port of
  // fraction f and walls of albedo rho, k bounces give irradiance pi L f sum_{j <= k} (rho (1 - f))^j; exit radiance is
  // that over pi. A level-4 icosphere is 0.05 % smaller than the sphere, mostly alike everywhere: within 0.1 %.
  constexpr float rho = 0.7f, L = 1, tessellation = 1e-3f;
  Scene scene = make_sphere(1, 4, Vec3(rho), true);
  double open = 0;  // solid angle of the port from the centre (Van Oosterom and Strackee 1983)
  std::erase_if(scene.triangles, [&](const Triangle& t) {
    Vec3 a = scene.positions[t.v[0]], b = scene.positions[t.v[1]], c = scene.positions[t.v[2]];
    if (normalize(a + b + c).y < 0.8f) return false;
    open += 2 * std::atan2(std::abs(dot(a, cross(b, c))), 1 + dot(a, b) + dot(b, c) + dot(c, a));
    return true;
  });
  const double f = open / (4 * pi), kept = rho * (1 - f);
  ASSERT_NEAR(f, 0.1, 0.01);
  const std::vector<Vec3> n{{0, 1, 0}, normalize(Vec3(1, 0.3f, 0.2f)), normalize(Vec3(-1, 0.2f, 2))};
  std::vector<Vec3> at;
  for (Vec3 v : n) at.push_back(v * -0.998f);
  for (int k : {0, 1, 2, 30}) {
    double expected = 0;
    for (int j = 0; j <= k; ++j) expected += L * f * std::pow(kept, j);
    if (k == 30) {
      EXPECT_NEAR(expected, L * f / (1 - kept), 1e-5);
    }
    auto results = exit_radiances(scene, uniform(L), at, n, k, k == 30 ? 16384 : 32768, 7);
    for (const ExitRadiance& r : results) {
      EXPECT_NEAR(r.mean.x, expected, sigmas * std::sqrt(r.variance.x) + tessellation * expected) << k << " bounces";
      EXPECT_LT(std::sqrt(r.variance.x), 0.02 * expected);
    }
  }
}

TEST(PathTracer, LightComesFromWhereTheMapSaysOntoFacesThatFaceIt) {
  // A black body would hide a flip: each of the six faces of a cube, seen head-on, under a light about one axis. The
  // lit face must have irradiance(env, n) a / pi, a closed sum over texels; the other faces of that axis exactly
  // nothing.
  constexpr float a = 0.6f;
  Scene scene;
  add_box(scene, add_material(scene, "grey", Vec3(a)), "cube", Vec3(-1), Vec3(1), 1);
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) {
      Vec3 n(0);
      n[axis] = side;
      // Clear of the equator of n by more than a texel; not round about n.
      Environment env = make_environment("one-sided", 32, 16, [&](Vec3 d) {
        return dot(d, n) > 0.3f ? Vec3(1, 2 + d[(axis + 1) % 3], 3 + d[(axis + 2) % 3]) : Vec3(0);
      });
      Vec3 expected = irradiance(env, n) * a / pi;
      ASSERT_GT(expected.x, 0.3f);
      for (bool lit : {true, false}) {
        // A picture of 1 pixel, narrower than the face.
        auto result = path_trace(scene, env, look(n * (lit ? 5.0f : -5.0f), Vec3(0), 5), picture(1, 4096, 1));
        ASSERT_TRUE(result);
        for (int c = 0; c < 3; ++c) {
          // irradiance() is exact to its own rounding and quadrature, 0.1 %.
          float tolerance = lit ? sigmas * std::sqrt(result->variance[0][c]) + 1e-3f * expected[c] : 0.0f;
          EXPECT_NEAR(result->image.rgb[0][c], lit ? expected[c] : 0.0f, tolerance);
        }
      }
    }
}

TEST(PathTracer, PictureIsUprightAndNotMirrored) {
  // Looking down -Z: +X is right, +Y is up. A small sphere at the upper right, above a map with a bright spot at the
  // lower left.
  Scene scene;
  add_sphere(scene, add_material(scene, "white", Vec3(1)), "ball", {1, 1, -5}, 0.3f, 2);
  const Vec3 spot = normalize(Vec3(-1, -1, -5));
  Environment env =
      make_environment("spot", 256, 128, [&](Vec3 d) { return Vec3(dot(d, spot) > 0.995f ? 1.0f : 0.0f); });
  ReferenceOptions options = picture(40, 4, 0);
  auto covered = path_trace(scene, env, look(Vec3(0), {0, 0, -1}, 60), options);
  options.background = true;
  auto shown = path_trace(scene, env, look(Vec3(0), {0, 0, -1}, 60), options);
  ASSERT_TRUE(covered && shown);
  EXPECT_TRUE(shown->image.alpha.empty());
  // tan(30 degrees) * 5 = 2.887 is half the picture: (1, 1) lies 6.9 pixels from the middle.
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) {
      float alpha = covered->image.alpha[size_t(y * 40 + x)];
      float from_ball = std::hypot(float(x) + 0.5f - 26.93f, float(y) + 0.5f - 13.07f);
      float from_spot = std::hypot(float(x) + 0.5f - 13.07f, float(y) + 0.5f - 26.93f);
      EXPECT_TRUE(from_ball > 1 || alpha == 1);
      EXPECT_TRUE(from_ball < 4 || alpha == 0);
      EXPECT_TRUE(from_spot > 2 || std::abs(shown->image.at(x, y).x - 1) < 1e-5f);
      EXPECT_TRUE(alpha > 0 || covered->image.at(x, y) == Vec3(0));
    }
  EXPECT_EQ(shown->image.at(26, 26), Vec3(0));
  EXPECT_EQ(shown->image.at(13, 13), Vec3(0));
}

TEST(PathTracer, BackgroundIsInterpolated) {
  // A linear ramp over the map stays linear between texel centres: exactly bilinear, far from what texels alone would
  // show.
  Environment env;
  env.image = Image(16, 8);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 16; ++x) env.image.at(x, y) = Vec3(float(x), float(y), 1);
  Scene scene = make_sphere(1e-3f, 0, Vec3(1));
  const Vec3 d = latlong_direction({0.61f, 0.37f});
  ReferenceOptions options = picture(1, 64, 0);
  options.background = true;
  auto result = path_trace(scene, env, look(5.0f * d, 6.0f * d, 0.01f), options);
  ASSERT_TRUE(result);
  constexpr float tolerance = 2e-3f;  // the pixel spans 0.01 degrees, 4e-4 texels
  EXPECT_NEAR(result->image.rgb[0].x, 0.61f * 16 - 0.5f, tolerance);
  EXPECT_NEAR(result->image.rgb[0].y, 0.37f * 8 - 0.5f, tolerance);
}

TEST(PathTracer, TwoSidedSheetReflectsOnTheSideThatIsLit) {
  constexpr float a = 0.5f;
  Scene scene = make_quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 1, 1, Vec3(a));  // faces +Y
  for (Triangle& t : scene.triangles) t.two_sided = true;
  Camera above = look({0, 5, 0.1f}, Vec3(0), 5), below = look({0, -5, 0.1f}, Vec3(0), 5);
  for (float side : {1.0f, -1.0f}) {
    Environment env = make_environment("half", 16, 8, [=](Vec3 d) { return Vec3(d.y * side > 0 ? 1.0f : 0.0f); });
    auto lit = path_trace(scene, env, side > 0 ? above : below, picture(4, 256, 2));
    auto dark = path_trace(scene, env, side > 0 ? below : above, picture(4, 256, 2));
    ASSERT_TRUE(lit && dark);
    for (size_t i = 0; i < 16; ++i) {
      // The map's edge is the sheet's own horizon: all of the hemisphere, irradiance pi.
      EXPECT_NEAR(lit->image.rgb[i].x, a, sigmas * std::sqrt(lit->variance[i].x));
      EXPECT_EQ(dark->image.rgb[i], Vec3(0));
      EXPECT_EQ(dark->image.alpha[i], 1.0f);
    }
  }
}

TEST(PathTracer, OneSidedTriangleFromBehind) {
  // To the camera it is absent, and so is a whole stack of them; what lies behind is seen.
  Scene stack;
  uint32_t white = add_material(stack, "white", Vec3(1));
  for (int i = 0; i < 100; ++i) add_quad(stack, white, "sheet", {-1, 0.01f * float(i), 1}, {2, 0, 0}, {0, 0, -2}, 1, 1);
  Camera below = look({0, -5, 0.1f}, Vec3(0), 5), above = look({0, 5, 0.1f}, Vec3(0), 5);
  auto through = path_trace(stack, uniform(1), below, picture(4, 4, 1));
  ASSERT_TRUE(through);
  for (float alpha : through->image.alpha) EXPECT_EQ(alpha, 0);
  ReferenceOptions options = picture(4, 4, 1);
  options.background = true;
  auto sky = path_trace(stack, uniform(3), below, options);
  ASSERT_TRUE(sky);
  for (Vec3 c : sky->image.rgb) EXPECT_NEAR(c.x, 3, 1e-5f);
  // One of them turned over: it is seen through the 50 others below it.
  std::swap(stack.triangles[100].v[1], stack.triangles[100].v[2]);
  std::swap(stack.triangles[101].v[1], stack.triangles[101].v[2]);
  auto seen = path_trace(stack, uniform(1), below, picture(4, 4, 1));
  ASSERT_TRUE(seen);
  for (float alpha : seen->image.alpha) EXPECT_EQ(alpha, 1);
  EXPECT_EQ(path_trace(stack, uniform(1), above, picture(1, 4, 0))->image.alpha[0], 1);

  // To light it is black and casts shadows: a receiver under the back of a wide white sheet gets only what comes past
  // its rim, with any number of bounces. The rim's elevation is 0.01: sin^2 of it, 1e-4, of the light.
  Scene roof = make_quad({-100, 1, 100}, {200, 0, 0}, {0, 0, -200}, 1, 1, Vec3(1));
  add_quad(roof, 0, "floor", {-100, 0, 100}, {200, 0, 0}, {0, 0, -200}, 1, 1);
  Vec3 direct = exit_radiance(roof, uniform(1), {0, 0.01f, 0}, {0, 1, 0}, 0, 4096, 1);
  Vec3 bounced = exit_radiance(roof, uniform(1), {0, 0.01f, 0}, {0, 1, 0}, 5, 4096, 1);
  EXPECT_LT(direct.x, 1e-3f);
  EXPECT_EQ(bounced, direct);
  // The same roof two-sided hands light on from the floor's rim.
  for (Triangle& t : roof.triangles) t.two_sided = true;
  EXPECT_GT(exit_radiance(roof, uniform(1), {0, 0.01f, 0}, {0, 1, 0}, 5, 4096, 1).x, 1.5f * direct.x);
}

TEST(PathTracer, ShadowsReachTheContact) {
  // A floor under the back of a lid: the camera sees through the lid, the light does not. The gap is 1e-4 of the floor
  // and the lid reaches 10 further than the floor, so what creeps in is 1e-10 of the light: none in any run.
  Scene scene = make_quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 2, 2, Vec3(1));
  add_quad(scene, add_material(scene, "black", Vec3(0)), "lid", {-11, 1e-4f, 11}, {0, 0, -22}, {22, 0, 0}, 1, 1);
  Mat3 R = rotation_from_yaw_pitch_roll({20, 30, 40});
  for (float size : {0.01f, 1.0f, 550.0f}) {
    Scene scaled = scene;
    move(scaled, R * size, Vec3(0));
    for (Vec3& n : scaled.normals) n = normalize(n);
    auto result = path_trace(scaled, uniform(1), look(R * Vec3(0, 3, 0.1f) * size, Vec3(0), 20), picture(16, 16, 3));
    ASSERT_TRUE(result);
    for (size_t i = 0; i < result->image.rgb.size(); ++i) {
      ASSERT_EQ(result->image.rgb[i], Vec3(0));
      ASSERT_EQ(result->image.alpha[i], 1.0f);
    }
  }
}

TEST(PathTracer, ShadingNormalWeighsAndTrueGeometryDecides) {
  // Normals tilted by delta from the plane's: the integral of their cosine over the hemisphere above the plane is
  // pi (1 + cos(delta)) / 2.
  constexpr float a = 0.6f, delta = pi / 3;
  Scene scene = make_quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 1, 1, Vec3(a));
  for (Vec3& n : scene.normals) n = Vec3(std::sin(delta), std::cos(delta), 0);
  const Camera camera = look({-0.1f, 5, 0}, Vec3(0), 5);
  auto result = path_trace(scene, uniform(1), camera, picture(4, 4096, 0));
  ASSERT_TRUE(result);
  for (size_t i = 0; i < 16; ++i)
    EXPECT_NEAR(result->image.rgb[i].x, a * (1 + std::cos(delta)) / 2, sigmas * std::sqrt(result->variance[i].x));
  // Light from below the plane: the shading normals look at some of it, nothing arrives.
  Environment below = make_environment("below", 16, 8, [](Vec3 d) { return Vec3(d.y < 0 ? 1.0f : 0.0f); });
  auto dark = path_trace(scene, below, camera, picture(4, 256, 2));
  ASSERT_TRUE(dark);
  for (Vec3 c : dark->image.rgb) EXPECT_EQ(c, Vec3(0));
}

TEST(PathTracer, NormalsThatPointInwardAreTurned) {
  Scene scene = make_sphere(1, 3, Vec3(0.5f));
  auto expected = path_trace(scene, skewed(), look({0, 0, 4}, Vec3(0)), picture(16, 16, 1));
  for (Vec3& n : scene.normals) n = -n;
  auto turned = path_trace(scene, skewed(), look({0, 0, 4}, Vec3(0)), picture(16, 16, 1));
  ASSERT_TRUE(expected && turned);
  EXPECT_EQ(expected->image.rgb, turned->image.rgb);
}

TEST(PathTracer, ThreadCountDoesNotMatter) {
  // Large enough for a tree that would be built in parallel.
  Scene scene = make_sphere(1, 6, Vec3(0.5f));
  add_quad(scene, 0, "floor", {-5, -1, 5}, {10, 0, 0}, {0, 0, -10}, 4, 4);
  const std::vector<Vec3> at{{0, 1.1f, 0}, {1, -0.9f, 1}}, n{{0, 1, 0}, {0, 1, 0}};
  auto render = [&](int threads) {
    ThreadLimit limit(threads);
    auto result = path_trace(scene, skewed(), look({1, 2, 4}, Vec3(0)), picture(40, 8, 2));
    std::vector<Vec3> all = result ? result->image.rgb : std::vector<Vec3>{};
    if (result) all.insert(all.end(), result->variance.begin(), result->variance.end());
    for (const ExitRadiance& r : exit_radiances(scene, skewed(), at, n, 2, 5000, 1))
      all.insert(all.end(), {r.mean, r.variance});
    return all;
  };
  std::vector<Vec3> one = render(1), two = render(2);
  ASSERT_EQ(one.size(), two.size());
  ASSERT_GT(one.size(), 3000u);
  EXPECT_EQ(std::memcmp(one.data(), two.data(), one.size() * sizeof(Vec3)), 0);
}

TEST(PathTracer, LightAndBrdfSamplingAgree) {
  // Three estimators of the same integrals that share nothing but the ray tracing: each alone, and combined.
  const Scene scene = small_room();
  const Environment env = skewed();
  std::vector<ReferenceImage> images;
  for (Strategy strategy : {Strategy::light_only, Strategy::brdf_only, Strategy::combined}) {
    auto integrator = reference::make_integrator(scene, env, 3, strategy);
    ASSERT_TRUE(integrator);
    ReferenceOptions options = picture(16, 256, 3);
    options.seed = 10 + uint32_t(strategy);
    auto result = reference::render(*integrator, look({0.3f, 0.2f, 4}, {0, -0.2f, 0}), options, nullptr);
    ASSERT_TRUE(result);
    images.push_back(std::move(*result));
  }
  expect_same(images[0], images[1]);
  expect_same(images[0], images[2]);
  // Combining must pay: less noise on the whole than either alone.
  double noise[3] = {};
  for (int s = 0; s < 3; ++s)
    for (Vec3 v : images[size_t(s)].variance) noise[s] += luminance(v);
  EXPECT_LT(noise[2], std::min(noise[0], noise[1]));
}

TEST(PathTracer, LinearInLightsThatGoNegative) {
  const Scene scene = small_room();
  const Environment a = skewed();
  // Its luminance changes sign, is zero in texels whose colour is not, and nearly cancels over the sphere.
  Environment b = make_environment("b", 32, 16, [](Vec3 d) { return Vec3(1 + d.x, 1 + d.y * d.x, 1 + 0.5f * d.z); });
  Environment difference = a;
  for (size_t i = 0; i < difference.image.rgb.size(); ++i) difference.image.rgb[i] -= 1.2f * b.image.rgb[i];
  difference.image.rgb[40] = Vec3(0.7152f, -0.2126f, 0);
  const Camera camera = look({0.3f, 0.2f, 4}, {0, -0.2f, 0});
  std::vector<ReferenceImage> images;
  Environment spot = difference;  // the one texel that was changed by hand
  for (Vec3& c : spot.image.rgb) c = Vec3(0);
  spot.image.rgb[40] = difference.image.rgb[40] - (a.image.rgb[40] - 1.2f * b.image.rgb[40]);
  uint32_t seed = 20;
  for (const Environment* env : std::initializer_list<const Environment*>{&a, &b, &spot, &difference}) {
    ReferenceOptions options = picture(16, 128, 2);
    options.seed = seed++;
    auto result = path_trace(scene, *env, camera, options);
    ASSERT_TRUE(result);
    images.push_back(std::move(*result));
  }
  ReferenceImage sum = images[0];
  float least = 0;
  for (size_t i = 0; i < sum.image.rgb.size(); ++i) {
    sum.image.rgb[i] += -1.2f * images[1].image.rgb[i] + images[2].image.rgb[i];
    sum.variance[i] += 1.44f * images[1].variance[i] + images[2].variance[i];
    least = std::min(least, images[3].image.rgb[i].x);
  }
  EXPECT_LT(least, -0.1f);
  expect_same(sum, images[3]);
}

TEST(PathTracer, ConvergesFasterThanIndependentPaths) {
  // Over seeds, the true squared error of a pixel is well below the variance reported for independent paths.
  const Scene scene = small_room();
  const Environment env = skewed();
  const std::vector<Vec3> at(40, Vec3(0.6f, -0.99f, 0.5f)), n(40, Vec3(0, 1, 0));  // 40 independent repetitions
  auto results = exit_radiances(scene, env, at, n, 1, 256, 3);
  auto truth = exit_radiances(scene, env, {at.data(), 1}, {n.data(), 1}, 1, 65536, 4);
  double squared = 0, reported = 0;
  for (const ExitRadiance& r : results) {
    squared += std::pow(luminance(r.mean) - luminance(truth[0].mean), 2);
    reported += r.variance.y;
  }
  EXPECT_LT(squared, 0.5 * reported);
}

TEST(PathTracer, RefusesAndStops) {
  const Environment env = uniform(1);
  EXPECT_FALSE(path_trace(Scene{}, env, Camera{}, picture(4, 1, 0)));
  Scene scene = make_sphere(1, 1, Vec3(0.5f));
  EXPECT_FALSE(path_trace(scene, Environment{}, Camera{}, picture(4, 1, 0)));
  EXPECT_FALSE(path_trace(scene, env, Camera{}, picture(0, 1, 0)));
  EXPECT_FALSE(path_trace(scene, env, Camera{}, picture(4, 0, 0)));
  EXPECT_FALSE(path_trace(scene, env, Camera{}, picture(4, 1, 65)));
  auto once = path_trace(scene, env, Camera{}, picture(4, 1, 0));
  ASSERT_TRUE(once);
  EXPECT_EQ(once->variance[0].x, INFINITY);
  double last = -1;
  Progress progress([&](const std::string& stage, double fraction) {
    EXPECT_EQ(stage, "path tracing");
    EXPECT_GE(fraction, last);
    last = fraction;
    if (fraction > 0.3) progress.cancel();
  });
  auto stopped = path_trace(scene, env, Camera{}, picture(64, 64, 1), &progress);
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().text(), "cancelled");
}

TEST(PathTracer, BlackEnvironmentGivesBlack) {
  auto result = path_trace(make_sphere(1, 1, Vec3(0.5f)), uniform(0), Camera{}, picture(8, 4, 2));
  ASSERT_TRUE(result);
  for (Vec3 c : result->image.rgb) EXPECT_EQ(c, Vec3(0));
}

}  // namespace
}  // namespace lambent

// The path tracer with every model of reflection.
#include <lambent/brdf/measured.h>
#include <lambent/reference/integrator.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>
#include <reference_checks.h>

namespace lambent {
namespace {

using reference::Strategy;
using test::sigmas;

struct Named {
  const char* name;
  Brdf brdf;
};
std::vector<Named> models() {
  auto table = std::make_shared<MeasuredTable>();
  table->theta_h = 30, table->theta_d = 4, table->phi_d = 6;
  for (int h = 0; h < 30; ++h)
    for (int d = 0; d < 4; ++d)
      for (int p = 0; p < 6; ++p) {
        const HalfDifference a = cell_angles(*table, h, d, p);
        table->f.push_back(Vec3(0.1f, 0.05f, 0.02f) +
                           (0.5f + 0.1f * std::sin(2 * a.phi_d)) * std::exp(-12 * a.theta_h * a.theta_h));
      }
  prepare_sampling(*table);
  return {{"Lambert", Lambert{Vec3(0.8f, 0.5f, 0.1f)}},
          {"Phong", Phong{Vec3(0.2f, 0.1f, 0.05f), Vec3(0.7f), 30}},
          {"GGX", Ggx{Vec3(0.9f, 0.7f, 0.4f), Vec2(0.4f, 0.1f)}},
          {"Cook-Torrance", CookTorrance{Vec3(0.1f), Vec3(0.8f), Vec3(0.6f, 0.3f, 0.1f), 0.25f}},
          {"Ward", Ward{Vec3(0.1f, 0.2f, 0.1f), Vec3(0.6f), Vec2(0.15f, 0.4f)}},
          {"plastic", MetallicRoughness{Vec3(0.7f, 0.2f, 0.1f), 0, 0.4f}},
          {"metal", MetallicRoughness{Vec3(0.9f, 0.6f, 0.3f), 1, 0.4f}},
          {"measured", Measured{table}}};
}

// A sheet in the plane y = 0 whose texture coordinate u grows along `tangent`.
Scene sheet(Vec3 tangent) {
  Scene s = make_quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 1, 1, Vec3(0.5f));
  for (Vec3 p : s.positions) s.texcoords[0].push_back({dot(p, tangent), dot(p, cross(Vec3(0, 1, 0), tangent))});
  return s;
}

// Radiance that leaves the sheet towards wo (world), by summing over the map's texels, each divided.
Vec3d radiance_by_quadrature(const Brdf& brdf, const Mat3& frame, const Environment& env, Vec3 wo) {
  constexpr int fine = 24;
  const int width = env.image.width * fine, height = env.image.height * fine;
  Vec3d sum(0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Vec3 d = texel_direction(x, y, width, height), wi = d * frame;
      if (wi.z <= 0) continue;
      const Vec3 f = evaluate(brdf, wi, wo * frame);
      sum += Vec3d(f * env.image.at(x / fine, y / fine)) * (double(wi.z) * texel_solid_angle(y, width, height));
    }
  return sum;
}

TEST(ReferenceReflection, SheetAgreesWithQuadrature) {
  // An asymmetric light, a skew tangent, an eye aslant: wrong frames, signs or weights all show. Quadrature: 2e-3 for
  // these lobes.
  constexpr double quadrature = 2e-3;
  const Environment env = test::skewed_environment();
  const Vec3 tangent = normalize(Vec3(2, 0, -1));
  const Mat3 frame(tangent, cross(Vec3(0, 1, 0), tangent), Vec3(0, 1, 0));
  const Vec3 eye = 5.0f * normalize(Vec3(-1, 1.2f, 0.8f));
  const Scene scene = sheet(tangent);
  for (const auto& [name, brdf] : models()) {
    ReferenceOptions options = test::small_picture(1, 16384, 1);
    options.reflection.everywhere = brdf;
    auto result = path_trace(scene, env, test::look(eye, Vec3(0), 0.05f), options);
    ASSERT_TRUE(result);
    const Vec3d expected = radiance_by_quadrature(brdf, frame, env, normalize(eye));
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(result->image.rgb[0][c], expected[c],
                  sigmas * std::sqrt(result->variance[0][c]) + quadrature * expected[c])
          << name;
  }
}

TEST(ReferenceReflection, TangentMatters) {
  // Light from where h would be tilted by 20 degrees, square to the plane of the eye and the normal. With the tangent
  // turned by a right angle the lobe lies across or along that tilt: anisotropic models look very different, others the
  // same but for noise (below 1 %).
  const Vec3 spot = reflect(normalize(Vec3(3, -3, 0)), Vec3(0, std::cos(0.35f), std::sin(0.35f)));
  const Environment env =
      make_environment("spot", 64, 32, [&](Vec3 d) { return Vec3(std::exp(40 * (dot(d, spot) - 1))); });
  for (const auto& [name, brdf] : models()) {
    const bool anisotropic = std::string(name) == "GGX" || std::string(name) == "Ward";
    Vec3 seen[2];
    for (int i = 0; i < 2; ++i) {
      ReferenceOptions options = test::small_picture(1, 8192, 0);
      options.reflection.everywhere = brdf;
      auto result =
          path_trace(sheet(i ? Vec3(0, 0, -1) : Vec3(1, 0, 0)), env, test::look({-3, 3, 0}, Vec3(0), 0.05f), options);
      ASSERT_TRUE(result);
      seen[i] = result->image.rgb[0];
    }
    const float ratio = seen[1].x / seen[0].x, difference = std::max(ratio, 1 / ratio) - 1;
    if (anisotropic) {
      EXPECT_GT(difference, 0.5f) << name;
    } else {
      EXPECT_LT(difference, 0.02f) << name;
    }
  }
}

TEST(ReferenceReflection, LightAndBrdfSamplingAgree) {
  // Light reaches the ball over the floor and back; each model on everything.
  Scene scene = make_quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, 1, 1, Vec3(0.5f));
  add_sphere(scene, 0, "ball", {0.1f, 0.7f, 0.2f}, 0.6f, 3);
  const Environment env = test::skewed_environment();
  for (const auto& [name, brdf] : models()) {
    SCOPED_TRACE(name);
    Reflection reflection;
    reflection.everywhere = brdf;
    std::vector<ReferenceImage> images;
    double noise[3] = {};
    for (Strategy strategy : {Strategy::light_only, Strategy::brdf_only, Strategy::combined}) {
      auto integrator = reference::make_integrator(scene, env, 2, strategy, reflection);
      ASSERT_TRUE(integrator);
      ReferenceOptions options = test::small_picture(8, 512, 2);
      options.seed = 10 + uint32_t(strategy);
      auto result = reference::render(*integrator, test::look({0.5f, 2, 4}, {0, 0.4f, 0}), options, nullptr);
      ASSERT_TRUE(result);
      for (Vec3 v : result->variance) noise[images.size()] += double(luminance(v));
      images.push_back(std::move(*result));
    }
    test::expect_same(images[0], images[1]);
    test::expect_same(images[0], images[2]);
    // Combining is never much worse than the better of the two.
    EXPECT_LT(noise[2], 1.2 * std::min(noise[0], noise[1]));
  }
}

TEST(ReferenceReflection, MaterialsOfTheScene) {
  // A sheet looks as if its material were the model everywhere; and diffuse, of its base colour, is the default.
  const Environment env = test::skewed_environment();
  Scene scene = sheet({1, 0, 0});
  scene.materials[0].metallic = 1, scene.materials[0].roughness = 0.4f,
  scene.materials[0].base_color = {0.9f, 0.6f, 0.3f};
  const Camera camera = test::look({-3, 3, 1}, Vec3(0), 0.05f);
  ReferenceOptions options = test::small_picture(1, 256, 1);
  auto diffuse = path_trace(scene, env, camera, options);
  options.reflection.everywhere = Lambert{{0.9f, 0.6f, 0.3f}};
  auto lambert = path_trace(scene, env, camera, options);
  options.reflection = {};
  options.reflection.model = Reflection::Model::materials;
  auto materials = path_trace(scene, env, camera, options);
  options.reflection = {};
  options.reflection.everywhere = MetallicRoughness{{0.9f, 0.6f, 0.3f}, 1, 0.4f};
  auto metal = path_trace(scene, env, camera, options);
  ASSERT_TRUE(diffuse && lambert && materials && metal);
  EXPECT_EQ(diffuse->image.rgb, lambert->image.rgb);
  EXPECT_EQ(materials->image.rgb, metal->image.rgb);
  EXPECT_NE(materials->image.rgb, diffuse->image.rgb);
}

TEST(ReferenceReflection, BallInUniformLight) {
  SKIP_UNDER_SANITIZERS();
  // It shows the albedo towards the eye of what it is made of: what light-only sampling, which never draws from the
  // BRDF, says of each pixel, BRDF-only sampling must say too; and nothing shines brighter than the light, but for
  // glTF's grazing gain of 2 %.
  const Scene scene = make_sphere(1, 5, Vec3(0.5f));
  const Environment env = test::uniform_environment(1);
  for (const auto& [name, brdf] : models()) {
    Reflection reflection;
    reflection.everywhere = brdf;
    std::vector<ReferenceImage> images;
    for (Strategy strategy : {Strategy::light_only, Strategy::brdf_only}) {
      auto integrator = reference::make_integrator(scene, env, 1, strategy, reflection);
      ASSERT_TRUE(integrator);
      ReferenceOptions options = test::small_picture(6, 1024, 1);
      options.seed = 3 + uint32_t(strategy);
      auto result = reference::render(*integrator, test::look({1, 2, 3}, Vec3(0), 20), options, nullptr);
      ASSERT_TRUE(result);
      images.push_back(std::move(*result));
    }
    SCOPED_TRACE(name);
    test::expect_same(images[0], images[1]);
    for (Vec3 c : images[1].image.rgb) EXPECT_LE(std::max({c.x, c.y, c.z}), 1.02f);
  }
}

}  // namespace
}  // namespace lambent

// All-frequency light as a whole, bake to picture, against the path tracer, which shares no transport code with it.
#include <lambent/bake/visibility.h>
#include <lambent/image/compare.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/render/products.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A ball over a fine floor.
Scene ball_on_floor(int cells, int levels) {
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.6f, 0.5f, 0.4f));
  add_quad(scene, m, "floor", Vec3(-1.2f, 0, 1.2f), Vec3(2.4f, 0, 0), Vec3(0, 0, -2.4f), cells, cells);
  add_sphere(scene, m, "ball", Vec3(0, 0.7f, 0), 0.5f, levels);
  return scene;
}

// A sky and a sun of half a degree, off every axis.
Environment sun_and_sky() {
  Environment env = make_environment(
      "sun", 720, 360, [](Vec3 d) { return Vec3(0.25f + 0.15f * d.y, 0.3f + 0.15f * d.y, 0.4f + 0.1f * d.y); });
  env.image.at(430, 95) = Vec3(30000, 27000, 22000);  // irradiance of about 2
  return env;
}

Camera camera_at_the_side() {
  Camera c;
  c.eye = {2.2f, 2.4f, 3.2f}, c.target = {0, 0.3f, 0}, c.fov = 38;
  return c;
}

struct Pictures {
  Image blocks, standard;
  Breakdown breakdown;
  size_t seen = 0, receivers = 0;
};

Pictures draw(const Scene& scene, const Environment& env, const Reflection& reflection, VisibilityOptions bake,
              int size) {
  const auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const Visibility visibility = *bake_visibility(*tracer, receivers, bake);
  BlockLight light;
  set_light(light, cube_light(env, bake.size));
  const ProductReceivers products =
      make_product_receivers(scene, receivers.front, receivers.back, receivers.count(), reflection, *light.cube, {});
  const Camera camera = camera_at_the_side();
  const std::vector<uint32_t> seen =
      seen_receivers(scene, receivers.front, receivers.back, receivers.count(), camera, size, size);
  Pictures out;
  out.seen = seen.size(), out.receivers = receivers.count();
  const RenderOptions options{.width = size, .height = size, .samples = 16, .show = RenderOptions::Show::radiosity};
  Relit relit;
  shade_receivers(Product::blocks, light, nullptr, visibility, products, seen, camera.eye, relit, &out.breakdown);
  out.blocks = *render(scene, *tracer, receivers.basis, relit, camera, options);
  shade_receivers(Product::standard, light, nullptr, visibility, products, seen, camera.eye, relit);
  out.standard = *render(scene, *tracer, receivers.basis, relit, camera, options);
  return out;
}

double psnr_of(const Image& a, const Image& b) {
  double peak = 0, sum = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c)
      peak = std::max(peak, double(b.rgb[i][c])), sum += std::pow(double(a.rgb[i][c]) - double(b.rgb[i][c]), 2);
  return 10 * std::log10(peak * peak * 3 * double(a.rgb.size()) / std::max(sum, 1e-30));
}

TEST(ProductPictures, SharpShadowsAreThoseOfThePathTracer) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = ball_on_floor(60, 3);
  const Environment env = sun_and_sky();
  for (const Brdf& brdf : {Brdf(Lambert{Vec3(0.6f, 0.5f, 0.4f)}), Brdf(Phong{Vec3(0.4f), Vec3(0.3f), 30})}) {
    Reflection reflection;
    reflection.everywhere = brdf;
    const Pictures p = draw(scene, env, reflection, {.size = 64, .bits = 6}, 64);
    const auto truth = path_trace(
        scene, env, camera_at_the_side(),
        {.width = 64, .height = 64, .spp = 128, .bounces = 0, .background = false, .reflection = reflection});
    ASSERT_TRUE(truth);
    std::printf("blocks against standard %.1f dB, standard against path tracer %.1f dB\n",
                psnr_of(p.blocks, p.standard), psnr_of(p.standard, truth->image));
    EXPECT_GT(psnr_of(p.blocks, p.standard), 50);
    EXPECT_GT(psnr_of(p.standard, truth->image), 35);
    EXPECT_LT(p.seen, p.receivers);
  }
}

// Whatever is drawn has been shaded: nothing else is left black.
TEST(ProductPictures, WhatIsSeenIsShaded) {
  const Scene scene = ball_on_floor(20, 3);
  const Receivers receivers = make_vertex_receivers(scene);
  const auto tracer = Tracer::build(scene);
  Camera camera = camera_at_the_side();
  for (float fov : {5.0f, 38.0f, 120.0f}) {
    camera.fov = fov;
    const std::vector<uint32_t> seen =
        seen_receivers(scene, receivers.front, receivers.back, receivers.count(), camera, 90, 60);
    const auto& corners = std::get<CornerReceivers>(receivers.basis);
    const CameraRays rays(camera, 90, 60);
    size_t hits = 0;
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 90; ++x) {
        const Hit hit = tracer->closest(rays.eye, rays.direction(float(x) + 0.5f, float(y) + 0.5f));
        if (hit.triangle == none) continue;
        const Corners* at = corners.find(hit.triangle, hit.front);
        if (!at) continue;
        ++hits;
        for (uint32_t r : at->receiver) EXPECT_TRUE(std::binary_search(seen.begin(), seen.end(), r));
      }
    EXPECT_GT(hits, 50u);
    EXPECT_LT(seen.size(), receivers.count() * (fov < 10 ? 0.3 : 1.0));
  }
}

}  // namespace
}  // namespace lambent

// What lobes are for: a bumpy sheet, baked flat and bent, against the bake of the bent sheet itself.
#include <lambent/bake/bake.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/relight/zonal.h>
#include <lambent/scene/pose.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Scene bumpy_sheet() {
  constexpr int n = 48;
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
  auto height = [](float x, float z) { return 0.07f * std::sin(11 * x + 2 * z) * std::cos(9 * z - x); };
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const float x = 2 * float(i) / n - 1, z = 2 * float(j) / n - 1, e = 1e-3f;
      positions.push_back({x, height(x, z), z});
      normals.push_back(glm::normalize(Vec3(height(x - e, z) - height(x + e, z), 2 * e, height(x, z - e) - height(x, z + e))));
    }
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t j = 0; j < n; ++j) {
      const uint32_t a = i * (n + 1) + j, b = a + 1, c = a + n + 1, d = c + 1;
      for (uint32_t k : {a, b, c, c, b, d}) indices.push_back(k);
    }
  Scene scene;
  add_mesh(scene, add_material(scene, "chalk", Vec3(0.6f)), "sheet", positions, normals, indices);
  return scene;
}

Transfer baked(const Scene& scene, const Receivers& receivers) {
  auto tracer = Tracer::build(scene);
  BakeOptions options;
  options.samples = 256, options.bounces = 1, options.precision = Precision::single;
  return *bake(scene, *tracer, receivers, options);
}

TEST(ZonalDeform, LobesFollowTheSheetThatHarmonicsDoNot) {
  const Scene flat = bumpy_sheet();
  ASSERT_GT(area_normal(flat, flat.triangles[0]).y, 0);
  const Receivers receivers = make_vertex_receivers(flat);
  const Transfer still = baked(flat, receivers);
  auto lobes = fit_zonal(still, {});
  ASSERT_TRUE(lobes);
  std::vector<Vec3> light(36);
  for (size_t k = 0; k < 36; ++k) light[k] = Vec3(std::sin(float(k) * 1.7f) / float(1 + k / 6));  // from nowhere in particular
  light[0] = Vec3(2.0f);

  for (const char* text : {"bend:-120,x,y", "twist:100,x"}) {
    const Pose pose = deform_scene(flat, *parse_deformation(text));
    const Scene bent = posed(flat, pose);
    const Receivers bent_receivers = make_vertex_receivers(bent);
    Relit truth, turned, unturned;
    relight(baked(bent, bent_receivers), light, truth);
    relight(still, light, unturned);
    std::vector<Mat3> rotations(receivers.count());
    for (size_t v = 0; v < flat.positions.size(); ++v) rotations[receivers.front[v]] = pose.rotations[v];
    const ReceiverFrames frames = make_receiver_frames(rotations);
    relight_zonal(*lobes, &frames, light, turned);
    double with = 0, without = 0, total = 0;
    for (size_t v = 0; v < flat.positions.size(); ++v) {
      if (std::max(std::abs(flat.positions[v].x), std::abs(flat.positions[v].z)) > 0.95f) continue;  // a border sees past the sheet's end
      const float t = truth.at(bent_receivers.front[v]).x;
      with += std::pow(turned.at(receivers.front[v]).x - t, 2), without += std::pow(unturned.at(receivers.front[v]).x - t, 2), total += t * t;
    }
    // What is left is that bumps open where the sheet is convex, that twisting shears them, and what the sheet hides from itself.
    EXPECT_LT(std::sqrt(with / total), 0.16) << text;
    EXPECT_LT(std::sqrt(with), 0.35 * std::sqrt(without)) << text;
    RecordProperty("turned", std::to_string(std::sqrt(with / total))), RecordProperty("unturned", std::to_string(std::sqrt(without / total)));
    std::printf("%s: %.4f turned, %.4f as baked\n", text, std::sqrt(with / total), std::sqrt(without / total));
  }
}

}  // namespace
}  // namespace lambent

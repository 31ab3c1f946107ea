// What lobes are for: a bumpy sheet, baked flat and bent, against the bake of the bent sheet itself.
#include <lambent/bake/bake.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/relight/zonal.h>
#include <lambent/scene/pose.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

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
      normals.push_back(
          normalize(Vec3(height(x - e, z) - height(x + e, z), 2 * e, height(x, z - e) - height(x, z + e))));
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
  for (size_t k = 0; k < 36; ++k)
    light[k] = Vec3(std::sin(float(k) * 1.7f) / float(1 + k / 6));  // from nowhere in particular
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
      if (std::max(std::abs(flat.positions[v].x), std::abs(flat.positions[v].z)) > 0.95f)
        continue;  // a border sees past the sheet's end
      const float t = truth.at(bent_receivers.front[v]).x;
      with += std::pow(turned.at(receivers.front[v]).x - t, 2),
          without += std::pow(unturned.at(receivers.front[v]).x - t, 2), total += t * t;
    }
    // What is left is that bumps open where the sheet is convex, that twisting shears them, and what the sheet hides
    // from itself.
    EXPECT_LT(std::sqrt(with / total), 0.16) << text;
    EXPECT_LT(std::sqrt(with), 0.35 * std::sqrt(without)) << text;
    RecordProperty("turned", std::to_string(std::sqrt(with / total))),
        RecordProperty("unturned", std::to_string(std::sqrt(without / total)));
    std::printf("%s: %.4f turned, %.4f as baked\n", text, std::sqrt(with / total), std::sqrt(without / total));
  }
}

// The same of a glossy sheet, by eq. 16: three rows of the BRDF's singular values, three lobes each, fourth-order
// light, as in the paper's Fig. 4; radiance towards a fixed eye. The truth is the matrix of the bent sheet itself with
// all its rows.
TEST(ZonalDeform, LobesOfAMatrixFollowTheGlossySheet) {
  SKIP_UNDER_SANITIZERS();
  const Scene flat = bumpy_sheet();
  const CookTorrance metal{.diffuse = Vec3(0.2f), .specular = Vec3(0.8f), .f0 = Vec3(0.5f), .m = 0.3f};
  const LinearMaterial material{metal, metal};
  const BakeOptions options{.order = 4, .samples = 256, .bounces = 0, .precision = Precision::single};
  auto bake_of = [&](const Scene& scene, const Receivers& receivers, OutgoingKind kind, int rows) {
    ReceiverMaterials m;
    m.materials = {material}, m.of_receiver.assign(receivers.count(), 0);
    for (const Vec3& n : receivers.normals) m.frames.push_back(frame_about(n));
    MatrixOptions matrix;
    matrix.outgoing = kind, matrix.svd_rows = rows, matrix.grid = 32;
    auto tracer = Tracer::build(scene);
    return std::move(*bake_matrix(scene, *tracer, receivers, m, options, matrix));
  };
  const Receivers receivers = make_vertex_receivers(flat);
  const MatrixBake still = bake_of(flat, receivers, OutgoingKind::svd, 3);
  ASSERT_EQ(still.transfer.rows, 3);
  ZonalFitReport report;
  auto lobes = fit_zonal(still.transfer, {.lobes = 3, .row_weights = row_weights(still.outgoing)}, &report);
  ASSERT_TRUE(lobes);
  std::vector<Vec3> light(16);
  for (size_t k = 0; k < 16; ++k) light[k] = Vec3(std::sin(float(k) * 1.7f) / float(1 + k / 6));
  light[0] = Vec3(2.0f);

  for (const char* text : {"bend:-120,x,y", "twist:100,x"}) {
    const Pose pose = deform_scene(flat, *parse_deformation(text));
    const Scene bent = posed(flat, pose);
    const Receivers bent_receivers = make_vertex_receivers(bent);
    const MatrixBake rows_of_bent = bake_of(bent, bent_receivers, OutgoingKind::svd, 3);
    const MatrixBake of_bent = bake_of(bent, bent_receivers, OutgoingKind::map, 3);
    std::vector<Mat3> rotations(receivers.count());
    for (size_t v = 0; v < flat.positions.size(); ++v) rotations[receivers.front[v]] = pose.rotations[v];
    const ReceiverFrames frames = make_receiver_frames(rotations);
    const Outgoing outgoing = turn_outgoing(still.outgoing, rotations);
    Relit truth, truth_rows, turned_rows, unturned_rows;
    relight(rows_of_bent.transfer, light, truth_rows);
    relight(of_bent.transfer, light, truth);
    relight_zonal(*lobes, &frames, light, turned_rows);
    relight(still.transfer, light, unturned_rows);
    double with = 0, without = 0, rows_alone = 0, moved = 0, total = 0;
    std::vector<ViewWeights> all(size_t(truth.rows)), three(3);
    for (size_t v = 0; v < flat.positions.size(); ++v) {
      if (std::max(std::abs(flat.positions[v].x), std::abs(flat.positions[v].z)) > 0.95f) continue;
      const uint32_t there = bent_receivers.front[v], here = receivers.front[v];
      const Vec3 view = normalize(Vec3(0.5f, 6, 1) - bent.positions[v]);
      if (dot(view, bent_receivers.normals[there]) < 0.2f) continue;
      auto radiance = [&](const Outgoing& o, uint32_t r, std::vector<ViewWeights>& w, const Relit& rows) {
        evaluate_outgoing(o, r, view, w);
        return reflect_rows(w, Vec3(1), [&](size_t row) { return rows.at(r, int(row)); }).x;
      };
      const float t = radiance(of_bent.outgoing, there, all, truth);
      const float ours = radiance(outgoing, here, three, turned_rows),
                  rows = radiance(rows_of_bent.outgoing, there, three, truth_rows);
      with += std::pow(ours - t, 2), rows_alone += std::pow(rows - t, 2), moved += std::pow(ours - rows, 2);
      without += std::pow(radiance(still.outgoing, here, three, unturned_rows) - t, 2), total += t * t;
    }
    std::printf("%s: %.4f turned, %.4f as baked; of it three rows alone %.4f, turning alone %.4f, lobes alone %.4f\n",
                text, std::sqrt(with / total), std::sqrt(without / total), std::sqrt(rows_alone / total),
                std::sqrt(moved / total), report.rms);
    EXPECT_LT(std::sqrt(moved / total), 0.16) << text;
    EXPECT_LT(std::sqrt(with), 0.4 * std::sqrt(without)) << text;
  }
}

}  // namespace
}  // namespace lambent

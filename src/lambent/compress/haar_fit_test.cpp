// Transfer in Haar wavelets against sums over texels.
#include <lambent/bake/visibility.h>
#include <lambent/compress/haar_fit.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/sky.h>
#include <lambent/relight/relight_haar.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

// A floor under a ball, seen on a cube of 16 texels a side.
struct BallOverFloor {
  Scene scene;
  Receivers receivers;
  Visibility visibility;
  CubeLight light;
  BallOverFloor() {
    add_quad(scene, add_material(scene, "floor", Vec3(0.5f)), "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 9,
             9);
    add_sphere(scene, add_material(scene, "ball", Vec3(0.5f)), "ball", Vec3(0.1f, 0.7f, 0), 0.4f, 1);
    auto tracer = Tracer::build(scene);
    receivers = make_vertex_receivers(scene);
    visibility = *bake_visibility(*tracer, receivers, {.size = 16});
    light = cube_light(*make_sky(*parse_sky("elevation=40,azimuth=30,turbidity=3")), 16);
  }
};
const BallOverFloor& the_floor() {
  static const BallOverFloor floor;
  return floor;
}

// The standard basis: every texel.
std::vector<Vec3> by_texels(const BallOverFloor& s) {
  const Cube cube = make_cube(16);
  std::vector<uint8_t> levels(cube.count());
  std::vector<Vec3> out;
  for (size_t r = 0; r < s.receivers.count(); ++r) {
    decode_visibility(s.visibility, r, levels);
    Vec3d sum(0.0);
    for (size_t t = 0; t < cube.count(); ++t)
      if (levels[t])
        sum += Vec3d(s.light.energy[t]) *
               double(std::max(0.0f, dot(s.receivers.normals[r], cube.texels.at(t))) / std::numbers::pi_v<float>);
    out.emplace_back(sum);
  }
  return out;
}

double relative_error(const HaarTransfer& t, const BallOverFloor& s, size_t terms) {
  const std::vector<Vec3> truth = by_texels(s);
  Relit relit;
  relight(t, haar_terms(t, haar_column_norms(t), s.light, terms), relit);
  double error = 0, all = 0;
  for (size_t r = 0; r < truth.size(); ++r) {
    const Vec3 d = relit.at(r) - truth[r];
    error += double(dot(d, d)), all += double(dot(truth[r], truth[r]));
  }
  return std::sqrt(error / all);
}

TEST(HaarTransfer, RowsAreTheTransformOfWhatIsSeen) {
  const BallOverFloor& s = the_floor();
  const std::vector<Vec3> truth = by_texels(s);
  for (size_t r = 0; r < s.receivers.count(); r += 11) {
    const std::vector<float> row = haar_row(s.visibility, r, s.receivers.normals[r]);
    // All coefficients of one receiver, whose columns' steps are its own: exact to a 127th of itself at worst, 0 here.
    std::vector<HaarEntry> entries;
    for (uint32_t c = 0; c < row.size(); ++c)
      if (row[c] != 0) entries.push_back({c, row[c]});
    const std::vector<std::vector<HaarEntry>> rows{entries};
    const HaarTransfer t = make_haar_transfer(16, rows);
    Relit relit;
    relight(t, haar_terms(t, haar_column_norms(t), s.light, 0), relit);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(relit.at(0)[c], truth[r][c], 2e-5f * truth[r][c] + 1e-6f);
  }
}

TEST(HaarTransfer, AllTermsAreTheStandardBasisToRounding) {
  const BallOverFloor& s = the_floor();
  HaarFitReport report;
  auto t = fit_haar(s.visibility, s.receivers.normals, {.error = 0}, &report);
  ASSERT_TRUE(t) << t.error().text();
  EXPECT_TRUE(check_haar(*t, "it"));
  EXPECT_LT(report.error, 0.01);  // eight bits
  EXPECT_LT(relative_error(*t, s, 0), 0.01);
}

TEST(HaarTransfer, TheStatedErrorHoldsAndTermsConverge) {
  const BallOverFloor& s = the_floor();
  HaarFitReport report;
  auto t = fit_haar(s.visibility, s.receivers.normals, {.error = 0.05}, &report);
  ASSERT_TRUE(t);
  EXPECT_LT(report.error, 0.055);
  EXPECT_GT(report.error, 0.03);
  auto tenth = fit_haar(s.visibility, s.receivers.normals, {.keep = 0.1}, &report);
  ASSERT_TRUE(tenth);
  EXPECT_LE(report.entries, 0.1 * 6 * 256 + 1);
  const double few = relative_error(*t, s, 8), more = relative_error(*t, s, 64), all = relative_error(*t, s, 0);
  EXPECT_LT(more, few);
  EXPECT_LT(more, 0.06);
  EXPECT_LT(all, 0.05);
}

TEST(HaarTransfer, ReadsTheColumnsThatTheLightWakesAlone) {
  const BallOverFloor& s = the_floor();
  auto t = fit_haar(s.visibility, s.receivers.normals, {});
  ASSERT_TRUE(t);
  const HaarTerms terms = haar_terms(*t, haar_column_norms(*t), s.light, 20);
  ASSERT_EQ(terms.columns.size(), 20u);
  size_t read = 0, due = 0, all = 0;
  Relit relit;
  relight(*t, terms, relit, &read);
  for (size_t chunk = 0; chunk < t->chunks(); ++chunk) {
    for (uint32_t c : terms.columns) due += t->column(chunk, c).size();
    all += t->data[chunk].size();
  }
  EXPECT_EQ(read, due);
  EXPECT_LT(read, all / 4);
}

TEST(HaarTransfer, SparseColumnsOfManyChunksKeepTheirPlaces) {
  // One entry every 700 receivers, in a column of each chunk, and one at the very last.
  std::vector<std::vector<HaarEntry>> rows(2 * haar_chunk + 5);
  for (size_t r = 0; r < rows.size(); r += 700) rows[r].push_back({7, 0.5f + float(r % 3)});
  rows.back().push_back({9, -1.0f});
  const HaarTransfer t = make_haar_transfer(4, rows);
  ASSERT_TRUE(check_haar(t, "it"));
  Relit relit;
  relight(t, {{7, 9}, {Vec3(t.steps[7], 0, 0), Vec3(0, t.steps[9], 0)}}, relit);
  for (size_t r = 0; r < rows.size(); ++r) {
    EXPECT_NEAR(relit.at(r).x, r % 700 == 0 ? 0.5f + float(r % 3) : 0.0f, 0.02f) << r;
    EXPECT_NEAR(relit.at(r).y, r + 1 == rows.size() ? -1.0f : 0.0f, 1e-5f) << r;
  }
}

TEST(HaarTransfer, ColumnsThatLieAreRefused) {
  std::vector<std::vector<HaarEntry>> rows(300);
  rows[290].push_back({3, 1.0f});
  const HaarTransfer good = make_haar_transfer(4, rows);
  ASSERT_TRUE(check_haar(good, "it"));
  const auto refused = [&](auto change, const std::string& part) {
    HaarTransfer bad = good;
    change(bad);
    const auto ok = check_haar(bad, "it");
    ASSERT_FALSE(ok) << part;
    EXPECT_NE(ok.error().text().find(part), std::string::npos) << ok.error().text();
  };
  refused([](HaarTransfer& t) { t.size = 5; }, "power of two");
  refused([](HaarTransfer& t) { t.steps.pop_back(); }, "numbers of columns");
  refused([](HaarTransfer& t) { t.steps[3] = NAN; }, "step");
  refused([](HaarTransfer& t) { t.begin[3] = 99; }, "follow");
  refused([](HaarTransfer& t) { t.data[0].push_back(1), t.begin.back() += 1; }, "within a pair");
  refused([](HaarTransfer& t) { t.data[0][0] = 0; }, "stays");
  refused([](HaarTransfer& t) { t.data[0].back() = 128; }, "beyond");
  refused([](HaarTransfer& t) { t.receivers = 290; }, "beyond");
}

}  // namespace
}  // namespace lambent

// Transfer in Haar wavelets against sums over texels.
#include <lambent/bake/visibility.h>
#include <lambent/basis/haar.h>
#include <lambent/compress/haar_fit.h>
#include <lambent/compress/haar_rows.h>
#include <lambent/core/random.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/sky.h>
#include <lambent/relight/relight_haar.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <algorithm>
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
  HaarReading reading;
  Relit relit, spoilt;
  relight(*t, terms, relit, &reading);
  EXPECT_EQ(reading.terms, 20u);
  EXPECT_LT(reading.bytes, t->data.size() / 4);
  // Whatever stands in the others makes no difference.
  std::vector<uint8_t> bytes(t->data.begin(), t->data.end());
  size_t kept = 0;
  for (size_t c = 0; c < t->columns(); ++c) {
    const bool woken = std::binary_search(terms.columns.begin(), terms.columns.end(), uint32_t(c));
    const size_t at = size_t(t->column(0, c).data() - t->data.data()), count = t->column(0, c).size();
    if (woken) kept += count;
    else std::fill_n(bytes.begin() + ptrdiff_t(at), count, uint8_t(0xa5));
  }
  HaarTransfer other = *t;
  other.data = bytes;
  relight(other, terms, spoilt);
  EXPECT_EQ(reading.bytes, kept);
  EXPECT_TRUE(std::equal(relit.values.begin(), relit.values.end(), spoilt.values.begin()));
}

TEST(HaarTransfer, SparseAndWholeTilesOfManyChunksKeepTheirPlaces) {
  // One entry every 700 receivers, in a column of each chunk; one at the very last; and a column of two of three.
  std::vector<std::vector<HaarEntry>> rows(2 * haar_chunk + 5);
  const auto dense = [](size_t r) { return r % 3 ? 0.25f + float(r % 7) : 0.0f; };
  for (size_t r = 0; r < rows.size(); ++r) {
    if (r % 700 == 0) rows[r].push_back({7, 0.5f + float(r % 3)});
    if (r + 1 == rows.size()) rows[r].push_back({9, -1.0f});
    if (dense(r) != 0) rows[r].push_back({11, dense(r)});
  }
  const HaarTransfer t = make_haar_transfer(4, rows);
  ASSERT_TRUE(check_haar(t, "it"));
  size_t entries = 0;
  for (const auto& row : rows) entries += row.size();
  EXPECT_EQ(t.entries(), entries);
  Relit relit;
  relight(t, {{7, 9, 11}, {Vec3(t.steps[7], 0, 0), Vec3(0, t.steps[9], 0), Vec3(0, 0, t.steps[11])}}, relit);
  for (size_t r = 0; r < rows.size(); ++r) {
    EXPECT_NEAR(relit.at(r).x, r % 700 == 0 ? 0.5f + float(r % 3) : 0.0f, 0.02f) << r;
    EXPECT_NEAR(relit.at(r).y, r + 1 == rows.size() ? -1.0f : 0.0f, 1e-5f) << r;
    EXPECT_NEAR(relit.at(r).z, dense(r), 0.03f) << r;
  }
  for (size_t r : {size_t(700), 2 * haar_chunk + 4})
    for (const HaarEntry& e : rows[r]) EXPECT_NEAR(load_receiver(t, r)[e.column], e.value, 0.03f);
}

// Rows of three channels, made `together` columns at a time, and how often they were made.
struct MadeOfRows {
  const std::vector<std::vector<HaarEntry>>& rows;
  size_t together, calls = 0;
  std::vector<float> made = {};

  HaarColumnsMaker maker() {
    const size_t columns = cube_texels(16);
    HaarColumnsMaker m{16, 3, rows.size(), together, std::vector<double>(rows.size()), 0, {}};
    for (size_t r = 0; r < rows.size(); ++r)
      for (const HaarEntry& e : rows[r]) m.squares[r] += double(e.value) * double(e.value);
    m.make = [this, columns](size_t first, size_t count) -> Result<std::span<const float>> {
      ++calls;
      made.assign(rows.size() * together * 3, 0.0f);
      for (size_t r = 0; r < rows.size(); ++r)
        for (const HaarEntry& e : rows[r])
          if (const size_t k = e.column % columns; k >= first && k < first + count)
            made[(r * together + k - first) * 3 + e.column / columns] = e.value;
      return std::span<const float>(made);
    };
    return m;
  }
};
std::vector<std::vector<HaarEntry>> random_rows(size_t count, uint32_t sparse) {
  Random random(5);
  std::vector<std::vector<HaarEntry>> rows(count);
  for (auto& row : rows)
    for (uint32_t c = 0; c < 3 * cube_texels(16); c += 1 + uint32_t(float(sparse) * random.next()))
      row.push_back({c, (random.next() - 0.3f) * (c < cube_texels(16) ? 1.0f : 0.4f)});
  return rows;
}

// What has no room is made again, and nothing of it shows in the result.
TEST(HaarTransfer, MemoryBoundsRowsAndChangesNoByte) {
  const auto rows = random_rows(2 * haar_chunk + 100, 600);
  const auto store = [&](size_t memory, size_t together, double error, int& passes) {
    MadeOfRows of{rows, together};
    HaarFitReport report;
    auto t = store_haar_columns(of.maker(), {.error = error}, memory, &report, nullptr, "wavelets", &passes);
    EXPECT_TRUE(t);
    EXPECT_EQ(of.calls, size_t(passes) * ((cube_texels(16) + together - 1) / together));
    EXPECT_EQ(t->error, report.error);
    return std::move(*t);
  };
  int once = 0, often = 0;
  for (double error : {0.0, 0.2}) {
    const HaarTransfer whole = store(size_t{1} << 30, 48, error, once), tight = store(1000, 17, error, often);
    EXPECT_EQ(once, 1);
    EXPECT_EQ(often, 3);
    EXPECT_TRUE(check_haar(tight, "it"));
    EXPECT_TRUE(std::equal(whole.data.begin(), whole.data.end(), tight.data.begin(), tight.data.end()));
    EXPECT_EQ(whole.steps, tight.steps);
    EXPECT_EQ(whole.error, tight.error);
    if (error > 0) {
      EXPECT_GT(whole.error, 0.1);
      EXPECT_LT(whole.error, 0.22);
      continue;
    }
    for (size_t r = 0; r < rows.size(); r += 997)
      for (const HaarEntry& e : rows[r]) EXPECT_NEAR(load_receiver(tight, r)[e.column], e.value, 0.004f);
  }
}

// Each channel against its own columns of a light that has another in each colour.
TEST(HaarTransfer, ThreeChannelsAreLitEachByItsColour) {
  const BallOverFloor s;
  const size_t columns = cube_texels(16);
  const auto rows = random_rows(300, 40);
  MadeOfRows of{rows, 48};
  HaarFitReport report;
  const HaarTransfer t = *store_haar_columns(of.maker(), {.error = 0}, size_t{1} << 30, &report);
  ASSERT_TRUE(check_haar(t, "it"));
  EXPECT_EQ(t.channels, 3);
  EXPECT_EQ(t.columns(), 3 * columns);
  EXPECT_LT(report.error, 0.01);
  CubeLight light = s.light;
  for (size_t k = 0; k < light.energy.size(); ++k) light.energy[k] *= Vec3(1, 0.5f + float(k % 5), float(k % 3));
  Relit relit;
  HaarReading reading;
  relight(t, haar_terms(t, haar_column_norms(t), light, 0), relit, &reading);
  EXPECT_LE(reading.terms, columns);
  std::vector<float> face(256);
  HaarTree tree;
  std::vector<Vec3> terms(columns);
  for (int f = 0; f < 6; ++f)
    for (int c = 0; c < 3; ++c) {
      for (int row = 0; row < 16; ++row)
        for (int column = 0; column < 16; ++column)
          face[size_t(row * 16 + column)] = light.energy[cube_texel(16, f, column, row)][c];
      haar_transform(4, face, tree);
      for (size_t k = 0; k < 256; ++k) terms[size_t(f) * 256 + k][c] = 256 * tree.coefficients[k];
    }
  for (size_t r = 0; r < rows.size(); r += 37) {
    const std::vector<float> row = load_receiver(t, r);
    for (int c = 0; c < 3; ++c) {
      double sum = 0, size = 0;
      for (size_t k = 0; k < columns; ++k) {
        const double term = double(row[size_t(c) * columns + k]) * double(terms[k][c]);
        sum += term, size += std::abs(term);
      }
      EXPECT_NEAR(relit.at(r)[c], sum, 1e-5 * size) << r << " " << c;
    }
  }
}

TEST(HaarTransfer, ColumnsThatLieAreRefused) {
  std::vector<std::vector<HaarEntry>> rows(300);
  rows[290].push_back({3, 1.0f}), rows[295].push_back({3, 0.5f});
  for (size_t r = 64; r < 128; ++r) rows[r].push_back({5, 1.0f});
  const HaarTransfer good = make_haar_transfer(4, rows);
  ASSERT_TRUE(check_haar(good, "it"));
  const size_t third = 0, fifth = good.column(0, 3).size();  // where these begin
  const auto refused = [&](auto change, const std::string& part) {
    HaarTransfer bad = good;
    std::vector<uint8_t> bytes(good.data.begin(), good.data.end());
    change(bad, bytes);
    bad.data = bytes;
    const auto ok = check_haar(bad, "it");
    ASSERT_FALSE(ok) << part;
    EXPECT_NE(ok.error().text().find(part), std::string::npos) << ok.error().text();
  };
  using Bytes = std::vector<uint8_t>;
  refused([](HaarTransfer& t, Bytes&) { t.size = 5; }, "power of two");
  refused([](HaarTransfer& t, Bytes&) { t.steps.pop_back(); }, "numbers of columns");
  refused([](HaarTransfer& t, Bytes&) { t.steps[3] = NAN; }, "step");
  refused([](HaarTransfer& t, Bytes&) { t.begin[3] = 999; }, "follow");
  refused([](HaarTransfer& t, Bytes&) { t.begin[4] += 1, t.begin[5] += 1; }, "tiles");
  refused([](HaarTransfer& t, Bytes&) { t.starts[1] += 1; }, "fill");
  refused([](HaarTransfer&, Bytes& b) { b.push_back(1); }, "fill");
  refused([&](HaarTransfer&, Bytes& b) { b[third + 8] = 1; }, "tiles");       // fewer entries than there are
  refused([&](HaarTransfer&, Bytes& b) { b[third + 8] = 0; }, "tiles");       // all 64
  refused([&](HaarTransfer&, Bytes& b) { b[third] |= 1; }, "tiles");          // a tile more
  refused([&](HaarTransfer&, Bytes& b) { b[third + 9] = 44; }, "receivers");  // 300 of them end at 43 of the fifth
  refused([&](HaarTransfer&, Bytes& b) { b[third + 11] = b[third + 9]; }, "receivers");
  refused([&](HaarTransfer&, Bytes& b) { std::fill_n(&b[fifth], 8, uint8_t(0)); }, "tiles");
  refused([](HaarTransfer& t, Bytes&) { t.receivers = 290; }, "receivers");
}

}  // namespace
}  // namespace lambent

#include <lambent/core/random.h>
#include <lambent/receivers/atlas.h>
#include <lambent/receivers/charts.h>
#include <lambent/receivers/raster.h>
#include <lambent/receivers/seams.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace lambent {
namespace {

Scene knotty_scene() {
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  add_box(scene, m, "room", Vec3(-1), Vec3(2, 1, 1.5f), 2, true);
  add_sphere(scene, m, "ball", Vec3(0.2f, 0.1f, 0), 0.4f, 3);
  add_quad(scene, m, "sheet", Vec3(-0.5f, 0.6f, -0.5f), Vec3(0.7f, 0.2f, 0), Vec3(0, 0.1f, 0.8f), 3, 2);
  for (Triangle& t : scene.triangles) t.two_sided = scene.parts[t.part].name == "sheet";
  return scene;
}

double flat_area(const std::array<Vec2, 3>& t) {
  const Vec2 a = t[1] - t[0], b = t[2] - t[0];
  return 0.5 * double(a.x * b.y - a.y * b.x);
}

TEST(Charts, AreConnectedFlatEnoughAndKeepLengths) {
  const Scene scene = knotty_scene();
  const Charts charts = make_charts(scene);
  const FlatCharts flat = flatten(scene, charts);
  EXPECT_GT(charts.count, 6u);
  std::vector<double> solid(charts.count, 0), laid(charts.count, 0);
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const uint32_t c = charts.of_triangle[i];
    ASSERT_NE(c, none);
    const double area = 0.5 * double(length(area_normal(scene, scene.triangles[i]))),
                 projected = flat_area(flat.corners[i]);
    // An orthogonal projection shrinks areas by the cosine, and keeps the orientation.
    EXPECT_LE(projected, area * (1 + 1e-4));
    EXPECT_GE(projected, area * (double(chart_cosine) - 1e-4));
    solid[c] += area, laid[c] += projected;
    for (Vec2 p : flat.corners[i]) {
      EXPECT_GE(std::min(p.x, p.y), -1e-5f);
      EXPECT_LE(p.x, flat.size[c].x + 1e-5f);
      EXPECT_LE(p.y, flat.size[c].y + 1e-5f);
    }
    EXPECT_GE(flat.size[c].x, flat.size[c].y);
  }
}

TEST(Pack, PlacesEverythingWithoutOverlapAndTightly) {
  Random random(4);
  std::vector<std::array<int, 2>> sizes;
  double area = 0;
  for (int i = 0; i < 2000; ++i) {
    const int h = 3 + int(random.next() * random.next() * 40), w = h + int(random.next() * 40);
    sizes.push_back({w, h}), area += double(w) * h;
  }
  const int width = 512;
  const Packing packing = pack_shelves(sizes, width);
  std::vector<uint8_t> taken(size_t(width) * size_t(packing.height), 0);
  for (size_t i = 0; i < sizes.size(); ++i)
    for (int y = 0; y < sizes[i][1]; ++y)
      for (int x = 0; x < sizes[i][0]; ++x) {
        const int px = packing.places[i][0] + x, py = packing.places[i][1] + y;
        ASSERT_TRUE(px < width && py < packing.height);
        uint8_t& t = taken[size_t(py) * size_t(width) + size_t(px)];
        ASSERT_EQ(t, 0);
        t = 1;
      }
  EXPECT_GT(area, 0.85 * width * double(packing.height));
}

TEST(Raster, MeetsExactlyTheTexelsWhoseSquareMeetsTheTriangle) {
  Random random(9);
  for (int round = 0; round < 300; ++round) {
    std::array<Vec2, 3> t;
    for (Vec2& p : t) p = Vec2(random.next(), random.next()) * 9.0f - 0.5f;
    if (round % 3 == 0) t[2] = t[0] + (t[1] - t[0]) * 0.5f + Vec2(0.01f, 0.02f);  // a sliver
    for (float reach : {0.5f, 1.0f}) {
      std::set<std::pair<int, int>> met;
      each_texel(t, reach, 8, 8, [&](int i, int j) { EXPECT_TRUE(met.insert({i, j}).second); });
      for (int j = 0; j < 8; ++j)
        for (int i = 0; i < 8; ++i) {
          // Brute force: a dense walk over the triangle.
          bool inside = false;
          for (int a = 0; a <= 60; ++a)
            for (int b = 0; a + b <= 60; ++b) {
              const Vec2 p = t[0] + (t[1] - t[0]) * (float(a) / 60) + (t[2] - t[0]) * (float(b) / 60);
              inside |= std::abs(p.x - float(i) - 0.5f) < reach - 1e-4f &&
                        std::abs(p.y - float(j) - 0.5f) < reach - 1e-4f;
            }
          EXPECT_TRUE(!inside || met.count({i, j})) << round;
          // The row's span of the band is a bound in x alone: the box of a slanted edge's band may pass the square by.
          const ClosestPoint c = closest_point(t, Vec2(float(i) + 0.5f, float(j) + 0.5f));
          EXPECT_TRUE(!met.count({i, j}) || c.distance <= reach * std::sqrt(2.0f) + 1e-4f) << round;
        }
    }
  }
}

TEST(Raster, ClosestPointIsTheClosest) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    std::array<Vec2, 3> t;
    for (Vec2& p : t) p = Vec2(random.next(), random.next());
    const Vec2 p(3 * random.next() - 1, 3 * random.next() - 1);
    const ClosestPoint c = closest_point(t, p);
    const Vec2 at = (1 - c.u - c.v) * t[0] + c.u * t[1] + c.v * t[2];
    EXPECT_NEAR(length(at - p), c.distance, 1e-5f);
    EXPECT_GE(std::min({c.u, c.v, 1 - c.u - c.v}), -1e-5f);
    float brute = INFINITY;
    for (int a = 0; a <= 100; ++a)
      for (int b = 0; a + b <= 100; ++b)
        brute = std::min(brute, length(t[0] + (t[1] - t[0]) * (float(a) / 100) + (t[2] - t[0]) * (float(b) / 100) - p));
    EXPECT_LE(c.distance, brute + 1e-5f);
    EXPECT_GE(c.distance, brute - 0.02f);  // the grid is 1/100 of edges up to sqrt(2) long
  }
}

TEST(Atlas, GivesEverySideItsOwnTexels) {
  Scene scene = knotty_scene();
  const Scene before = scene;
  auto atlas = make_atlas(scene, {.texels_per_unit = 20});
  ASSERT_TRUE(atlas) << atlas.error().text();
  EXPECT_EQ(atlas->texels_per_unit, 20);
  ASSERT_EQ(scene.triangles.size(), before.triangles.size());
  for (size_t i = 0; i < scene.triangles.size(); ++i)
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(scene.positions[scene.triangles[i].v[k]], before.positions[before.triangles[i].v[k]]);
  // No texel is reached by the tents of two sides that are not one chart: their look-ups share nothing.
  const Charts charts = make_charts(scene);
  const Receivers r = make_texel_receivers(scene, *atlas);
  const auto& texels = std::get<TexelReceivers>(r.basis);
  std::vector<int64_t> owner(texels.texels.size(), -1);
  for (uint32_t i = 0; i < scene.triangles.size(); ++i)
    for (bool front : {true, false}) {
      const TexelTriangle* t = texels.find(i, front);
      EXPECT_EQ(t != nullptr, front || scene.triangles[i].two_sided);
      if (!t) continue;
      each_texel({t->at[0], t->at[1], t->at[2]}, 1, texels.width, texels.height, [&](int x, int y) {
        int64_t& o = owner[size_t(y) * size_t(texels.width) + size_t(x)];
        const int64_t own = int64_t(charts.of_triangle[i]) * 2 + front;
        EXPECT_TRUE(o == -1 || o == own);
        o = own;
        EXPECT_NE(texels.texels[size_t(y) * size_t(texels.width) + size_t(x)], none);
      });
    }
  // Density: lengths in the atlas are lengths in space times 20, less the bounded shrinking.
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const TexelTriangle* t = texels.find(i, true);
    for (int k = 0; k < 3; ++k) {
      const float space =
          length(scene.positions[scene.triangles[i].v[k]] - scene.positions[scene.triangles[i].v[(k + 1) % 3]]);
      const float place = length(t->at[k] - t->at[(k + 1) % 3]);
      EXPECT_LE(place, 20 * space * 1.001f + 1e-3f);
      EXPECT_GE(place, 20 * space * (chart_cosine - 0.001f) - 1e-3f);
    }
  }
}

TEST(Atlas, FillsAGivenSizeOrSaysWhatItNeeds) {
  Scene scene = knotty_scene();
  auto atlas = make_atlas(scene, {.width = 256, .height = 192});
  ASSERT_TRUE(atlas) << atlas.error().text();
  EXPECT_EQ(atlas->width, 256);
  EXPECT_EQ(atlas->height, 192);
  const Receivers r = make_texel_receivers(scene, *atlas);
  EXPECT_GT(double(r.count()), 0.5 * 256 * 192);
  Scene small = knotty_scene();
  auto none_left = make_atlas(small, {.width = 16, .height = 16});
  ASSERT_FALSE(none_left);
  EXPECT_NE(none_left.error().text().find("need at least"), std::string::npos) << none_left.error().text();
  // What it says it needs suffices.
  const std::string text = none_left.error().text();
  const size_t at = text.find("at least ") + 9;
  const int w = std::stoi(text.substr(at)), h = std::stoi(text.substr(text.find('x', at) + 1));
  EXPECT_TRUE(make_atlas(small, {.width = w, .height = h}));
  for (AtlasOptions bad : {AtlasOptions{},
                           {.texels_per_unit = -1},
                           {.texels_per_unit = NAN},
                           {.texels_per_unit = 1e9f},
                           {.width = 10},
                           {.texels_per_unit = 1, .width = 10, .height = 10},
                           {.width = 100000, .height = 10}}) {
    Scene again = knotty_scene();
    EXPECT_FALSE(make_atlas(again, bad));
  }
}

TEST(Atlas, ReusesTheSecondCoordinatesUnlessTheyOverlap) {
  Scene quad = make_quad(Vec3(0), Vec3(0, 0, 2), Vec3(3, 0, 0), 4, 4, Vec3(0.5f));
  quad.texcoords[1].resize(quad.positions.size());
  for (size_t v = 0; v < quad.positions.size(); ++v)
    quad.texcoords[1][v] = Vec2(quad.positions[v].x / 3, quad.positions[v].z / 2) * 0.8f + 0.1f;
  Scene own = quad;
  auto atlas = make_atlas(own, {.texels_per_unit = 10});
  ASSERT_TRUE(atlas);
  EXPECT_EQ(atlas->charts, 0u);
  EXPECT_EQ(own.positions.size(), quad.positions.size());
  Scene folded = quad;
  for (Vec2& uv : folded.texcoords[1]) uv.x = std::abs(uv.x - 0.5f);
  auto fresh = make_atlas(folded, {.texels_per_unit = 10});
  ASSERT_TRUE(fresh);
  EXPECT_GT(fresh->charts, 0u);
  EXPECT_NE(fresh->remark.find("covered twice"), std::string::npos) << fresh->remark;
  Scene collapsed = quad;
  for (Vec2& uv : collapsed.texcoords[1]) uv = Vec2(0.5f);
  EXPECT_GT(make_atlas(collapsed, {.texels_per_unit = 10})->charts, 0u);
}

// A grid whose corners are vertices of their own, laid over all of the unit square, each rounded in its own way.
Scene rounded_grid(float error) {
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  constexpr int n = 12;
  Random random(5);
  std::vector<Vec3> positions, normals;
  std::vector<Vec2> uv;
  std::vector<uint32_t> indices;
  auto corner = [&](int i, int j) {
    const Vec2 at(float(i) / n, float(j) / n);
    indices.push_back(uint32_t(positions.size())), normals.push_back({0, 1, 0});
    positions.push_back({3 * at.x, 0.1f * float((i + j) % 2), 2 * at.y});
    uv.push_back(at + error * (2 * Vec2(random.next(), random.next()) - Vec2(1)));
  };
  for (int k = 0; k < n * n; ++k) {
    const int i = k % n, j = k / n;
    corner(i, j), corner(i, j + 1), corner(i + 1, j);
    corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1);
  }
  for (int k = 0; k < 3; ++k) {  // a sliver that rounding left no place
    indices.push_back(uint32_t(positions.size())), normals.push_back({0, 1, 0}), uv.push_back({0.3f, 0.3f});
    positions.push_back({0.9f + (k == 1 ? 1e-3f : 0), 0, 0.6f + (k == 2 ? 1e-3f : 0)});
  }
  add_mesh(scene, m, "grid", positions, normals, indices);
  scene.texcoords[1] = uv;
  return scene;
}

TEST(Atlas, UsesALayoutThatIsRightButForRounding) {
  for (int side : {32, 300, 2048})
    for (float error : {0.0f, 1e-5f}) {
      Scene scene = rounded_grid(error);
      auto atlas = make_atlas(scene, {.width = side, .height = side});
      ASSERT_TRUE(atlas) << atlas.error().text();
      EXPECT_EQ(atlas->remark, "") << side;
      EXPECT_EQ(atlas->charts, 0u);
      for (Vec2 p : atlas->front) {
        EXPECT_GE(std::min(p.x, p.y), 0.0f);
        EXPECT_LE(std::max(p.x, p.y), float(side));
      }
    }
  // Where more than rounding is wrong, it is not: outside, on one another, without a place.
  auto remark = [](auto spoil) {
    Scene scene = rounded_grid(0);
    spoil(scene.texcoords[1]);
    auto atlas = make_atlas(scene, {.width = 300, .height = 300});
    EXPECT_TRUE(atlas);
    EXPECT_GT(atlas->charts, 0u);
    return atlas->remark;
  };
  EXPECT_NE(remark([](auto& uv) { uv[0].x = -1e-3f; }).find("leaves"), std::string::npos);
  EXPECT_NE(remark([](auto& uv) { uv[0] = uv[6], uv[1] = uv[7], uv[2] = uv[8]; }).find("covered twice"),
            std::string::npos);
  EXPECT_NE(remark([](auto& uv) { uv[0] = uv[1] = uv[2]; }).find("no area"), std::string::npos);
}

TEST(Atlas, ASpiralDoesNotCoverItselfTwice) {
  // A ramp of two turns: flat enough to be one chart, and over itself in projection.
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
  for (int i = 0; i <= 96; ++i) {
    const float a = 4 * pi * float(i) / 96;
    for (float radius : {1.0f, 2.0f})
      positions.push_back({radius * std::cos(a), 0.1f * a, -radius * std::sin(a)}), normals.push_back({0, 1, 0});
    if (i == 96) break;
    const uint32_t v = uint32_t(2 * i);
    indices.insert(indices.end(), {v, v + 1, v + 3, v, v + 3, v + 2});
  }
  add_mesh(scene, m, "ramp", positions, normals, indices);
  auto atlas = make_atlas(scene, {.texels_per_unit = 16});
  ASSERT_TRUE(atlas);
  EXPECT_GE(atlas->charts, 2u);
  EXPECT_LE(atlas->charts, 8u);
  std::vector<int> covered(size_t(atlas->width) * size_t(atlas->height), 0);
  for (const Triangle& t : scene.triangles) {
    const std::array<Vec2, 3> at{atlas->front[t.v[0]], atlas->front[t.v[1]], atlas->front[t.v[2]]};
    each_texel(at, 0, atlas->width, atlas->height, [&](int i, int j) {
      const ClosestPoint c = closest_point(at, Vec2(float(i) + 0.5f, float(j) + 0.5f));
      if (c.distance == 0 && std::min({c.u, c.v, 1 - c.u - c.v}) > 1e-3f)
        ++covered[size_t(j) * size_t(atlas->width) + size_t(i)];
    });
  }
  EXPECT_EQ(*std::max_element(covered.begin(), covered.end()), 1);
}

TEST(Atlas, AMillionLooseTrianglesNeitherHangNorExhaustMemory) {
  SKIP_UNDER_SANITIZERS();
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  Random random(1);
  constexpr size_t count = 1'000'000;
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
  for (size_t i = 0; i < count; ++i) {
    const Vec3 p(random.next() * 100, random.next() * 100, random.next() * 100);
    for (int k = 0; k < 3; ++k) {
      positions.push_back(p + Vec3(random.next(), random.next(), random.next()) * 0.1f), normals.push_back({0, 1, 0});
      indices.push_back(uint32_t(indices.size()));
    }
  }
  add_mesh(scene, m, "dust", positions, normals, indices);
  auto atlas = make_atlas(scene, {.texels_per_unit = 5, .padding = 1});
  ASSERT_TRUE(atlas) << atlas.error().text();
  EXPECT_EQ(atlas->charts, count);
  EXPECT_LE(size_t(atlas->width) * size_t(atlas->height), size_t(20) * count);
  Scene tight = scene;
  auto small = make_atlas(tight, {.width = 1024, .height = 1024});
  ASSERT_FALSE(small);
  EXPECT_NE(small.error().text().find("too small"), std::string::npos);
}

// A function that hats reproduce: linear in space.
double linear(Vec3 p) { return 0.3 + 1.5 * double(p.x) - 0.7 * double(p.y) + 0.4 * double(p.z); }

// sum_i alpha_i B_i at a place of a triangle's front, alpha_i what receiver i finds where it is.
template <class Basis>
double between_receivers(const Receivers& r, uint32_t triangle, float u, float v) {
  const Basis& basis = std::get<Basis>(r.basis);
  double sum = 0;
  basis.spread(*basis.find(triangle, true), u, v,
               [&](uint32_t i, float weight) { sum += double(weight) * linear(r.origins[i]); });
  return sum;
}

TEST(Bases, HatsReproduceLinearFunctions) {
  Scene scene = make_quad(Vec3(0.2f, 0.1f, 0), Vec3(1, 0.3f, 0), Vec3(0.1f, 0.2f, 1), 3, 4, Vec3(0.5f));
  const Receivers r = make_vertex_receivers(scene);
  Random random(2);
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const float u = random.next() * 0.5f, v = random.next() * 0.5f;
    const Vec3 p = interpolate(scene.positions, scene.triangles[t], u, v);
    // But for the hair that receivers are moved by: 1e-2 of an edge.
    EXPECT_NEAR(between_receivers<CornerReceivers>(r, t, u, v), linear(p), 0.01);
  }
}

TEST(Bases, BilinearTexelsReproduceWhatIsLinearInTheAtlas) {
  Scene scene = make_quad(Vec3(0.2f, 0.1f, 0), Vec3(1, 0.3f, 0), Vec3(0.1f, 0.2f, 1), 2, 2, Vec3(0.5f));
  auto atlas = make_atlas(scene, {.texels_per_unit = 13.3f});
  ASSERT_TRUE(atlas);
  const Receivers r = make_texel_receivers(scene, *atlas);
  // The chart is flat, so functions linear in space are linear in the atlas. Exact inside; texels on the border hold
  // the border's value, so they err within a texel of it by half a texel.
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const Vec3 p = interpolate(scene.positions, scene.triangles[t], 0.3f, 0.3f);
    EXPECT_NEAR(between_receivers<TexelReceivers>(r, t, 0.3f, 0.3f), linear(p), 1.7 * 0.6 / 13.3);
  }
}

TEST(Seams, AgreeAfterSmoothingAndNoticeNothingElse) {
  // A gently curved strip is cut into several charts; noise on the texels makes their look-ups differ along the cuts.
  Scene scene = make_sphere(1, 4, Vec3(0.5f));
  auto atlas = make_atlas(scene, {.texels_per_unit = 12});
  ASSERT_TRUE(atlas);
  const Receivers r = make_texel_receivers(scene, *atlas);
  const auto& texels = std::get<TexelReceivers>(r.basis);
  Random random(6);
  std::vector<float> values(r.count() * 2);
  for (size_t i = 0; i < r.count(); ++i)
    values[2 * i] = 1 + 0.2f * (random.next() - 0.5f), values[2 * i + 1] = r.normals[i].y;
  auto jump = [&](size_t column) {
    // Root mean square difference of look-ups at the middles of edges that two charts share.
    std::map<std::pair<std::array<float, 3>, std::array<float, 3>>, std::vector<Vec2>> middles;
    for (uint32_t i = 0; i < scene.triangles.size(); ++i)
      for (size_t k = 0; k < 3; ++k) {
        const Vec3 a = scene.positions[scene.triangles[i].v[k]], b = scene.positions[scene.triangles[i].v[(k + 1) % 3]];
        std::array<float, 3> x{a.x, a.y, a.z}, y{b.x, b.y, b.z};
        if (y < x) std::swap(x, y);
        const TexelTriangle* t = texels.find(i, true);
        middles[{x, y}].push_back(0.5f * (t->at[k] + t->at[(k + 1) % 3]));
      }
    double sum = 0;
    int count = 0;
    for (const auto& [edge, at] : middles) {
      if (at.size() != 2 || length(at[0] - at[1]) < 1e-3f) continue;
      double value[2] = {0, 0};
      for (int s = 0; s < 2; ++s)
        texels.spread_at(at[size_t(s)],
                         [&](uint32_t q, float w) { value[s] += double(w) * double(values[2 * q + column]); });
      sum += (value[0] - value[1]) * (value[0] - value[1]), ++count;
    }
    EXPECT_GT(count, 50);
    return std::sqrt(sum / count);
  };
  const double before = jump(0), smooth_before = jump(1);
  const std::vector<float> old = values;
  const size_t touched = smooth_seams(scene, texels, values.data(), 2, 2);
  EXPECT_GT(touched, 100u);
  EXPECT_LT(touched, r.count());
  EXPECT_GT(before, 0.02);
  EXPECT_LT(jump(0), 0.35 * before);  // white noise on every texel is the worst case
  EXPECT_LT(jump(1), 0.5 * smooth_before + 1e-4);
  size_t changed = 0;
  for (size_t i = 0; i < r.count(); ++i) changed += old[2 * i] != values[2 * i];
  EXPECT_LE(changed, touched);
}

}  // namespace
}  // namespace lambent

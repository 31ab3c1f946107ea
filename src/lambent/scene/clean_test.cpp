#include <lambent/core/random.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "test_meshes.h"

namespace lambent {
namespace {

using test::bare_cube;
using test::broken_invariant;

TEST(MakeNormals, SplitsACubeIntoFaces) {
  for (bool flat : {false, true}) {
    Scene s = bare_cube();
    make_normals(s, 0, flat);
    EXPECT_EQ(broken_invariant(s), "");
    EXPECT_EQ(s.positions.size(), 24u);  // four corners a face
    EXPECT_EQ(s.triangles.size(), 12u);
    for (const Triangle& t : s.triangles)
      for (uint32_t v : t.v) EXPECT_EQ(s.normals[v], normalize(area_normal(s, t)));
    ASSERT_EQ(s.parts[0].source.size(), 24u);
    EXPECT_TRUE(s.parts[0].changed);
    Scene before = bare_cube();
    for (uint32_t v = 0; v < 24; ++v) {
      EXPECT_EQ(s.positions[v], before.positions[s.parts[0].source[v]]);
    }
    for (uint32_t v = 0; v < 8; ++v) EXPECT_EQ(s.parts[0].source[v], v);
  }
}

TEST(MakeNormals, SmoothSphereIsNearlyRadial) {
  // Facets of a level-4 icosphere subtend about 4 degrees; angle-weighted means of nearly regular fans err far less.
  constexpr float least_cosine = 0.9999f;
  Scene s = make_sphere(2.5f, 4, Vec3(0.5f));
  size_t count = s.positions.size();
  s.normals.assign(count, Vec3(0));
  make_normals(s, 0, false);
  EXPECT_EQ(s.positions.size(), count);
  for (size_t v = 0; v < count; ++v) EXPECT_GT(dot(s.normals[v], normalize(s.positions[v])), least_cosine);
}

TEST(MakeNormals, JoinsSeamsAndIsTheSameWithoutIndices) {
  constexpr float rounding = 1e-6f;
  Scene shared = make_sphere(1, 3, Vec3(0.5f)), loose = shared;
  loose.positions.clear();
  for (Triangle& t : loose.triangles) {
    for (uint32_t& v : t.v) {
      loose.positions.push_back(shared.positions[v]);
      v = uint32_t(loose.positions.size() - 1);
    }
  }
  loose.normals.assign(loose.positions.size(), Vec3(0));
  loose.parts[0].vertex_count = uint32_t(loose.positions.size());
  make_normals(shared, 0, false), make_normals(loose, 0, false);
  EXPECT_EQ(broken_invariant(loose), "");
  ASSERT_EQ(loose.positions.size(), 3 * loose.triangles.size());
  for (size_t t = 0; t < shared.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_LT(distance(shared.normals[shared.triangles[t].v[k]], loose.normals[loose.triangles[t].v[k]]), rounding);
    }
  }
}

TEST(MakeNormals, WeightsByCornerAngle) {
  // A cube's corner, smoothed by hand: each face counts pi/2 however it is triangulated, so the mean is the diagonal.
  constexpr float rounding = 1e-6f;
  Scene s = bare_cube();
  s.normals.assign(8, Vec3(0));
  repair_normals(s);
  for (int v = 0; v < 8; ++v) EXPECT_LT(distance(s.normals[size_t(v)], normalize(s.positions[size_t(v)])), rounding);
}

TEST(MakeNormals, ManyFacesOnOneEdge) {
  // Sheets about the y axis, all wound alike. Neighbours 30 degrees apart join into one group; 120 apart they do not.
  for (auto [sheets, groups] : {std::pair{12u, 1u}, std::pair{3u, 3u}}) {
    Scene s;
    s.materials.resize(1);
    s.positions = {{0, 0, 0}, {0, 1, 0}};
    for (uint32_t k = 0; k < sheets; ++k) {
      float turn = 2 * pi * float(k) / float(sheets);
      s.positions.push_back({std::cos(turn), 0, std::sin(turn)});
      s.triangles.push_back({{0, 1, 2 + k}, 0, true});
    }
    s.parts.emplace_back();
    s.parts[0].vertex_count = uint32_t(s.positions.size()), s.parts[0].triangle_count = sheets;
    size_t before = s.positions.size();
    make_normals(s, 0, false);
    EXPECT_EQ(broken_invariant(s), "");
    EXPECT_EQ(s.positions.size(), before + 2 * (groups - 1));
  }
}

TEST(MakeNormals, MovesLaterParts) {
  Scene s = bare_cube();
  Scene ball = make_sphere(0.5f, 1, Vec3(0.5f));
  test::append(s, ball);
  test::append(s, bare_cube());
  s.colors.resize(s.positions.size());
  s.texcoords[1].resize(s.positions.size());
  for (size_t v = 0; v < s.positions.size(); ++v)
    s.colors[v] = s.positions[v], s.texcoords[1][v] = Vec2(s.positions[v]);
  const size_t bare[] = {0, 2};
  make_normals(s, bare, false);
  EXPECT_EQ(broken_invariant(s), "");
  EXPECT_EQ(s.positions.size(), 24 + ball.positions.size() + 24);
  EXPECT_EQ(s.colors, s.positions);  // attributes went with their vertices
  for (size_t v = 0; v < s.positions.size(); ++v) EXPECT_EQ(s.texcoords[1][v], Vec2(s.positions[v]));
  for (size_t v = 0; v < ball.positions.size(); ++v) {
    EXPECT_EQ(s.positions[24 + v], ball.positions[v]);
    EXPECT_EQ(s.normals[24 + v], ball.normals[v]);
  }
  EXPECT_FALSE(s.parts[1].changed);
  EXPECT_TRUE(s.parts[2].changed);
}

TEST(MakeNormals, TrianglesWithoutAreaCountForNothing) {
  Scene s = make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1, Vec3(0.5f));
  s.positions.push_back({2, 0, 0}), s.normals.push_back(Vec3(0));
  s.parts[0].vertex_count = 5;
  s.triangles.push_back({{0, 1, 4}, 0, false});  // three points of a line
  s.parts[0].triangle_count = 3;
  make_normals(s, 0, false);
  EXPECT_EQ(broken_invariant(s), "");
  EXPECT_EQ(s.positions.size(), 5u);
  for (size_t v = 0; v < 4; ++v) EXPECT_EQ(s.normals[v], Vec3(0, 0, 1));
  EXPECT_EQ(s.normals[4], Vec3(0, 1, 0));
}

TEST(RepairNormals, ReplacesTheBrokenAndScalesTheRest) {
  Scene s = make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, 2, Vec3(0.5f));
  const Vec3 tilted = normalize(Vec3(0.1f, 0.2f, 1));
  s.normals[0] = Vec3(0), s.normals[1] = Vec3(NAN, 0, 1), s.normals[2] = Vec3(1e-40f, 0, 0),
  s.normals[3] = Vec3(INFINITY, 0, 0);
  s.normals[4] = 3.0f * tilted, s.normals[5] = tilted;
  repair_normals(s);
  for (size_t v : {0, 1, 2, 3}) EXPECT_EQ(s.normals[v], Vec3(0, 0, 1));
  constexpr float rounding = 1e-6f;
  EXPECT_LT(distance(s.normals[4], tilted), rounding);
  EXPECT_EQ(s.normals[5], tilted);  // unit already: kept bit for bit
  EXPECT_TRUE(s.parts[0].changed);
  EXPECT_EQ(s.parts[0].source.size(), 9u);
}

TEST(MergeDuplicates, DropsRepeatsAndMarksOpposites) {
  Scene s = make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1, Vec3(0.5f));
  Scene repeat = s, back = s, other = make_quad({5, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1, Vec3(0.5f));
  for (Triangle& t : repeat.triangles) std::rotate(t.v, t.v + 1, t.v + 3);  // the same triangle, begun elsewhere
  for (Triangle& t : back.triangles) std::swap(t.v[0], t.v[1]);
  back.triangles.pop_back(), back.parts[0].triangle_count = 1;
  test::append(s, repeat), test::append(s, other), test::append(s, back);
  merge_duplicate_triangles(s);
  EXPECT_EQ(broken_invariant(s), "");
  ASSERT_EQ(s.triangles.size(), 5u);
  EXPECT_EQ(s.parts[1].triangle_count, 0u);
  EXPECT_TRUE(s.parts[1].changed);
  EXPECT_EQ(s.parts[1].source.size(), 4u);
  EXPECT_FALSE(s.parts[0].changed);
  EXPECT_TRUE(s.triangles[0].two_sided);   // has the opposite
  EXPECT_FALSE(s.triangles[1].two_sided);  // has not
  EXPECT_FALSE(s.triangles[2].two_sided);
  EXPECT_TRUE(s.triangles[4].two_sided);
}

TEST(InferSidedness, ClosedAndOutwardIsOneSided) {
  Scene cube = bare_cube();
  infer_sidedness(cube);
  EXPECT_EQ(test::two_sided_count(cube), 0u);

  Scene inward = bare_cube();
  for (Triangle& t : inward.triangles) std::swap(t.v[1], t.v[2]);
  infer_sidedness(inward);
  EXPECT_EQ(test::two_sided_count(inward), 12u);

  Scene open = bare_cube();
  open.triangles.pop_back(), open.parts[0].triangle_count = 11;
  infer_sidedness(open);
  EXPECT_EQ(test::two_sided_count(open), 11u);

  Scene quad = make_quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 3, 3, Vec3(0.5f));
  infer_sidedness(quad);
  EXPECT_EQ(test::two_sided_count(quad), quad.triangles.size());
}

TEST(InferSidedness, LooksAtComponentsAndJoinsSeams) {
  Scene s;
  add_box(s, add_material(s, "a", Vec3(0.5f)), "six loose faces", {10, 0, 0}, {11, 1, 1}, 3);
  add_quad(s, 0, "open", {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1);
  infer_sidedness(s);
  for (const Triangle& t : s.triangles) EXPECT_EQ(t.two_sided, t.part == 1);
}

TEST(InferSidedness, FlatDoubledSheetHoldsNoVolume) {
  Scene s = make_quad({0.1f, 0.2f, 0.3f}, {1, 0.7f, 0}, {0, 1, 0.9f}, 5, 5, Vec3(0.5f)), back = s;
  for (Triangle& t : back.triangles) std::swap(t.v[0], t.v[1]);
  test::append(s, back);
  infer_sidedness(s);
  EXPECT_EQ(test::two_sided_count(s), s.triangles.size());
}

TEST(NumberPositions, JoinsEqualOnesInOrder) {
  const Vec3 p[] = {{1, 2, 3}, {0, 0, 0}, {1, 2, 3}, {-0.0f, 0, -0.0f}, {1, 2, 3.0000002f}};
  PositionIds ids = number_positions(p);
  EXPECT_EQ(ids.count, 3u);
  EXPECT_EQ(ids.ids, (std::vector<uint32_t>{0, 1, 0, 1, 2}));
}

// Normals by the definition, corner by corner: the faces that a walk over edges between smooth pairs of faces reaches,
// weighted by angle. Quadratic.
std::vector<Vec3d> plain_corner_normals(const Scene& s, double crease_degrees) {
  const size_t corners = 3 * s.triangles.size();
  auto place = [&](size_t c) { return s.positions[s.triangles[c / 3].v[c % 3]]; };
  auto normal = [&](size_t t) {
    return normalize(
        cross(Vec3d(place(3 * t + 1)) - Vec3d(place(3 * t)), Vec3d(place(3 * t + 2)) - Vec3d(place(3 * t))));
  };
  auto angle = [&](size_t c) {
    const Vec3d p(place(c)), a = normalize(Vec3d(place(c / 3 * 3 + (c + 1) % 3)) - p),
                             b = normalize(Vec3d(place(c / 3 * 3 + (c + 2) % 3)) - p);
    return std::acos(std::clamp(dot(a, b), -1.0, 1.0));
  };
  auto share_an_edge_at = [&](size_t c, size_t d) {
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j)
        if (c / 3 * 3 + i != c && d / 3 * 3 + j != d && place(c / 3 * 3 + i) == place(d / 3 * 3 + j)) return true;
    return false;
  };
  std::vector<Vec3d> out(corners);
  for (size_t c = 0; c < corners; ++c) {
    std::vector<size_t> reached{c};
    Vec3d sum(0);
    for (size_t i = 0; i < reached.size(); ++i) {
      sum += angle(reached[i]) * normal(reached[i] / 3);
      for (size_t d = 0; d < corners; ++d)
        if (place(d) == place(c) && share_an_edge_at(reached[i], d) &&
            dot(normal(reached[i] / 3), normal(d / 3)) > std::cos(radians(crease_degrees)) &&
            std::find(reached.begin(), reached.end(), d) == reached.end())
          reached.push_back(d);
    }
    out[c] = normalize(sum);
  }
  return out;
}

TEST(MakeNormals, AgreesWithThePlainDefinition) {
  Random random(7);
  for (int kind = 0; kind < 12; ++kind) {
    // A bumpy sphere of shared vertices, more or less rough; some of its triangles missing, some vertices apart.
    Scene s;
    const int n = 7;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j < n; ++j) {
        const float tilt = pi * (float(i) + 0.01f) / (float(n) + 0.02f), turn = 2 * pi * float(j) / n;
        const float r = 1 + 0.15f * float(kind % 6) * random.next();
        s.positions.push_back(r *
                              Vec3(std::sin(tilt) * std::cos(turn), std::cos(tilt), std::sin(tilt) * std::sin(turn)));
      }
    auto add = [&](int a, int b, int c) {
      if (kind >= 6 && random.next() < 0.2f) return;
      s.triangles.push_back({{uint32_t(a), uint32_t(b), uint32_t(c)}, 0, false});
      if (kind >= 9 && random.next() < 0.3f) {
        s.positions.push_back(s.positions[size_t(a)]);
        s.triangles.back().v[0] = uint32_t(s.positions.size() - 1);
      }
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const int a = i * n + j, b = i * n + (j + 1) % n;
        add(a, b, a + n), add(b, b + n, a + n);
      }
    s.normals.assign(s.positions.size(), Vec3(0)), s.materials.resize(1);
    Part part;
    part.vertex_count = uint32_t(s.positions.size()), part.triangle_count = uint32_t(s.triangles.size());
    s.parts.push_back(part);
    for (bool flat : {false, true}) {
      Scene made = s;
      const std::vector<Vec3d> truth = plain_corner_normals(s, flat ? 0.1 : double(crease_angle_degrees));
      make_normals(made, 0, flat);
      EXPECT_EQ(broken_invariant(made), "");
      for (size_t c = 0; c < truth.size(); ++c) {
        const uint32_t v = made.triangles[c / 3].v[c % 3];
        EXPECT_LT(length(Vec3d(made.normals[v]) - truth[c]), 1e-6) << kind << " " << c;
        EXPECT_EQ(made.positions[v], s.positions[s.triangles[c / 3].v[c % 3]]);
      }
    }
  }
}

// By the fans and without them, of triangles among few places: repeated, turned, from several parts.
TEST(MergeDuplicateTriangles, WithAndWithoutFansAgree) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    Scene s;
    s.materials.resize(1);
    const uint32_t places = seed < 10 ? 5 : 40;
    for (uint32_t p = 0; p < 3; ++p) {
      Part part;
      part.first_vertex = uint32_t(s.positions.size()), part.first_triangle = uint32_t(s.triangles.size());
      for (uint32_t v = 0; v < places; ++v) s.positions.push_back(Vec3(v % 3, v / 3, v == 0 ? -0.0f : 0.0f));
      for (int t = 0; t < 60; ++t) {
        Triangle triangle{{}, p, false};
        for (uint32_t& v : triangle.v) v = part.first_vertex + uint32_t(random.next() * float(places));
        s.triangles.push_back(triangle);
      }
      part.vertex_count = places, part.triangle_count = 60;
      s.parts.push_back(part);
    }
    s.normals.assign(s.positions.size(), Vec3(0, 1, 0));
    Scene a = s, b = s;
    EXPECT_EQ(merge_duplicate_triangles(a), merge_duplicate_triangles(b, corner_fans(b)));
    ASSERT_EQ(a.triangles.size(), b.triangles.size());
    if (places == 5) {
      EXPECT_LT(a.triangles.size(), s.triangles.size());
    }
    for (size_t t = 0; t < a.triangles.size(); ++t) {
      EXPECT_TRUE(std::equal(a.triangles[t].v, a.triangles[t].v + 3, b.triangles[t].v));
      EXPECT_EQ(a.triangles[t].two_sided, b.triangles[t].two_sided);
    }
    EXPECT_EQ(broken_invariant(a), "");
  }
}

TEST(NumberPositions, ManyInBuckets) {
  std::vector<Vec3> p;
  for (uint32_t i = 0; i < 40'000; ++i) p.push_back({float(i * 7919 % 9973), i % 2 ? 0.0f : -0.0f, 1});
  const PositionIds ids = number_positions(p);
  EXPECT_EQ(ids.count, 9973u);
  for (uint32_t i = 0; i < p.size(); ++i) EXPECT_EQ(ids.ids[i], i % 9973);
}

TEST(CornerFans, RingsAreWhatTheySay) {
  Scene cube = bare_cube();
  const CornerFans fans = corner_fans(cube);
  for (size_t p = 0; p < 8; ++p) {
    ASSERT_TRUE(fans.is_ring[p]);
    const uint32_t *ring = &fans.corners[fans.first[p]], count = fans.first[p + 1] - fans.first[p];
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t c = ring[i], next = ring[(i + 1) % count];
      EXPECT_EQ(fans.ids[c], p);
      EXPECT_EQ(fans.ids[c / 3 * 3 + (c + 1) % 3], fans.ids[next / 3 * 3 + (next + 2) % 3]);
    }
  }
  std::swap(cube.triangles[0].v[0], cube.triangles[0].v[1]);  // runs the wrong way: its corners are in no ring
  const CornerFans turned = corner_fans(cube);
  EXPECT_EQ(std::count(turned.is_ring.begin(), turned.is_ring.end(), 1), 5);
  cube = bare_cube();
  cube.triangles.pop_back(), --cube.parts[0].triangle_count;
  const CornerFans open = corner_fans(cube);
  EXPECT_EQ(std::count(open.is_ring.begin(), open.is_ring.end(), 1), 5);
}

}  // namespace
}  // namespace lambent

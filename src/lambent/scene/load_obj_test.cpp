#include <lambent/scene/load.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>

#include <gtest/gtest.h>

#include <numeric>
#include <set>

#include "test_meshes.h"

namespace lambent {
namespace {

using test::bytes_of;

Result<Scene> load(std::string_view text) { return load_obj(bytes_of(text), "t.obj", ""); }

Scene must_load(std::string_view text) {
  auto scene = load(text);
  EXPECT_TRUE(scene) << scene.error().text();
  if (!scene) return test::bare_cube();
  EXPECT_EQ(test::broken_invariant(*scene), "");
  return *scene;
}

std::string error_of(std::string_view text) {
  auto scene = load(text);
  return scene ? "loaded" : scene.error().text();
}

const char* const cube =
    "mtllib none.mtl\no cube\nv -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nusemtl stone\nf 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5/1 6/2 8/3 7\n";

TEST(LoadObj, ReadsACube) {
  Scene s = must_load(cube);
  EXPECT_EQ(s.triangles.size(), 12u);
  EXPECT_EQ(s.parts.size(), 1u);
  EXPECT_EQ(s.parts[0].name, "cube");
  EXPECT_EQ(s.positions.size(), 24u);
  EXPECT_EQ(s.texcoords[0].size(), 24u);
  EXPECT_EQ(test::two_sided_count(s), 0u);
  EXPECT_FALSE(s.materials[0].double_sided);
  EXPECT_EQ(s.warnings.size(), 1u);  // the library cannot be had
  EXPECT_EQ(s.document, nullptr);
}

TEST(LoadObj, TextOfTwoBytesACharacterIsRefused) {
  const std::string plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
                    refused = "t.obj: is text in UTF-16, which is not read: save it as UTF-8";
  for (bool marked : {false, true}) {
    std::string little = marked ? "\xff\xfe" : "", big = marked ? "\xfe\xff" : "";
    for (char c : plain) little += c, little += '\0', big += '\0', big += c;
    EXPECT_EQ(error_of(little), refused);
    EXPECT_EQ(error_of(big), refused);
  }
  EXPECT_EQ(must_load("\xef\xbb\xbf" + plain).positions.size(), 3u);  // the mark of UTF-8 is no part of the first line
}

// Exporters that leave out the lists still name their entries.
TEST(LoadObj, FacesGoWithoutWhatDoesNotExist) {
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* face : {"f 1/1/1 2/2/1 3/3/1\n", "f 1//7 2//7 3//7\nvn 1 0 0\n"}) {
    const Scene s = must_load(three + face);
    ASSERT_EQ(s.warnings.size(), 1u);
    EXPECT_EQ(s.warnings[0], "t.obj: 1 faces name normals or texture coordinates that do not exist, and go without");
    EXPECT_EQ(s.normals[0], Vec3(0, 0, 1));
  }
}

TEST(LoadObj, NumbersThatAreNoneDoNoHarm) {
  const Scene s =
      must_load("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1.#IND -1.#IND 1.#QNAN000\nv 1.#INF -1.#INF nan(ind)\nf 1 2 3\n");
  EXPECT_EQ(s.positions.size(), 3u);
  EXPECT_EQ(s.warnings.size(), 0u);
}

TEST(LoadObj, LineEndsCommentsAndContinuations) {
  const char* plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  Scene expected = must_load(plain);
  for (const char* text : {"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3",
                           "# x\n\n  v 0 0 0 # origin\n\tv 1\t0 0\nv 0 1 0\nf 1 2 3 # 4 5",
                           "v 0 0 \\\n 0\nv 1 \\\r\n0 0\nv 0 1 0\nf 1 \\\n2 \\\n3",
                           "v +0 0 0\nv 1e0 0 0\nv 0 1.0 0\ncurv2 1 x\nl 1 2\ns off\nf 1 2 3\n"}) {
    Scene s = must_load(text);
    EXPECT_EQ(s.positions, expected.positions) << text;
    EXPECT_EQ(s.triangles.size(), 1u);
  }
  EXPECT_EQ(error_of("v 0 0 \\\n0\nv 1 0 0\nv 0 q 0\n"), "t.obj:4: expected a number");
}

TEST(LoadObj, NegativeIndicesCountBack) {
  Scene s = must_load("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\nv 5 5 5\n");
  ASSERT_EQ(s.positions.size(), 3u);  // unused vertices are gone
  EXPECT_EQ(s.positions[1], Vec3(1, 0, 0));
  EXPECT_EQ(error_of("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\n"), "t.obj:4: malformed or out-of-range face corner");
}

TEST(LoadObj, FacesMayComeBeforeVertices) {
  EXPECT_EQ(must_load("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").triangles.size(), 1u);
}

TEST(LoadObj, RefusesWithTheLine) {
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_EQ(error_of(three), "t.obj: no triangles");
  EXPECT_EQ(error_of(""), "t.obj: no triangles");
  EXPECT_EQ(error_of(three + "f 1 2 4\n"), "t.obj:4: vertex 4 of 3 does not exist");
  for (const char* face : {"f 1 2 0", "f 1 2 x", "f 1 2 3x", "f 1 2 99999999999999999999", "f 1 2 4294967295",
                           "f 1 2 -9223372036854775808", "f 1 2 3/1/1/1", "f 1 2 /3"})
    EXPECT_EQ(error_of(three + face), "t.obj:4: malformed or out-of-range face corner") << face;
  EXPECT_EQ(error_of("v 0 0\n"), "t.obj:1: a vertex needs three coordinates");
  EXPECT_EQ(error_of("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "t.obj: no triangle has an area");
}

TEST(LoadObj, DropsFacesWithRepeatedCornersAndSaysSo) {
  Scene s = must_load("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1\nf 1 2 3\nf 2 2 2\nf 1 2\nf\nf 1 2 3 3\n");
  EXPECT_EQ(s.triangles.size(), 1u);  // the last is a triangle, and a duplicate
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "t.obj: 4 faces with repeated corners dropped");
}

TEST(LoadObj, BrokenVerticesCostTheFacesThatUseThem) {
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (const char* v : {"v nan 0 0", "v 0 inf 0", "v 0 0 -1e39", "v 0 0 1e999", "v 0 2e9 0", "v -nan(ind) 0 0"}) {
    Scene unused = must_load(three + v + "\nf 1 2 3\n");
    EXPECT_EQ(unused.positions.size(), 3u) << v;
    EXPECT_TRUE(unused.warnings.empty()) << v;
    Scene used = must_load(three + v + "\nf 1 2 3\nf 1 2 4\nf 4 3 2 1\n");
    EXPECT_EQ(used.triangles.size(), 1u);
    EXPECT_EQ(used.positions, unused.positions);
    ASSERT_EQ(used.warnings.size(), 1u);
    EXPECT_EQ(used.warnings[0], "t.obj: 2 faces left out: they use vertices that are not finite or beyond 1e9");
    EXPECT_EQ(error_of(three + v + "\nf 1 2 4\n"),
              "t.obj: no triangles: 1 faces use vertices that are not finite or beyond 1e9");
  }
}

TEST(LoadObj, PartsAreRunsOfObjectAndMaterial) {
  Scene s = must_load(
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no a\nusemtl m\nf 1 2 3\nusemtl n\nf 1 2 4\nusemtl m\nf 1 3 4\n"
      "o b\nf 2 3 4\ng sub\nf 4 3 1\no a\nusemtl m\nf 2 1 4\n");
  ASSERT_EQ(s.parts.size(), 4u);
  EXPECT_EQ(s.parts[0].triangle_count, 3u);
  EXPECT_EQ(s.parts[2].name, "b");
  EXPECT_EQ(s.parts[3].name, "b/sub");
  EXPECT_EQ(s.materials.size(), 1u);
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "t.obj: material \"m\" and 1 more not defined, the default is used");
  for (int c = 0; c < 3; ++c) EXPECT_EQ(s.materials[0].base_color[c], 0.8f);
  EXPECT_EQ(s.materials[0].name, "default");
  EXPECT_TRUE(s.materials[0].double_sided);
}

TEST(LoadObj, VertexColoursAndTextureCoordinates) {
  // sRGB (IEC 61966-2-1): 0.04 lies on the straight piece, which divides by 12.92.
  Scene s = must_load("v 0 0 0 0.04 0.5 2\nv 1 0 0 0 0 0\nv 0 1 0\nvt 0.25 0.75\nvt 2\nvt nan 0\nf 1/1 2/2 3/3\n");
  ASSERT_EQ(s.colors.size(), 3u);
  EXPECT_NEAR(s.colors[0].x, 0.04 / 12.92, 1e-8);
  EXPECT_NEAR(s.colors[0].y, std::pow((0.5 + 0.055) / 1.055, 2.4), 1e-6);
  EXPECT_EQ(s.colors[0].z, 1);
  EXPECT_EQ(s.colors[1], Vec3(0));
  EXPECT_EQ(s.colors[2], Vec3(1));
  EXPECT_EQ(s.texcoords[0], (std::vector<Vec2>{{0.25f, 0.25f}, {2, 1}, {0, 1}}));
  EXPECT_EQ(s.materials[0].base_color, Vec3(1));  // the vertices carry the albedo
}

TEST(LoadObj, GivenNormalsAreKeptRepairedAndObeyed) {
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  Scene s = must_load(three + "vn 0 0.6 0.8\nvn 0 0 0\nvn nan 0 1\nf 1//1 2//2 3//3\n");
  EXPECT_EQ(s.normals[0], Vec3(0, 0.6f, 0.8f));
  EXPECT_EQ(s.normals[1], Vec3(0, 0, 1));
  EXPECT_EQ(s.normals[2], Vec3(0, 0, 1));
  Scene turned = must_load(three + "vn 0 0 -5\nf 1//1 2//1 3//1\n");
  EXPECT_LT(area_normal(turned, turned.triangles[0]).z, 0);
  EXPECT_EQ(turned.normals[0], Vec3(0, 0, -1));
  Scene mixed = must_load(three + "vn 0 0 -1\nvn 0 0 1\nf 1//1 2//1 3//2\n");
  EXPECT_GT(area_normal(mixed, mixed.triangles[0]).z, 0);
}

TEST(LoadObj, NamesBecomeValidUtf8) {
  Scene s = must_load("v 0 0 0\nv 1 0 0\nv 0 1 0\no t\xfcr \xc3\xa9\x01\nf 1 2 3\n");
  EXPECT_EQ(s.parts[0].name, "t\xc3\xbcr \xc3\xa9?");
  EXPECT_EQ(short_name(std::string(1000, 'x')).size(), 256u);
  EXPECT_EQ(short_name(std::string(1000, '\xfc')).size(), 256u);
}

TEST(LoadObj, EveryTruncationGivesASceneOrALine) {
  std::string text = std::string(cube) + "vn 0 0 1\nf 1/1/1 2//1 -6/-1/-1\n";
  for (size_t length = 0; length <= text.size(); ++length) {
    auto scene = load(text.substr(0, length));
    if (scene) {
      EXPECT_EQ(test::broken_invariant(*scene), "");
    } else {
      EXPECT_EQ(scene.error().text().substr(0, 6), "t.obj:");
    }
  }
}

// The polygon, given by corners in the plane, as one OBJ face in a tilted plane.
std::string tilted_face(const std::vector<Vec2>& corners) {
  std::string vertices, face = "f";
  for (size_t i = 0; i < corners.size(); ++i) {
    Vec2 c = corners[i];
    vertices += "v " + std::to_string(0.6f * c.x) + " " + std::to_string(c.y) + " " + std::to_string(0.8f * c.x) + "\n";
    face += " " + std::to_string(i + 1);
  }
  return vertices + face + "\n";
}

double shoelace(const std::vector<Vec2>& p) {
  double sum = 0;
  for (size_t i = 0; i < p.size(); ++i) {
    Vec2 a = p[i], b = p[(i + 1) % p.size()];
    sum += 0.5 * (double(a.x) * double(b.y) - double(a.y) * double(b.x));
  }
  return sum;
}

TEST(LoadObj, ConcavePolygonsKeepTheirArea) {
  std::vector<std::vector<Vec2>> polygons{
      {{0, 0}, {2, 0}, {0.5f, 0.5f}, {0, 2}},                                            // arrow head
      {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}},                  // U
      {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}},                  // corners along the sides
      {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}},  // a hole, bridged
  };
  std::vector<Vec2> star, comb;
  for (int i = 0; i < 200; ++i) {
    float turn = 2 * pi * float(i) / 200, r = i % 2 ? 1.0f : 3.0f;
    star.push_back({r * std::cos(turn), r * std::sin(turn)});
  }
  for (int i = 0; i < 100; ++i) comb.push_back({float(i), i % 2 ? 0.1f : 10.0f});
  comb.push_back({99, -1}), comb.push_back({0, -1});
  std::reverse(comb.begin(), comb.end());
  polygons.push_back(star), polygons.push_back(comb);
  constexpr double rounding = 1e-5;  // six decimals in the file
  for (std::vector<Vec2> p : polygons) {
    for (bool turned : {false, true}) {
      if (turned) std::reverse(p.begin(), p.end());
      Scene s = must_load(tilted_face(p));
      double area = shoelace(p);
      EXPECT_NEAR(test::total_area(s), std::abs(area), rounding * std::abs(area)) << p.size();
      Vec3 up = Vec3(-0.8f, 0, 0.6f) * (area > 0 ? 1.0f : -1.0f);
      for (const Triangle& t : s.triangles) EXPECT_GE(dot(area_normal(s, t), up), -1e-5f);
    }
  }
}

TEST(LoadObj, HugeFacesBecomeFans) {
  std::vector<Vec2> comb;
  for (int i = 0; i < 150'000; ++i) comb.push_back({float(i) * 0.01f, i % 2 ? 0.1f : 10.0f});
  EXPECT_EQ(must_load(tilted_face(comb)).triangles.size(), comb.size() - 2);
}

TEST(Triangulator, EndsWithItsBudget) {
  std::vector<Vec3> comb;
  for (int i = 0; i < 2000; ++i) comb.push_back({float(i) * 0.01f, i % 2 ? 0.1f : 10.0f, 0});
  std::vector<uint32_t> all(comb.size());
  std::iota(all.begin(), all.end(), 0u);
  for (uint64_t budget : {0, 1, 1000, 100'000, 100'000'000}) {
    Triangulator triangulator(budget);
    for (int repeat = 0; repeat < 2; ++repeat) {
      std::vector<std::array<uint32_t, 3>> triangles;
      EXPECT_TRUE(triangulator.cut(all, comb, triangles));
      EXPECT_EQ(triangles.size(), comb.size() - 2);
    }
  }
}

TEST(TakeNumber, ReadsWhatFilesHold) {
  for (auto [text, expected] : {std::pair{"1.5", 1.5},
                                {"+2", 2.0},
                                {"-3e2", -300.0},
                                {".5", 0.5},
                                {"5.", 5.0},
                                {"1e-999", 0.0},
                                {"1e999", INFINITY}}) {
    std::string_view rest = text;
    double value = -1;
    EXPECT_TRUE(take_number(rest, value)) << text;
    EXPECT_EQ(value, expected) << text;
    EXPECT_TRUE(rest.empty()) << text;
  }
  for (std::string_view text : {"", "x", "-", "+", "e5"}) {
    double value;
    EXPECT_FALSE(take_number(text, value));
  }
}

struct DataFile {
  const char* name;
  size_t positions, triangles;
  bool closed;
};

TEST(LoadObj, DataFiles) {
  std::string folder = test::data_folder();
  if (folder.empty()) GTEST_SKIP() << "no data folder";
  for (DataFile file : {DataFile{"bunny.obj", 29'834, 59'664, true},
                        {"bunny_raw_scan.obj", 35'947 - 1'113, 69'451, false},
                        {"armadillo.obj", 43'243, 86'482, true},
                        {"cornell_box.obj", 28, 36, false}}) {
    std::string path = folder + "/meshes/" + file.name;
    auto bytes = MappedFile::open(path);
    ASSERT_TRUE(bytes);
    auto scene = load_obj(bytes->bytes(), path, folder + "/meshes");
    ASSERT_TRUE(scene) << scene.error().text();
    EXPECT_EQ(test::broken_invariant(*scene), "");
    EXPECT_EQ(scene->triangles.size(), file.triangles) << file.name;
    std::set<std::tuple<float, float, float>> distinct;
    for (Vec3 p : scene->positions) distinct.insert({p.x, p.y, p.z});
    EXPECT_EQ(distinct.size(), file.positions) << file.name;
    EXPECT_LT(double(scene->positions.size()), 2.6 * double(file.positions))
        << file.name;  // a cube has 3 normals a corner
    EXPECT_EQ(test::two_sided_count(*scene) == 0, file.closed) << file.name;
    EXPECT_TRUE(scene->warnings.empty());
  }
}

}  // namespace
}  // namespace lambent

#include <lambent/scene/load.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>

#include "temporary_folder.h"
#include "test_meshes.h"

namespace lambent {
namespace {

std::string error_of(const std::string& text) {
  auto scene = load_ply(test::bytes_of(text), "t.ply");
  return scene ? "loaded" : scene.error().text();
}

Scene must_load(const std::string& text) {
  auto scene = load_ply(test::bytes_of(text), "t.ply");
  EXPECT_TRUE(scene) << scene.error().text();
  if (!scene) return test::bare_cube();
  EXPECT_EQ(test::broken_invariant(*scene), "");
  return *scene;
}

template <class T>
std::string raw(T value, bool big) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  if (big != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof(T));
  return std::string(bytes, sizeof(T));
}

const char* const body_header =
    "comment made by hand\nobj_info x\nelement face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\n"
    "element extra 1\nproperty list ushort short numbers\nproperty double more\n"
    "element vertex 5\nproperty double x\nproperty float y\nproperty float z\nproperty list uchar float odd\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nend_header\n";

// A triangle and a quad over five corners of a slanted square, faces first, with properties to be skipped in between.
std::string sample(const std::string& format) {
  std::string out = "ply\nformat " + format + " 1.0\n" + body_header;
  const float y[] = {0, 0, 1, 1, 2};
  const double x[] = {0, 1, 1, 0, 0.5};
  if (format == "ascii") {
    out += "7 4 0 1 2 3\n9 3 3 2 4\n2 -5 6 0.25\n";
    for (int v = 0; v < 5; ++v) {
      out += std::to_string(x[v]) + " " + std::to_string(y[v]) + " " + std::to_string(y[v]) + " 1 0.5 " +
             std::to_string(51 * v) + " 255 0 0.25 0.75\n";
    }
    return out;
  }
  bool big = format == "binary_big_endian";
  auto face = [&](uint8_t flags, std::initializer_list<int32_t> corners) {
    out += raw(flags, big) + raw(uint8_t(corners.size()), big);
    for (int32_t c : corners) out += raw(c, big);
  };
  face(7, {0, 1, 2, 3}), face(9, {3, 2, 4});
  out += raw(uint16_t(2), big) + raw(int16_t(-5), big) + raw(int16_t(6), big) + raw(0.25, big);
  for (int v = 0; v < 5; ++v) {
    out += raw(x[v], big) + raw(y[v], big) + raw(y[v], big) + raw(uint8_t(1), big) + raw(0.5f, big);
    out += raw(uint8_t(51 * v), big) + raw(uint8_t(255), big) + raw(uint8_t(0), big) + raw(0.25f, big) +
           raw(0.75f, big);
  }
  return out;
}

TEST(LoadPly, AllFormatsGiveTheSame) {
  constexpr float rounding = 1e-6f;
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    Scene s = must_load(sample(format));
    EXPECT_EQ(s.triangles.size(), 3u);
    ASSERT_EQ(s.positions.size(), 5u);
    EXPECT_EQ(s.positions[4], Vec3(0.5f, 2, 2));
    EXPECT_EQ(s.texcoords[0][2], Vec2(0.25f, 0.25f));
    // 51 of 255 is 0.2; decoded by the sRGB formula.
    EXPECT_NEAR(s.colors[1].x, std::pow((0.2f + 0.055f) / 1.055f, 2.4f), rounding);
    EXPECT_NEAR(s.colors[1].y, 1, rounding);
    for (Vec3 n : s.normals) EXPECT_LT(distance(n, normalize(Vec3(0, -1, 1))), rounding);
    EXPECT_EQ(s.parts.size(), 1u);
    EXPECT_EQ(s.parts[0].name, "t");
    EXPECT_EQ(s.materials[0].base_color, Vec3(1));
    EXPECT_TRUE(s.materials[0].double_sided);
  }
}

TEST(LoadPly, EveryTruncationIsRefused) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    std::string whole = sample(format);
    bool text = std::string_view(format) == "ascii";
    for (size_t length = 0; length < whole.size(); ++length) {
      auto scene = load_ply(test::bytes_of(whole.substr(0, length)), "t.ply");
      // Text whose last number alone has lost digits or the line's end still is whole.
      if (text && length + 8 >= whole.size() && scene) continue;
      ASSERT_FALSE(scene) << format << " " << length;
      EXPECT_EQ(scene.error().text().substr(0, 6), "t.ply:");
    }
  }
}

TEST(LoadPly, LineEndsOfAllKinds) {
  std::string text = sample("ascii");
  for (const char* end : {"\r\n", "\r"}) {
    std::string other;
    for (char c : text) other += c == '\n' ? std::string(end) : std::string(1, c);
    EXPECT_EQ(must_load(other).positions, must_load(text).positions);
  }
  std::string header =
      "ply\r\nformat binary_little_endian 1.0\r\nelement vertex 3\r\n"
      "property uchar x\r\nproperty char y\r\nproperty short z\r\n"
      "element face 1\r\nproperty list uint ushort vertex_index\r\nend_header\r\n";
  std::string body("\0\0\0\0\x0a\0\0\0\0\x0a\0\0\x03\0\0\0\0\0\x01\0\x02\0", 22);
  EXPECT_EQ(must_load(header + body).positions[1], Vec3(10, 0, 0));
}

std::string triangle(const std::string& vertices, const std::string& faces, const std::string& properties = "") {
  return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
         properties + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + vertices + faces;
}

TEST(LoadPly, RefusesWithTheReason) {
  const std::string three = "0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_EQ(error_of(triangle(three, "3 0 1 2\n")), "loaded");
  EXPECT_EQ(error_of(triangle(three, "3 0 1 3\n")), "t.ply:13: face 0 names vertex 3 of 3");
  EXPECT_EQ(error_of(triangle(three, "3 0 1 -1\n")), "t.ply:13: face 0 names vertex -1 of 3");
  EXPECT_EQ(error_of(triangle(three, "3 0 1 1.5\n")), "t.ply:13: face 0 names vertex 1.5 of 3");
  EXPECT_EQ(error_of(triangle(three, "3 0 1 nan\n")), "t.ply:13: face 0 names vertex nan of 3");
  EXPECT_EQ(error_of(triangle("0 0 0\n1 nan 0\n0 1 0\n", "3 0 1 2\n")),
            "t.ply: no triangles: 1 faces use vertices that are not finite or beyond 1e9");
  EXPECT_EQ(error_of(triangle("0 0 0\n1 q 0\n0 1 0\n", "3 0 1 2\n")),
            "t.ply:11: the file ends or holds something that is not a number in vertex 1");
  EXPECT_EQ(error_of(triangle(three, "0\n")), "t.ply: no triangles");
  EXPECT_EQ(error_of("obj\n"), "t.ply:1: is not a PLY file");
  EXPECT_EQ(error_of("ply\nformat ascii 1.0\nend_header\n"), "t.ply: no vertex positions");
  EXPECT_EQ(error_of("ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"),
            "t.ply:3: triangle strips are not supported, faces are");
  EXPECT_EQ(error_of("ply\nformat ascii 2.0\n"), "t.ply:2: version is not 1.0");
  EXPECT_EQ(error_of("ply\nproperty float x\n"), "t.ply:2: property before the first element");
  EXPECT_EQ(error_of("ply\nelement vertex 3\nproperty half x\n"), "t.ply:3: unknown property type");
  EXPECT_EQ(error_of("ply\nelement vertex 3\nelement vertex 3\n"), "t.ply:3: element vertex comes twice");
  EXPECT_EQ(error_of("ply\nelement face 3\nproperty list float int vertex_indices\n"),
            "t.ply:3: a list's count must be of a whole-number type");
}

TEST(LoadPly, CountsThatLieAreFoundBeforeAnythingIsSetAside) {
  for (const char* format : {"ascii", "binary_little_endian"}) {
    const std::string xyz = "property float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    const std::string list = "property list uchar int vertex_indices\nend_header\n3 0 0 0\n";
    for (const char* count : {"1000000", "4294967295", "4294967296", "18446744073709551615"}) {
      std::string start = "ply\nformat " + std::string(format) + " 1.0\n";
      EXPECT_EQ(error_of(start + "element vertex " + count + "\n" + xyz),
                "t.ply:3: the file is too short for " + std::string(count) + " vertex elements");
      EXPECT_NE(error_of(start + "element face " + count + "\n" + list), "loaded");
      EXPECT_NE(error_of(start + "element nothing " + count + "\nend_header\n0 0 0\n"), "loaded");
    }
  }
  for (const char* count : {"99999999999999999999", "-1", "3x", ""}) {
    EXPECT_EQ(error_of("ply\nformat ascii 1.0\nelement vertex " + std::string(count) + "\n"),
              "t.ply:3: element count is not a whole number");
  }
  // A list of 2^32 - 1 corners in a few bytes.
  std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
      "property uchar x\nproperty uchar y\nproperty uchar z\n"
      "element face 1\nproperty list uint uchar vertex_indices\nend_header\n";
  EXPECT_EQ(error_of(header + std::string("\0\0\0\xff\xff\xff\xff\0\0\0", 10)), "t.ply: the file ends in face 0");
  EXPECT_EQ(error_of(header + std::string("\0\0\0\xfe\xff\xff\xff\0\0\0", 10)), "t.ply: the file ends in face 0");
}

TEST(LoadPly, NormalsColoursAndStrayVertices) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nproperty float red\nproperty float green\nproperty "
      "float blue\n"
      "element face 2\nproperty list uchar int vertex_index\nend_header\n"
      "9 9 9 0 0 1 0 0 0\n0 0 0 0 0 -2 0.25 0.5 7\n1 0 0 0 0 -1 0 0 0\n8 8 8 0 0 1 0 0 0\n0 1 0 0 0 -1 1 1 1\n3 1 2 "
      "4\n3 1 2 2\n";
  Scene s = must_load(text);
  ASSERT_EQ(s.positions.size(), 3u);
  EXPECT_EQ(s.normals[0], Vec3(0, 0, -1));
  EXPECT_LT(area_normal(s, s.triangles[0]).z, 0);  // turned to its normals
  EXPECT_EQ(s.colors[0], Vec3(0.25f, 0.5f, 1));    // floats are linear
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "t.ply: 1 faces with repeated corners dropped");
}

// A depth camera's frame: a grid of n x n points, of which those within a circle are missing.
std::string frame(int n, const std::string& format, const char* missing, bool faces_use_them) {
  auto is_missing = [&](int i) { return std::hypot(i % n - n / 2, i / n - n / 2) < n / 4; };
  std::string points, faces;
  int count = 0;
  bool text = format == "ascii", big = format == "binary_big_endian";
  for (int i = 0; i < n * n; ++i) {
    for (int k = 0; k < 3; ++k) {
      float x = k == 0 ? float(i % n) : k == 1 ? 0.25f : float(i / n);
      if (is_missing(i)) x = std::strtof(missing, nullptr);
      points += text ? fmt::format("{} ", x) : raw(x, big);
    }
    if (text) points += "\n";
    int corners[4] = {i, i + n, i + n + 1, i + 1};
    if (i % n == n - 1 || i / n == n - 1) continue;
    bool broken = std::any_of(corners, corners + 4, is_missing);
    if (broken && !faces_use_them) continue;
    ++count;
    faces += text ? "4" : raw(uint8_t(4), big);
    for (int c : corners) faces += text ? fmt::format(" {}", c) : raw(c, big);
    if (text) faces += "\n";
  }
  return fmt::format(
             "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
             "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
             format, n * n, count) +
         points + faces;
}

TEST(LoadPly, MissingPointsDoNoHarm) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* missing : {"nan", "inf", "-1e30"}) {
      Scene s = must_load(frame(16, format, missing, false));
      EXPECT_TRUE(s.warnings.empty());
      Scene used = must_load(frame(16, format, missing, true));
      EXPECT_EQ(used.positions, s.positions);
      EXPECT_EQ(used.triangles.size(), s.triangles.size());
      ASSERT_EQ(used.warnings.size(), 1u);
      size_t left_out = 15 * 15 - s.triangles.size() / 2;
      EXPECT_EQ(used.warnings[0],
                fmt::format("t.ply: {} faces left out: they use vertices that are not finite or beyond 1e9", left_out));
    }
  }
}

// A square of two triangles whose halves show the two ends of a picture: by MeshLab's lists at the faces, by vertices
// that come twice, and as OBJ.
TEST(LoadPly, TextureCoordinatesAtFaces) {
  test::TemporaryFolder folder;
  folder.write("red blue.png", test::tiny_png());
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n",
                    square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n",
                    head = "ply\nformat ascii 1.0\ncomment VCGLIB generated\ncomment TextureFile red blue.png\n";
  auto at_faces = [&](const std::string& lists) {
    return head + "element vertex 4\n" + xyz +
           "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
           "property int texnumber\nend_header\n" +
           square + lists;
  };
  const std::string by_faces = at_faces("3 0 1 2 6 0.25 0 0 0 0.5 1 0\n3 0 2 3 6 0.75 0 1 1 1 0.5 0\n");
  const std::string by_vertices =
      head + "element vertex 6\n" + xyz + "property float s\nproperty float t\nelement face 2\n" +
      "property list uchar int vertex_indices\nend_header\n0 0 0 0.25 0\n1 0 0 0 0\n1 1 0 0.5 1\n0 0 0 0.75 0\n"
      "1 1 0 1 1\n0 1 0 1 0.5\n3 0 1 2\n3 3 4 5\n";
  const std::string obj =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0\nvt 0 0\nvt 0.5 1\nvt 0.75 0\nvt 1 1\nvt 1 0.5\n"
      "f 1/1 2/2 3/3\nf 1/4 3/5 4/6\n";
  auto corners = [](const Scene& s) {  // position and coordinates of each corner
    std::vector<std::pair<Vec3, Vec2>> out;
    for (const Triangle& t : s.triangles)
      for (uint32_t v : t.v) out.push_back({s.positions[v], s.texcoords[0][v]});
    return out;
  };
  auto truth = load_obj(test::bytes_of(obj), "t.obj", "");
  ASSERT_TRUE(truth);
  for (const std::string& text : {by_faces, by_vertices}) {
    auto s = load_ply(test::bytes_of(text), "t.ply", folder.path.string());
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(test::broken_invariant(*s), "");
    EXPECT_TRUE(s->warnings.empty()) << s->warnings[0];
    EXPECT_EQ(corners(*s), corners(*truth));
    ASSERT_EQ(s->textures.size(), 1u);
    EXPECT_EQ(s->materials[0].base_color_texture, 0);
    EXPECT_EQ(s->materials[0].base_color, Vec3(1));
    EXPECT_EQ(albedo(*s, s->triangles[0], 0, 0), Vec3(1, 0, 0));
    EXPECT_EQ(albedo(*s, s->triangles[1], 0, 0), Vec3(0, 0, 1));
  }
  // Without its picture, and lists that do not fit.
  Scene lost = must_load(by_faces);
  EXPECT_EQ(lost.materials[0].base_color, Vec3(0.8f));
  EXPECT_EQ(lost.warnings.size(), 1u);
  auto odd = load_ply(test::bytes_of(at_faces("3 0 1 2 0 0\n3 0 2 3 5 1 2 3 4 5 0\n")), "t.ply", folder.path.string());
  ASSERT_TRUE(odd);
  ASSERT_EQ(odd->warnings.size(), 1u);
  EXPECT_EQ(odd->warnings[0], "t.ply: 2 faces do not have a texture coordinate a corner");
}

TEST(LoadPly, FacesOfSeveralTextures) {
  test::TemporaryFolder folder;
  folder.write("a.png", test::tiny_png()), folder.write("b.png", test::tiny_png());
  std::string text =
      "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 4\n"
      "property float x\nproperty float y\nproperty float z\nelement face 3\nproperty list uchar int vertex_indices\n"
      "property list uchar float texcoord\nproperty int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
      "3 0 1 2 6 0 0 0 0 0 0 1\n3 0 2 3 6 0 0 0 0 0 0 0\n3 1 2 3 6 0 0 0 0 0 0 -1\n";
  auto s = load_ply(test::bytes_of(text), "t.ply", folder.path.string());
  ASSERT_TRUE(s) << s.error().text();
  EXPECT_EQ(test::broken_invariant(*s), "");
  ASSERT_EQ(s->parts.size(), 3u);
  EXPECT_EQ(s->materials[s->parts[0].material].name, "a.png");
  EXPECT_EQ(s->materials[s->parts[1].material].name, "b.png");
  EXPECT_EQ(s->materials[s->parts[2].material].base_color_texture, -1);
  EXPECT_EQ(s->materials[s->parts[2].material].base_color, Vec3(0.8f));
}

TEST(LoadPly, DataFile) {
  std::string folder = test::data_folder();
  if (folder.empty()) GTEST_SKIP() << "no data folder";
  std::string path = folder + "/meshes/scorpion_loop1_200k.ply";
  auto bytes = MappedFile::open(path);
  ASSERT_TRUE(bytes);
  auto scene = load_ply(bytes->bytes(), path);
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(test::broken_invariant(*scene), "");
  EXPECT_EQ(scene->triangles.size(), 399'960u);
  EXPECT_GE(scene->positions.size(), 199'982u);
  EXPECT_LT(scene->positions.size(), 202'000u);  // few creases on a subdivided surface
  EXPECT_EQ(test::two_sided_count(*scene), 0u);
}

// As the nearest byte that there is: 0 and 255.
TEST(LoadPly, BytesOfTextsAreKeptWithinBytes) {
  const Scene s = must_load(
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n"
      "0 0 0 1e300 -1e300 255\n1 0 0 256 -1 0\n0 1 0 255 0 0\n3 0 1 2\n");
  ASSERT_EQ(s.colors.size(), 3u);
  EXPECT_EQ(s.colors[0], Vec3(1, 0, 1));
  EXPECT_EQ(s.colors[1], Vec3(1, 0, 0));
  EXPECT_EQ(s.colors[2], Vec3(1, 0, 0));
}

}  // namespace
}  // namespace lambent

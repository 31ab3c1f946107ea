// glTF without normals: flat, with no more vertices than that takes.
#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace lambent {
namespace {

using namespace test;

// Each corner of each triangle a vertex of its own, and no normals.
struct Loose {
  std::vector<float> positions, texcoords;
  std::vector<uint8_t> joints;
  void add(std::initializer_list<Vec3> corners, uint8_t joint = 0, Vec2 shift = Vec2(0)) {
    for (Vec3 p : corners) {
      positions.insert(positions.end(), {p.x, p.y, p.z});
      texcoords.insert(texcoords.end(), {p.x + shift.x, p.z + shift.y});
      joints.insert(joints.end(), {joint, 0, 0, 0});
    }
  }
  void quad(Vec3 a, Vec3 b, Vec3 c, Vec3 d) { add({a, b, c}), add({a, c, d}); }
  Builder builder() const {
    Builder b;
    b.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", b.floats(positions, "VEC3")}}}}}}}};
    b.json["nodes"] = {{{"mesh", 0}}};
    return b;
  }
  Json& attributes(Builder& b) const { return b.json["meshes"][0]["primitives"][0]["attributes"]; }
};

Scene must_load(const Builder& b) {
  auto scene = b.load();
  EXPECT_TRUE(scene) << scene.error().text();
  if (!scene) return bare_cube();
  EXPECT_EQ(broken_invariant(*scene), "");
  EXPECT_EQ(scene->input.size(), scene->positions.size());
  // Each number of the input is there.
  const std::set<uint32_t> numbers(scene->input.begin(), scene->input.end());
  EXPECT_EQ(numbers.size(), scene->input_count);
  EXPECT_EQ(*numbers.rbegin() + 1, scene->input_count);
  return *scene;
}

Loose grid(int n) {
  Loose out;
  for (int x = 0; x < n; ++x)
    for (int z = 0; z < n; ++z) out.quad(Vec3(x, 0, z), Vec3(x, 0, z + 1), Vec3(x + 1, 0, z + 1), Vec3(x + 1, 0, z));
  return out;
}

TEST(FlatGltf, ACubeHas24Vertices) {
  Loose loose;
  const Scene cube = bare_cube();
  for (const Triangle& t : cube.triangles)
    loose.add({cube.positions[t.v[0]], cube.positions[t.v[1]], cube.positions[t.v[2]]});
  const Scene s = must_load(loose.builder());
  EXPECT_EQ(s.positions.size(), 24u);
  EXPECT_EQ(s.input_count, 24u);
  for (const Triangle& t : s.triangles)
    for (uint32_t v : t.v) EXPECT_LT(length(s.normals[v] - unit_normal(s, t)), 1e-6f);
  // As from a file that shares its eight, but for what the input has.
  Builder shared;
  std::vector<float> positions;
  std::vector<uint16_t> indices;
  for (Vec3 p : cube.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
  for (const Triangle& t : cube.triangles) indices.insert(indices.end(), t.v, t.v + 3);
  shared.json["meshes"] = {
      {{"primitives",
        {{{"attributes", {{"POSITION", shared.floats(positions, "VEC3")}}}, {"indices", shared.indices(indices)}}}}}};
  shared.json["nodes"] = {{{"mesh", 0}}};
  const Scene eight = must_load(shared);
  EXPECT_EQ(eight.positions.size(), 24u);
  EXPECT_EQ(eight.input_count, 8u);
}

TEST(FlatGltf, AGridHasItsPoints) {
  const Loose loose = grid(9);
  EXPECT_EQ(loose.positions.size() / 3, 6u * 81);
  const Scene s = must_load(loose.builder());
  EXPECT_EQ(s.positions.size(), 100u);
  EXPECT_EQ(s.triangles.size(), 162u);
  EXPECT_EQ(total_area(s), 81.0);
}

TEST(FlatGltf, WhatDiffersStaysApart) {
  Loose loose;
  const Vec3 a(0), b(0, 0, 1), c(1, 0, 1), d(1, 0, 0);
  auto count = [&](bool texcoords, bool joints) {
    Builder builder = loose.builder();
    // A set that nothing reads, and joints without a skin: the writer would copy them.
    if (texcoords) loose.attributes(builder)["TEXCOORD_3"] = builder.floats(loose.texcoords, "VEC2");
    if (joints) loose.attributes(builder)["JOINTS_0"] = builder.accessor(loose.joints, type_u8, "VEC4");
    return must_load(builder).positions.size();
  };
  loose.add({a, b, c}), loose.add({a, c, d});
  EXPECT_EQ(count(false, false), 4u);
  EXPECT_EQ(count(true, true), 4u);
  loose = {};
  loose.add({a, b, c}), loose.add({a, c, d}, 0, Vec2(0.5f, 0));
  EXPECT_EQ(count(false, true), 4u);
  EXPECT_EQ(count(true, false), 6u);
  loose = {};
  loose.add({a, b, c}), loose.add({a, c, d}, 1);
  EXPECT_EQ(count(true, false), 4u);
  EXPECT_EQ(count(false, true), 6u);
}

TEST(FlatGltf, MorphTargetsCount) {
  Loose loose;
  loose.quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(1, 0, 0));
  for (bool differ : {false, true}) {
    Builder b = loose.builder();
    std::vector<float> moved(18, 0.0f);
    if (differ) moved[1] = 1;
    b.json["meshes"][0]["primitives"][0]["targets"] = Json::array({{{"POSITION", b.floats(moved, "VEC3")}}});
    EXPECT_EQ(must_load(b).positions.size(), differ ? 5u : 4u);
  }
}

// Several primitives, with normals and without, in any order: each has its own runs, and what is written is read again
// as it was.
TEST(FlatGltf, StandsBesideOthers) {
  const Loose loose = grid(3);
  Builder b = triangle();
  Json bare = {{"attributes",
                {{"POSITION", b.floats(loose.positions, "VEC3")}, {"TEXCOORD_0", b.floats(loose.texcoords, "VEC2")}}}};
  b.json["meshes"].push_back({{"primitives", Json::array({bare})}});
  b.json["nodes"].push_back({{"mesh", 1}, {"translation", {0, 5, 0}}});
  b.json["nodes"].push_back({{"mesh", 0}, {"translation", {0, 9, 0}}});
  b.json["nodes"].push_back({{"mesh", 1}, {"scale", {-1, 1, 1}}});
  const Scene s = must_load(b);
  ASSERT_EQ(s.parts.size(), 4u);
  EXPECT_EQ(s.positions.size(), 3u + 16 + 3 + 16);
  EXPECT_EQ(s.input_count, s.positions.size());
  EXPECT_EQ(s.texcoords[0].size(), s.positions.size());
  TemporaryFolder folder;
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), s, {}, {}));
  auto back = load_scene(folder.file("a.glb"));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->positions, s.positions);
  EXPECT_EQ(back->normals, s.normals);
  EXPECT_EQ(back->texcoords, s.texcoords);
}

}  // namespace
}  // namespace lambent

// Files that lie, are cut or go in circles.
#include <lambent/core/random.h>
#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

// What every scene that loads must keep to.
void expect_valid(const Result<Scene>& loaded) {
  if (!loaded) {
    ASSERT_FALSE(loaded.error().text().empty());
    return;
  }
  const Scene& s = *loaded;
  ASSERT_EQ(s.normals.size(), s.positions.size());
  ASSERT_FALSE(s.triangles.empty());
  ASSERT_FALSE(s.materials.empty());
  for (const auto& uv : s.texcoords) ASSERT_TRUE(uv.empty() || uv.size() == s.positions.size());
  ASSERT_TRUE(s.colors.empty() || s.colors.size() == s.positions.size());
  for (const Triangle& t : s.triangles) {
    ASSERT_LT(t.part, s.parts.size());
    for (uint32_t v : t.v) ASSERT_LT(v, s.positions.size());
    Vec3 c = albedo(s, t, 0.3f, 0.3f);
    ASSERT_TRUE(is_finite(c));
  }
  for (const Part& p : s.parts) ASSERT_LT(p.material, s.materials.size());
  for (Vec3 n : s.normals) ASSERT_NEAR(dot(n, n), 1.0f, 1e-5f);  // unit up to float rounding
}

Builder rich() {  // something of everything
  Builder b = triangle();
  auto& attributes = primitive(b)["attributes"];
  attributes["TEXCOORD_0"] = b.floats({0, 0, 1, 0, 0, 1}, "VEC2");
  attributes["COLOR_0"] =
      b.accessor(std::vector<uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, type_u8, "VEC4", true);
  attributes["JOINTS_0"] = b.accessor(std::vector<uint8_t>{0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, type_u8, "VEC4");
  attributes["WEIGHTS_0"] = b.floats({0.25f, 0.75f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  primitive(b)["targets"] = {{{"POSITION", b.floats({0, 0, 1, 0, 0, 2, 0, 0, 3}, "VEC3")}}};
  primitive(b)["material"] = 0;
  b.json["meshes"][0]["weights"] = {0.5};
  b.json["nodes"] = {
      {{"mesh", 0}, {"skin", 0}}, {{"translation", {1, 2, 3}}, {"children", {2}}}, {{"scale", {1, 2, 1}}}};
  b.json["skins"] = {{{"joints", {1, 2}}}};
  b.json["scenes"] = {{{"nodes", {0, 1}}}};
  b.json["scene"] = 0;
  b.json["images"] = {{{"bufferView", b.view(make_png(1, 1, 3, 8, {9, 8, 7}))}, {"mimeType", "image/png"}}};
  b.json["textures"] = {{{"source", 0}}};
  b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  size_t at = b.view(std::vector<uint8_t>{1}), values = b.view(std::vector<float>{3, 1, 0});
  b.json["accessors"][0]["sparse"] = {{"count", 1},
                                      {"indices", {{"bufferView", at}, {"componentType", type_u8}}},
                                      {"values", {{"bufferView", values}}}};
  return b;
}

TEST(HostileGltf, EveryTruncationIsAnError) {
  ASSERT_EQ(message(rich()), "loaded");
  for (const Bytes& file : {rich().glb(), rich().gltf()}) {
    for (size_t n = 0; n < file.size(); ++n) {
      Bytes cut(file.begin(), file.begin() + ptrdiff_t(n));  // its own allocation, so that a sanitizer sees an overrun
      ASSERT_FALSE(load_gltf(cut, "cut", "")) << n << " bytes of " << file.size();
    }
  }
}

TEST(HostileGltf, ChangedBytesGiveAnErrorOrAValidScene) {
  const Bytes glb = rich().glb(), text = rich().gltf();
  for (const Bytes* file : {&glb, &text}) {
    Random random(7);
    for (int i = 0; i < 3000; ++i) {
      Bytes changed = *file;
      for (int k = 0; k < 1 + i % 3; ++k) changed[random.next64() % changed.size()] = uint8_t(random.next64());
      auto scene = load_gltf(changed, "changed", "");
      SCOPED_TRACE(i);
      ASSERT_NO_FATAL_FAILURE(expect_valid(scene));
    }
  }
}

TEST(HostileGltf, EveryValueOfAnyTypeIsCheckedOrIgnored) {
  // Replaces each value in the document, one at a time, by values of every JSON type.
  const Builder good = rich();
  const Json flat = good.finished().flatten();
  const std::vector<Json> others = {nullptr,           true,        -1,     1.5,           1e300,
                                    uint64_t{1} << 63, 4000000000u, "text", Json::array(), Json::object()};
  for (auto item = flat.begin(); item != flat.end(); ++item) {
    for (Json::json_pointer at(item.key()); !at.empty(); at.pop_back()) {
      for (const Json& other : others) {
        Json json = good.finished();
        json[at] = other;
        SCOPED_TRACE(at.to_string() + " = " + other.dump());
        ASSERT_NO_FATAL_FAILURE(expect_valid(load_gltf(make_glb(json, good.binary), "odd", "")));
      }
      Json json = good.finished();
      Json::json_pointer parent = at.parent_pointer();
      if (json[parent].is_object()) json[parent].erase(at.back());
      SCOPED_TRACE(at.to_string() + " erased");
      ASSERT_NO_FATAL_FAILURE(expect_valid(load_gltf(make_glb(json, good.binary), "odd", "")));
    }
  }
}

TEST(HostileGltf, IndicesOutOfRange) {
  Builder b = triangle();
  primitive(b)["indices"] = b.indices({0, 1, 3});
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: index 2 is 3, but there are 3 vertices");
  primitive(b)["indices"] = 99;
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: indices is 99, out of range");
  primitive(b)["indices"] = 0;
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: indices are not unsigned integers");
  primitive(b).erase("indices");
  primitive(b)["material"] = 0;
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: material is 0, out of range");
}

TEST(HostileGltf, PositionsThatAreNotFinite) {
  for (float bad : {NAN, INFINITY, -INFINITY}) {
    Builder b = triangle();
    primitive(b)["attributes"]["POSITION"] = b.floats({0, 0, 0, 2, bad, 0, 0, 1, 0}, "VEC3");
    EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: vertex 1 is not at a finite position or beyond 1e9");
  }
  Builder b = triangle();
  b.json["nodes"][0]["scale"] = {1e300, 1, 1};
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: vertex 1 is not at a finite position or beyond 1e9");
}

TEST(HostileGltf, BrokenNormalsAreMade) {
  Builder b = triangle();
  primitive(b)["attributes"]["NORMAL"] = b.floats({0, 0, 0, NAN, 0, 0, 0, 0, 5}, "VEC3");
  auto scene = b.load();
  ASSERT_TRUE(scene);
  for (Vec3 n : scene->normals) EXPECT_EQ(n, Vec3(0, 0, 1));
}

TEST(HostileGltf, LyingLengthsAndCounts) {
  auto with = [](const std::string& pointer, const Json& value) {
    Builder b = triangle();
    Json json = b.finished();
    json[Json::json_pointer(pointer)] = value;
    auto scene = load_gltf(make_glb(json, b.binary), "t", "");
    return scene ? "loaded" : scene.error().text();
  };
  const uint64_t huge = UINT64_MAX;
  EXPECT_EQ(with("/buffers/0/byteLength", 1000), "t: buffer 0: is truncated: has 80 of 1000 bytes");
  EXPECT_EQ(with("/buffers/0/byteLength", 40), "t: buffer view 1: reaches past the end of buffer 0");
  EXPECT_EQ(with("/bufferViews/0/byteLength", 1000), "t: buffer view 0: reaches past the end of buffer 0");
  EXPECT_EQ(with("/bufferViews/0/byteOffset", huge - 1), "t: buffer view 0: reaches past the end of buffer 0");
  EXPECT_EQ(with("/bufferViews/0/byteLength", huge - 1), "t: buffer view 0: reaches past the end of buffer 0");
  EXPECT_EQ(with("/bufferViews/0/buffer", 1), "t: buffer view 0: buffer is 1, out of range");
  EXPECT_EQ(with("/bufferViews/0/byteStride", 4), "t: accessor 0: has elements larger than their stride");
  EXPECT_EQ(with("/bufferViews/0/byteStride", 252), "t: accessor 0: reaches past the end of buffer view 0");
  EXPECT_EQ(with("/bufferViews/0/byteStride", 256), "t: buffer view 0: byteStride is 256, out of range");
  EXPECT_EQ(with("/accessors/0/count", 4), "t: accessor 0: reaches past the end of buffer view 0");
  EXPECT_EQ(with("/accessors/0/count", 4294967295u), "t: accessor 0: reaches past the end of buffer view 0");
  EXPECT_EQ(with("/accessors/0/byteOffset", huge),
            "t: accessor 0: byteOffset is " + std::to_string(huge) + ", out of range");
  EXPECT_EQ(with("/accessors/0/byteOffset", huge - 1), "t: accessor 0: reaches past the end of buffer view 0");
  EXPECT_EQ(with("/accessors/0/byteOffset", 4), "t: accessor 0: reaches past the end of buffer view 0");
  EXPECT_EQ(with("/accessors/0/type", "VEC9"), "t: accessor 0: type \"VEC9\" does not exist");
  EXPECT_EQ(with("/accessors/0/type", "VEC2"),
            "t: mesh 0, primitive 0: POSITION is not three floats or small integers");
  EXPECT_EQ(with("/accessors/0/componentType", 5124), "t: accessor 0: componentType 5124 does not exist");
  EXPECT_EQ(with("/accessors/1/count", 2), "t: mesh 0, primitive 0: NORMAL has 2 elements, but there are 3 vertices");
}

TEST(HostileGltf, SmallFilesDoNotGrowLarge) {
  Builder b = triangle();  // zeros without a buffer view
  size_t zeros = b.accessor({{"componentType", type_f32}, {"count", 4000000000u}, {"type", "VEC3"}});
  primitive(b) = {{"attributes", {{"POSITION", zeros}}}};
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: too many vertices or indices have no bytes in a buffer");
  b = triangle();
  primitive(b)["indices"] = b.accessor({{"componentType", type_u32}, {"count", 4000000000u}, {"type", "SCALAR"}});
  EXPECT_EQ(message(b), "test.glb: mesh 0, primitive 0: too many vertices or indices have no bytes in a buffer");

  b = triangle();  // one mesh, many primitives, many nodes
  Json p = primitive(b), many = Json::array(), nodes = Json::array();
  for (int i = 0; i < 2000; ++i) many.push_back({{"attributes", Json::object()}}), nodes.push_back({{"mesh", 0}});
  b.json["meshes"][0]["primitives"] = many, b.json["nodes"] = nodes;
  EXPECT_EQ(message(b), "test.glb: has more than 1048576 primitives to show");

  b = triangle();  // few vertices, each moved by many targets, counts as many vertices
  const size_t count = size_t{1} << 17, target_count = 2100;
  size_t positions = b.floats(std::vector<float>(3 * count, 1.0f), "VEC3");
  primitive(b) = {{"attributes", {{"POSITION", positions}}}, {"targets", Json::array()}};
  for (size_t i = 0; i < target_count; ++i) primitive(b)["targets"].push_back({{"POSITION", positions}});
  b.json["meshes"][0]["weights"] = std::vector<double>(target_count, 1.0);
  EXPECT_NE(message(b).find("the scene expands to more than 268435456 vertices"), std::string::npos);
}

TEST(HostileGltf, NodeHierarchiesThatAreNoTrees) {
  Builder b = triangle();
  b.json["nodes"] = {{{"mesh", 0}}, {{"children", {2}}}, {{"children", {1}}}};
  EXPECT_EQ(message(b), "test.glb: the node hierarchy has a cycle");
  b.json["nodes"] = {{{"mesh", 0}, {"children", {0}}}};
  EXPECT_EQ(message(b), "test.glb: the node hierarchy has a cycle");
  b.json["nodes"] = {{{"mesh", 0}}, {{"children", {0}}}, {{"children", {0}}}};
  EXPECT_EQ(message(b), "test.glb: node 0: is a child of two nodes, 1 and 2");
  b.json["nodes"] = {{{"mesh", 0}}, {{"children", {0, 0}}}};
  EXPECT_EQ(message(b), "test.glb: node 0: is a child of two nodes, 1 and 1");
  b.json["nodes"] = {{{"mesh", 0}}, {{"children", {7}}}};
  EXPECT_EQ(message(b), "test.glb: node 1: a child is 7, out of range");
}

TEST(HostileGltf, LongChainsOfNodesDoNotRecurse) {
  Builder b = triangle();
  const size_t length = 20000;
  b.json["nodes"] = Json::array();
  for (size_t i = 0; i < length; ++i) b.json["nodes"].push_back({{"children", {i + 1}}, {"translation", {0, 0, 0.5}}});
  b.json["nodes"].push_back({{"mesh", 0}});
  auto scene = b.load();
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->positions[0], Vec3(0, 0, 10000));
}

TEST(HostileGltf, RequiredExtensionsAndVersions) {
  Builder b = triangle();
  b.json["extensionsRequired"] = {"KHR_materials_unlit", "EXT_acme"};
  EXPECT_EQ(message(b), "test.glb: needs the extension \"EXT_acme\", which is not supported");
  b.json["extensionsRequired"] = {"KHR_materials_unlit", "KHR_lights_punctual", "KHR_texture_transform",
                                  "LAMBENT_transfer"};
  EXPECT_EQ(message(b), "loaded");
  b.json["asset"]["minVersion"] = "2.1";
  EXPECT_EQ(message(b), "test.glb: asks for glTF \"2.1\"; only 2.0 is supported");
  b.json["asset"] = {{"version", "1.0"}};
  EXPECT_EQ(message(b), "test.glb: glTF version \"1.0\" is not supported, only 2");
  b.json.erase("asset");
  EXPECT_EQ(message(b), "test.glb: not glTF: asset.version is missing");
}

TEST(HostileGltf, ScenesWithoutTriangles) {
  Builder b = triangle();
  b.json["nodes"] = Json::array();
  EXPECT_EQ(message(b), "test.glb: no triangles");
  b = triangle();
  primitive(b)["indices"] = b.indices({0, 1, 1});
  EXPECT_EQ(message(b), "test.glb: no triangles");
  b = triangle();
  b.json["nodes"][0]["scale"] = {1, 0, 1};
  EXPECT_EQ(message(b), "test.glb: no triangles that have an area");
  b = triangle();
  primitive(b)["mode"] = 0;
  EXPECT_EQ(message(b), "test.glb: no triangles");
}

}  // namespace
}  // namespace lambent

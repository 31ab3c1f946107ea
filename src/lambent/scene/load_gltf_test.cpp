#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

TEST(LoadGltf, Triangle) {
  Scene s = loaded(triangle());
  ASSERT_EQ(s.positions.size(), 3u);
  EXPECT_EQ(s.positions[1], Vec3(2, 0, 0));
  EXPECT_EQ(s.normals[2], Vec3(0, 0, 1));
  ASSERT_EQ(s.triangles.size(), 1u);
  EXPECT_EQ(s.triangles[0].v[2], 2u);
  EXPECT_FALSE(s.triangles[0].two_sided);
  ASSERT_EQ(s.parts.size(), 1u);
  EXPECT_EQ(s.parts[0].node, 0);
  EXPECT_EQ(s.parts[0].primitive, 0);
  EXPECT_FALSE(s.parts[0].changed);
  ASSERT_EQ(s.materials.size(), 1u);
  EXPECT_EQ(s.materials[0].base_color, Vec3(1.0f));
  EXPECT_TRUE(s.document);
  EXPECT_TRUE(s.texcoords[0].empty());
  EXPECT_TRUE(s.colors.empty());
}

TEST(LoadGltf, TextFormWithDataUriIsTheSame) {
  auto scene = load_gltf(triangle().gltf(), "a.gltf", "");
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->positions, loaded(triangle()).positions);
  EXPECT_FALSE(scene->document->json["buffers"][0].contains("uri"));
}

TEST(LoadGltf, NodeTransformsCompose) {
  // Child: scale (1, 2, 3), a quarter turn about +Y (x -> -z, z -> x), moved by (10, 0, 0). Parent: a matrix that swaps
  // x and y and moves by (0, 0, 5); it mirrors.
  Builder b = triangle();
  const double h = std::sqrt(0.5);
  b.json["nodes"] = {{{"mesh", 0}, {"translation", {10, 0, 0}}, {"rotation", {0, h, 0, h}}, {"scale", {1, 2, 3}}},
                     {{"children", {0}}, {"matrix", {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1}}}};
  b.json["scenes"] = {{{"nodes", {1}}}};
  Scene s = loaded(b);
  ASSERT_EQ(s.positions.size(), 3u);
  // (2,0,0) -> scaled (2,0,0) -> turned (0,0,-2) -> moved (10,0,-2) -> swapped (0,10,-2) -> moved (0,10,3).
  expect_near(s.positions[1], {0, 10, 3}, 10 * rounding);
  // (0,1,0) -> (0,2,0) -> (0,2,0) -> (10,2,0) -> (2,10,0) -> (2,10,5).
  expect_near(s.positions[2], {2, 10, 5}, 10 * rounding);
  // The normal +z turns to +x, and the swap makes +y of it: it stays the side it was, so the winding changes.
  expect_near(s.normals[0], {0, 1, 0});
  expect_near(normalize(area_normal(s, s.triangles[0])), {0, 1, 0});
}

TEST(LoadGltf, NormalsFollowTheInverseTranspose) {
  Builder b = triangle();
  primitive(b)["attributes"]["NORMAL"] = b.floats({1, 1, 0, 1, 1, 0, 1, 1, 0}, "VEC3");
  b.json["nodes"][0]["scale"] = {1, 4, -1};
  Scene s = loaded(b);
  expect_near(s.normals[0], normalize(Vec3(1, 0.25f, 0)));
}

TEST(LoadGltf, OneMeshOnTwoNodesMakesTwoParts) {
  Builder b = triangle();
  b.json["nodes"] = {{{"mesh", 0}, {"name", "left"}}, {{"mesh", 0}, {"name", "right"}, {"translation", {5, 0, 0}}}};
  Scene s = loaded(b);
  ASSERT_EQ(s.parts.size(), 2u);
  EXPECT_EQ(s.parts[0].name, "left");
  EXPECT_EQ(s.parts[1].node, 1);
  EXPECT_EQ(s.parts[1].first_vertex, 3u);
  EXPECT_EQ(s.triangles[1].v[0], 3u);
  EXPECT_EQ(s.triangles[1].part, 1u);
  EXPECT_EQ(s.positions[3], Vec3(5, 0, 0));
}

TEST(LoadGltf, ShowsTheDefaultSceneOnly) {
  Builder b = triangle();
  b.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"translation", {0, 7, 0}}}};
  b.json["scenes"] = {{{"nodes", {0}}}, {{"nodes", {1}}}};
  EXPECT_EQ(loaded(b).positions[0], Vec3(0, 0, 0));
  b.json["scene"] = 1;
  EXPECT_EQ(loaded(b).positions[0], Vec3(0, 7, 0));
}

TEST(LoadGltf, StripsAndFans) {
  Builder b;
  std::vector<float> p;
  for (int i = 0; i < 5; ++i) p.insert(p.end(), {float(i / 2), float(i % 2), 0});
  size_t strip = b.floats(p, "VEC3");
  size_t fan = b.floats({0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1}, "VEC3");
  b.json["meshes"] = {
      {{"primitives",
        {{{"attributes", {{"POSITION", strip}}}, {"mode", 5}},
         {{"attributes", {{"POSITION", fan}}}, {"mode", 6}, {"indices", b.indices({1, 2, 3, 0})}},
         {{"attributes", {{"POSITION", strip}}}, {"mode", 5}, {"indices", b.indices({0, 2, 1, 1, 4, 2})}},
         {{"attributes", {{"POSITION", strip}}}, {"mode", 1}}}}}};
  b.json["nodes"] = {{{"mesh", 0}}};
  Scene s = loaded(b);
  ASSERT_EQ(s.parts.size(), 3u);
  ASSERT_EQ(s.triangles.size(), 3u + 2u + 2u);
  // Consecutive triangles of a strip wind alike: all face -z here, both of the fan +z.
  for (int t = 0; t < 3; ++t) EXPECT_LT(area_normal(s, s.triangles[t]).z, 0) << t;
  for (int t = 3; t < 5; ++t) EXPECT_GT(area_normal(s, s.triangles[t]).z, 0) << t;
  EXPECT_EQ(s.positions[s.triangles[3].v[2]], Vec3(1, 0, 1)) << "all triangles of a fan end in its first vertex";
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "1 primitive of points or lines is not lit");
}

TEST(LoadGltf, MakesFlatNormalsWhereThereAreNone) {
  Builder b;  // two faces of a roof that share an edge
  size_t p = b.floats({0, 0, 0, 0, 0, 1, 1, 1, 0, 2, 0, 0}, "VEC3");
  b.json["meshes"] = {
      {{"primitives", {{{"attributes", {{"POSITION", p}}}, {"indices", b.indices({0, 1, 2, 1, 3, 2})}}}}}};
  b.json["nodes"] = {{{"mesh", 0}}};
  Scene s = loaded(b);
  EXPECT_TRUE(s.parts[0].changed);
  EXPECT_EQ(s.parts[0].source.size(), s.positions.size());
  for (const Triangle& t : s.triangles) {
    Vec3 face = normalize(area_normal(s, t));
    for (uint32_t v : t.v) expect_near(s.normals[v], face);
  }
}

TEST(LoadGltf, QuantisedAttributes) {
  Builder b = triangle();
  b.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  // Rows of three components padded to four, as vertex data must be.
  auto padded = [&](auto values, int type, bool normalized) {
    size_t stride = 4 * sizeof(values[0]);
    size_t a = b.accessor({{"bufferView", b.view(values)}, {"componentType", type}, {"count", 3}, {"type", "VEC3"}});
    b.json["bufferViews"].back()["byteStride"] = stride;
    if (normalized) b.json["accessors"][a]["normalized"] = true;
    return a;
  };
  primitive(b)["attributes"] = {
      {"POSITION", padded(std::vector<int16_t>{0, 0, 0, 9, -300, 0, 0, 9, 0, 200, 7, 9}, type_i16, false)},
      {"NORMAL", padded(std::vector<int8_t>{0, 0, 127, 9, 0, -128, 0, 9, 127, 127, 0, 9}, type_i8, true)},
      {"TEXCOORD_0", b.accessor(std::vector<uint16_t>{0, 65535, 1, 2, 3, 4}, type_u16, "VEC2", true)},
      {"TEXCOORD_1", b.accessor(std::vector<uint16_t>{0, 65535, 1, 2, 3, 4}, type_u16, "VEC2")},
      {"COLOR_0",
       b.accessor(std::vector<uint8_t>{0, 51, 255, 9, 1, 2, 3, 9, 255, 255, 255, 9}, type_u8, "VEC4", true)}};
  b.json["nodes"][0]["scale"] = {0.01, 0.01, 0.01};
  Scene s = loaded(b);
  expect_near(s.positions[1], {-3, 0, 0});
  expect_near(s.positions[2], {0, 2, 0.07f});
  expect_near(s.normals[0], {0, 0, 1});
  expect_near(s.normals[1], {0, -1, 0});
  expect_near(s.normals[2], normalize(Vec3(1, 1, 0)));
  EXPECT_EQ(s.texcoords[0][0], Vec2(0, 1));
  EXPECT_FLOAT_EQ(s.texcoords[0][2].y, 4.0f / 65535.0f);
  EXPECT_EQ(s.texcoords[1][0], Vec2(0, 65535));
  expect_near(s.colors[0], {0, 0.2f, 1});

  primitive(b)["attributes"]["POSITION"] =
      padded(std::vector<uint16_t>{0, 0, 0, 9, 65535, 0, 0, 9, 0, 13107, 0, 9}, type_u16, true);
  s = loaded(b);
  expect_near(s.positions[1], {0.01f, 0, 0});
  expect_near(s.positions[2], {0, 0.002f, 0});
}

TEST(LoadGltf, SparseAccessors) {
  Builder b = triangle();
  size_t at = b.view(std::vector<uint8_t>{0, 2}), values = b.view(std::vector<float>{7, 8, 9, 1, 2, 3});
  Json sparse = {{"count", 2},
                 {"indices", {{"bufferView", at}, {"componentType", type_u8}}},
                 {"values", {{"bufferView", values}}}};
  b.json["accessors"][0]["sparse"] = sparse;
  Scene s = loaded(b);
  EXPECT_EQ(s.positions[0], Vec3(7, 8, 9));
  EXPECT_EQ(s.positions[1], Vec3(2, 0, 0)) << "not listed: as in the buffer view";
  EXPECT_EQ(s.positions[2], Vec3(1, 2, 3));

  b.json["accessors"][0].erase("bufferView");
  EXPECT_EQ(loaded(b).positions[1], Vec3(0, 0, 0)) << "not listed, and no buffer view: zero";

  b.json["accessors"][0]["sparse"]["indices"]["bufferView"] = b.view(std::vector<uint8_t>{2, 0});
  EXPECT_EQ(message(b), "test.glb: accessor 0: sparse index 1 is out of order or out of range");
  b.json["accessors"][0]["sparse"]["indices"]["bufferView"] = b.view(std::vector<uint8_t>{0, 3});
  EXPECT_EQ(message(b), "test.glb: accessor 0: sparse index 1 is out of order or out of range");
  b.json["accessors"][0]["sparse"]["count"] = 4;
  EXPECT_EQ(message(b), "test.glb: accessor 0: count is 4, out of range");
}

TEST(LoadGltf, MorphTargetsAtTheirDefaultWeights) {
  Builder b = triangle();
  primitive(b)["targets"] = {{{"POSITION", b.floats({0, 0, 1, 0, 0, 2, 0, 0, 3}, "VEC3")}},
                             {{"POSITION", b.floats({4, 0, 0, 4, 0, 0, 4, 0, 0}, "VEC3")},
                              {"NORMAL", b.floats({2, 0, 0, 2, 0, 0, 2, 0, 0}, "VEC3")}}};
  expect_near(loaded(b).positions[2], {0, 1, 0});
  b.json["meshes"][0]["weights"] = {0.5, 0};
  expect_near(loaded(b).positions[2], {0, 1, 1.5f});
  b.json["nodes"][0]["weights"] = {-1, 0.5};
  Scene s = loaded(b);
  expect_near(s.positions[2], {2, 1, -3});
  expect_near(s.normals[2], normalize(Vec3(1, 0, 1)));
  EXPECT_FALSE(s.parts[0].changed);
  b.json["nodes"][0]["weights"] = {1};
  EXPECT_EQ(message(b), "test.glb: node 0: weights is not 2 numbers");
}

// Triangle hung on two joints; the joints stand at (10,0,0), and half a turn about z at the origin.
Builder skinned() {
  Builder b = triangle();
  auto& attributes = primitive(b)["attributes"];
  attributes["JOINTS_0"] = b.accessor(std::vector<uint8_t>{0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, type_u8, "VEC4");
  attributes["WEIGHTS_0"] = b.floats({0.25f, 0.75f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  b.json["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {1000, 0, 0}}, {"scale", {-1, 1, 1}}},
                     {{"translation", {10, 0, 0}}},
                     {{"rotation", {0, 0, 1, 0}}}};
  std::vector<float> bind(32, 0.0f);
  for (size_t m = 0; m < 2; ++m) {
    for (size_t k = 0; k < 4; ++k) bind[16 * m + 5 * k] = 1;
  }
  bind[12] = -1;  // the first joint was bound at (1, 0, 0)
  b.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", b.floats(bind, "MAT4")}}};
  return b;
}

TEST(LoadGltf, SkinnedMeshesStandInTheirRestPose) {
  Scene s = loaded(skinned());
  // First joint: p + (9, 0, 0). Second: (-x, -y, z). The node's own transform does not count, nor its mirroring.
  expect_near(s.positions[0], Vec3(0.25f * 9, 0, 0));
  expect_near(s.positions[1], {11, 0, 0});
  expect_near(s.positions[2], {0, -1, 0});
  expect_near(s.normals[2], {0, 0, 1});
  EXPECT_EQ(s.triangles[0].v[1], 1u);
  EXPECT_FALSE(s.parts[0].changed);

  Builder weights_off = skinned();  // weights that do not sum to one are scaled
  primitive(weights_off)["attributes"]["WEIGHTS_0"] = weights_off.floats({1, 3, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  expect_near(loaded(weights_off).positions[0], Vec3(0.25f * 9, 0, 0));

  Builder astray = skinned();
  astray.json["skins"][0]["joints"] = {1};
  EXPECT_EQ(message(astray), "test.glb: mesh 0, primitive 0: vertex 0 hangs on joint 1 of 1");
  Builder nan = skinned();
  primitive(nan)["attributes"]["WEIGHTS_0"] = nan.floats({NAN, 3, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  EXPECT_EQ(message(nan), "test.glb: mesh 0, primitive 0: vertex 0 has a bad weight");
}

TEST(LoadGltf, ExternalFilesAndTheSceneLoader) {
  TemporaryFolder folder;
  Builder b = textured_triangle(make_png(2, 2, 3, 8, four_colors));
  Json json = b.finished();
  json["buffers"][0]["uri"] = "data%20file.bin";
  json["images"] = {{{"uri", "colours.png"}}};
  write_bytes(folder.file("data file.bin"), b.binary);
  write_bytes(folder.file("colours.png"), make_png(2, 2, 3, 8, four_colors));
  write_bytes(folder.file("a.GLTF"), copy_bytes(json.dump()));
  auto scene = load_scene(folder.file("a.GLTF"));
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->textures[0].rgb, four_colors);
  EXPECT_EQ(scene->path, folder.file("a.GLTF"));
  EXPECT_EQ(scene->hash, content_hash(copy_bytes(json.dump())));

  write_bytes(folder.file("b.glb"), b.glb());
  auto mapped = load_scene(folder.file("b.glb"));
  ASSERT_TRUE(mapped) << mapped.error().text();
  EXPECT_EQ(mapped->positions, scene->positions);
  EXPECT_TRUE(mapped->document->owned.empty()) << "the binary chunk is used in the mapping";

  write_bytes(folder.file("data file.bin"), {b.binary.begin(), b.binary.end() - 1});
  auto truncated = load_scene(folder.file("a.GLTF"));
  ASSERT_FALSE(truncated);
  EXPECT_NE(truncated.error().text().find("buffer 0: is truncated"), std::string::npos);
  json["buffers"][0]["uri"] = "../data.bin";
  write_bytes(folder.file("a.GLTF"), copy_bytes(json.dump()));
  EXPECT_FALSE(load_scene(folder.file("a.GLTF")));

  EXPECT_FALSE(load_scene(folder.file("absent.glb")));
  auto unknown = load_scene(folder.file("a.fbx"));
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().message, "unknown extension \".fbx\"; known are .gltf, .glb, .obj and .ply");
}

}  // namespace
}  // namespace lambent

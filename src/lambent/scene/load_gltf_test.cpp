#include <lambent/scene/gltf_test-inl.h>

#include <lambent/scene/reflection.h>
#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

// Rounding of a few float operations on values of order one.
constexpr float rounding = 1e-6f;

void expect_near(Vec3 a, Vec3 b, float tolerance = rounding) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], tolerance) << "component " << c;
}

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

TEST(LoadGltf, Materials) {
  Builder b = triangle();
  b.json["materials"] = {
      {{"name", "unused"}},
      {{"name", "paint"},
       {"doubleSided", true},
       {"alphaMode", "BLEND"},
       {"emissiveFactor", {0.5, 0, 1}},
       {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.25, 0.5, 1, 0.5}}, {"metallicFactor", 0.125}, {"roughnessFactor", 0.75}}}},
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseFactor", {0.1, 0.2, 0.3, 1}}, {"glossinessFactor", 0.25}}}}}}};
  primitive(b)["material"] = 1;
  Scene s = loaded(b);
  ASSERT_EQ(s.materials.size(), 3u);
  EXPECT_EQ(s.parts[0].material, 1u);
  const Material& m = s.materials[1];
  EXPECT_EQ(m.name, "paint");
  EXPECT_EQ(m.base_color, Vec3(0.25f, 0.5f, 1));
  EXPECT_EQ(m.metallic, 0.125f);
  EXPECT_EQ(m.roughness, 0.75f);
  EXPECT_EQ(m.emissive, Vec3(4, 0, 8));
  EXPECT_TRUE(m.double_sided);
  EXPECT_TRUE(s.triangles[0].two_sided);
  EXPECT_EQ(m.alpha_mode, AlphaMode::blend);
  EXPECT_EQ(m.alpha, 0.5f);
  EXPECT_EQ(s.warnings, (std::vector<std::string>{
                            "KHR_materials_pbrSpecularGlossiness is not read: surfaces have its diffuse colour and "
                            "glossiness alone (1 place)"}));
  EXPECT_EQ(s.materials[2].base_color, Vec3(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(s.materials[2].roughness, 0.75f);
}

TEST(LoadGltf, WhatLetsLightPass) {
  auto with = [](nlohmann::json material) {
    Builder b = triangle();
    primitive(b)["material"] = 0;
    b.json["materials"] = nlohmann::json::array({std::move(material)});
    return b;
  };
  nlohmann::json glass = {{"alphaMode", "MASK"},
                          {"alphaCutoff", 0.75},
                          {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.5}}, {"roughnessFactor", 0}}},
                          {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 0.25}}}}}};
  Scene s = loaded(with(glass));
  EXPECT_EQ(s.materials[0].alpha_mode, AlphaMode::mask);
  EXPECT_EQ(s.materials[0].alpha_cutoff, 0.75f);
  EXPECT_EQ(s.materials[0].transmission, 0.25f);
  EXPECT_TRUE(s.warnings.empty());
  // Beyond what makes sense: nothing is left above 1; what is below 0, or no number, is refused or clamped.
  glass["alphaCutoff"] = 1e30, glass["pbrMetallicRoughness"]["baseColorFactor"][3] = -4;
  glass["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 9;
  s = loaded(with(glass));
  EXPECT_EQ(s.materials[0].alpha_cutoff, 2);
  EXPECT_EQ(s.materials[0].alpha, 0);
  EXPECT_EQ(s.materials[0].transmission, 1);
  glass["alphaCutoff"] = "half";
  EXPECT_FALSE(message(with(glass)).empty());
  glass.erase("alphaCutoff");

  glass["alphaMode"] = "HASHED", glass["pbrMetallicRoughness"]["roughnessFactor"] = 0.5;
  s = loaded(with(glass));
  EXPECT_EQ(s.materials[0].alpha_mode, AlphaMode::opaque);
  EXPECT_EQ(s.warnings,
            (std::vector<std::string>{"1 material has an unknown alphaMode and is opaque",
                                      "1 material with rough or thick transmission passes light straight on"}));
  glass["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = {{"index", 3}};
  EXPECT_FALSE(message(with(glass)).empty());  // there is no such texture

  Builder faded = with({{"alphaMode", "BLEND"}});
  primitive(faded)["attributes"]["COLOR_0"] = faded.floats({1, 1, 1, 1, 1, 1, 1, 0.5f, 1, 1, 1, 1}, "VEC4");
  EXPECT_EQ(loaded(faded).warnings, std::vector<std::string>{"the alpha of vertex colours is not read (1 primitive)"});
}

// 2 x 2 pixels: red green / blue white.
const Bytes four_colors = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};

Builder textured(const Bytes& image) {
  Builder b = triangle();
  primitive(b)["attributes"]["TEXCOORD_0"] = b.floats({0.25f, 0.25f, 0.75f, 0.25f, 0.25f, 0.75f}, "VEC2");
  primitive(b)["material"] = 0;
  b.json["images"] = {{{"bufferView", b.view(image)}, {"mimeType", "image/png"}, {"name", "colours"}}};
  b.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return b;
}

TEST(LoadGltf, BaseColourTextures) {
  Scene s = loaded(textured(make_png(2, 2, 3, 8, four_colors)));
  ASSERT_EQ(s.textures.size(), 1u);
  EXPECT_EQ(s.textures[0].rgb, four_colors);
  EXPECT_EQ(s.textures[0].mime_type, "image/png");
  EXPECT_EQ(s.textures[0].name, "colours");
  EXPECT_EQ(s.textures[0].wrap_s, Wrap::clamp);
  EXPECT_EQ(s.textures[0].wrap_t, Wrap::mirror);
  expect_near(albedo(s, s.triangles[0], 0, 0), {1, 0, 0});
  expect_near(albedo(s, s.triangles[0], 1, 0), {0, 1, 0});
  expect_near(albedo(s, s.triangles[0], 0, 1), {0, 0, 1});

  Bytes deep;  // the same in 16 bits a channel
  for (uint8_t v : four_colors) deep.insert(deep.end(), {v, v});
  EXPECT_EQ(loaded(textured(make_png(2, 2, 3, 16, deep))).textures[0].rgb, four_colors);

  Builder uri = textured(make_png(2, 2, 3, 8, four_colors));
  uri.json["images"][0] = {{"uri", "data:image/png;base64," + base64(make_png(1, 1, 3, 8, {9, 8, 7}))}};
  EXPECT_EQ(loaded(uri).textures[0].rgb, (Bytes{9, 8, 7}));
}

TEST(LoadGltf, TextureTransform) {
  Builder b = textured(make_png(2, 2, 3, 8, four_colors));
  primitive(b)["attributes"]["TEXCOORD_1"] = b.floats({0.3f, 0.1f, 0, 0, 0, 0}, "VEC2");
  b.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.5, 0.25}}, {"rotation", std::acos(0.0)}, {"scale", {2, 3}}, {"texCoord", 1}};
  Scene s = loaded(b);
  EXPECT_EQ(s.materials[0].texcoord_set, 1);
  // Scaled to (0.6, 0.3); a quarter turn counter-clockwise with v pointing down takes (u, v) to (v, -u); moved.
  const auto& m = s.materials[0].uv_transform;
  EXPECT_NEAR(m[0] * 0.3f + m[1] * 0.1f + m[2], 0.3f + 0.5f, rounding);
  EXPECT_NEAR(m[3] * 0.3f + m[4] * 0.1f + m[5], -0.6f + 0.25f, rounding);
}

TEST(LoadGltf, MetallicRoughnessTextures) {
  Builder b = textured(make_png(2, 2, 3, 8, four_colors));
  primitive(b)["attributes"]["TEXCOORD_1"] = b.floats({0.3f, 0.1f, 0, 0, 0, 0}, "VEC2");
  b.json["images"].push_back({{"bufferView", b.view(make_png(1, 1, 3, 8, {9, 51, 102}))}, {"mimeType", "image/png"}});
  b.json["textures"].push_back({{"source", 1}});
  Json& pbr = b.json["materials"][0]["pbrMetallicRoughness"];
  pbr["metallicRoughnessTexture"] = {{"index", 1}, {"texCoord", 1}};
  pbr["metallicRoughnessTexture"]["extensions"]["KHR_texture_transform"] = {{"offset", {0.5, 0.25}}};
  pbr["roughnessFactor"] = 0.5;
  Scene s = loaded(b);
  ASSERT_EQ(s.textures.size(), 2u);
  EXPECT_EQ(s.materials[0].base_color_texture, 0);
  EXPECT_EQ(s.materials[0].metallic_roughness_texture, 1);
  EXPECT_EQ(s.materials[0].metallic_roughness_set, 1);
  EXPECT_EQ(s.materials[0].texcoord_set, 0);
  EXPECT_EQ(s.materials[0].metallic_roughness_transform[2], 0.5f);
  EXPECT_EQ(s.materials[0].uv_transform, Material{}.uv_transform);
  const Vec2 m = metallic_roughness(s, s.triangles[0], 0.2f, 0.3f);
  EXPECT_NEAR(m.x, 102.0f / 255, rounding);
  EXPECT_NEAR(m.y, 0.5f * 51 / 255, rounding);

  // One that cannot be read is a warning; a reference to nowhere is an error.
  Builder broken = b;
  broken.json["images"][1] = {{"bufferView", broken.view(copy_bytes("no image"))}, {"mimeType", "image/png"}};
  s = loaded(broken);
  EXPECT_EQ(s.materials[0].metallic_roughness_texture, -1);
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "metallic-roughness texture not read: is neither PNG, JPEG nor WebP");
  broken.json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"] = 7;
  EXPECT_FALSE(broken.load());
}

TEST(LoadGltf, NormalTexturesAndTangents) {
  // A texel (51, 204, 230) = (-0.6, 0.6, 0.804), seen under a node that turns or mirrors: the normal turns and mirrors
  // with it.
  const Vec3 local = normalize(Vec3(2 * 51 / 255.0f - 1, 2 * 204 / 255.0f - 1, 2 * 230 / 255.0f - 1));
  for (bool tangents : {false, true})
    for (bool mirrored : {false, true}) {
      Builder b = textured(make_png(1, 1, 3, 8, {51, 204, 230}));
      b.json["materials"][0] = {{"normalTexture", {{"index", 0}, {"scale", 1}}}};
      Json& attributes = primitive(b)["attributes"];
      attributes["TEXCOORD_0"] = b.floats({0, 1, 1, 1, 0, 0}, "VEC2");  // upright: u along x, v against y
      if (tangents) attributes["TANGENT"] = b.floats({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1}, "VEC4");
      // Ry(90 degrees), after x changes its sign: x -> -z or z, z -> x.
      const float q = std::sqrt(0.5f);
      b.json["nodes"][0]["rotation"] = {0, q, 0, q};
      if (mirrored) b.json["nodes"][0]["scale"] = {-1, 1, 1};
      const Scene s = loaded(b);
      ASSERT_EQ(s.materials[0].normal_texture, 0);
      EXPECT_EQ(s.tangents.empty(), !tangents);
      const Vec3 expected(local.z, local.y, mirrored ? local.x : -local.x);
      EXPECT_LT(length(mapped_normal(s, s.triangles[0], 0.2f, 0.3f, s.normals[0]) - expected), 10 * rounding)
          << tangents << mirrored;
    }
  Builder broken = textured(make_png(1, 1, 3, 8, {128, 128, 255}));
  primitive(broken)["attributes"]["TANGENT"] = broken.floats({1, 0, 0, 1, 0, 0, 1, 0, 0}, "VEC3");
  EXPECT_FALSE(broken.load());
}

TEST(LoadGltf, EmissiveTextures) {
  Builder b = textured(make_png(1, 1, 3, 8, {255, 188, 0}));
  b.json["materials"][0] = {{"emissiveTexture", {{"index", 0}, {"texCoord", 1}}},
                            {"emissiveFactor", {1, 0.5, 1}},
                            {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}}}};
  Scene s = loaded(b);
  EXPECT_EQ(s.materials[0].emissive, Vec3(8, 4, 8));
  EXPECT_EQ(s.materials[0].emissive_set, 1);
  const Vec3 e = emission(s, s.triangles[0], 0.2f, 0.3f);
  EXPECT_NEAR(e.x, 8, rounding);
  EXPECT_NEAR(e.y, 4 * 0.5029f, 1e-3f);  // sRGB 188 is half of white
  EXPECT_EQ(e.z, 0);
  // Without its picture it is dark, and a warning says so; a black one asks for none.
  b.json["images"][0] = {{"bufferView", b.view(copy_bytes("no image"))}, {"mimeType", "image/png"}};
  s = loaded(b);
  EXPECT_EQ(s.materials[0].emissive, Vec3(0));
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "emissive texture not read: is neither PNG, JPEG nor WebP");
  b.json["materials"][0]["emissiveFactor"] = {0, 0, 0};
  EXPECT_TRUE(loaded(b).warnings.empty());
}

TEST(LoadGltf, TexturesAreDecodedOnce) {
  Builder b = textured(make_png(2, 2, 3, 8, four_colors));
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}, {{"source", 0}, {"sampler", 0}}, {{"source", 0}}};
  b.json["materials"] = Json::array();
  b.json["nodes"] = Json::array();
  Json mesh = b.json["meshes"][0];
  for (size_t i = 0; i < 3; ++i) {
    b.json["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
    mesh["primitives"][0]["material"] = i;
    b.json["meshes"][i] = mesh;
    b.json["nodes"].push_back({{"mesh", i}, {"translation", {i, 0, 0}}});
  }
  Scene s = loaded(b);
  ASSERT_EQ(s.textures.size(), 2u);
  EXPECT_EQ(s.materials[0].base_color_texture, s.materials[1].base_color_texture);
  EXPECT_EQ(s.textures[1].wrap_s, Wrap::repeat);
  EXPECT_EQ(s.textures[1].rgb, four_colors);
}

TEST(LoadGltf, BrokenImagesCostNoMoreThanThemselves) {
  // The base colour stays, and one warning says why.
  const auto warning = [](const Builder& b) {
    const Scene s = loaded(b);
    EXPECT_EQ(s.materials[0].base_color_texture, -1);
    EXPECT_EQ(albedo(s, s.triangles[0], 0.2f, 0.3f), s.materials[0].base_color);
    return s.warnings.empty() ? std::string() : s.warnings[0];
  };
  Builder b = textured({1, 2, 3});
  b.json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {0.5, 0.25, 0.125, 1};
  EXPECT_EQ(warning(b), "base colour texture not read: \"colours\" is neither PNG, JPEG nor WebP");
  Builder twice = b;
  twice.json["materials"].push_back(twice.json["materials"][0]);
  twice.json["meshes"][0]["primitives"].push_back(primitive(twice));
  twice.json["meshes"][0]["primitives"][1]["material"] = 1;
  EXPECT_EQ(warning(twice),
            "base colour texture not read: \"colours\" is neither PNG, JPEG nor WebP (and 1 more materials)");
  Bytes cut = make_png(2, 2, 3, 8, four_colors);
  cut.resize(30);
  EXPECT_NE(warning(textured(cut)).find("\"colours\""), std::string::npos);
  Bytes huge = make_png(2, 2, 3, 8, four_colors);
  huge[18] = 0x40, huge[19] = 0x01;  // 16385 wide
  EXPECT_NE(warning(textured(huge)).find("the limit is 16384 a side"), std::string::npos);
  huge[18] = 0x3f, huge[22] = 0x3f;  // allowed sides, but in 80 bytes
  EXPECT_NE(warning(textured(huge)).find("its few bytes may not expand so far"), std::string::npos);
  b.json["images"][0] = {{"uri", "gone.png"}};
  EXPECT_EQ(warning(b), "base colour texture not read: \"gone.png\" is an external file, which is not allowed here");
  primitive(b).erase("material");
  EXPECT_EQ(loaded(b).warnings.size(), 1u) << "not used: a warning";
  b = textured(make_png(2, 2, 3, 8, four_colors));
  b.json["textures"][0].erase("source");
  EXPECT_EQ(warning(b), "base colour texture not read: has no PNG, JPEG or WebP image");
}

TEST(LoadGltf, ExternalFilesAndTheSceneLoader) {
  TemporaryFolder folder;
  Builder b = textured(make_png(2, 2, 3, 8, four_colors));
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

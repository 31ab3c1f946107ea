#include <lambent/scene/gltf_test-inl.h>

#include <lambent/scene/reflection.h>
#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

TEST(GltfMaterials, Materials) {
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

TEST(GltfMaterials, WhatLetsLightPass) {
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

TEST(GltfMaterials, BaseColourTextures) {
  Scene s = loaded(textured_triangle(make_png(2, 2, 3, 8, four_colors)));
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
  EXPECT_EQ(loaded(textured_triangle(make_png(2, 2, 3, 16, deep))).textures[0].rgb, four_colors);

  Builder uri = textured_triangle(make_png(2, 2, 3, 8, four_colors));
  uri.json["images"][0] = {{"uri", "data:image/png;base64," + base64(make_png(1, 1, 3, 8, {9, 8, 7}))}};
  EXPECT_EQ(loaded(uri).textures[0].rgb, (Bytes{9, 8, 7}));
}

TEST(GltfMaterials, TextureTransform) {
  Builder b = textured_triangle(make_png(2, 2, 3, 8, four_colors));
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

TEST(GltfMaterials, MetallicRoughnessTextures) {
  Builder b = textured_triangle(make_png(2, 2, 3, 8, four_colors));
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

TEST(GltfMaterials, NormalTexturesAndTangents) {
  // A texel (51, 204, 230) = (-0.6, 0.6, 0.804), seen under a node that turns or mirrors: the normal turns and mirrors
  // with it.
  const Vec3 local = normalize(Vec3(2 * 51 / 255.0f - 1, 2 * 204 / 255.0f - 1, 2 * 230 / 255.0f - 1));
  for (bool tangents : {false, true})
    for (bool mirrored : {false, true}) {
      Builder b = textured_triangle(make_png(1, 1, 3, 8, {51, 204, 230}));
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
  Builder broken = textured_triangle(make_png(1, 1, 3, 8, {128, 128, 255}));
  primitive(broken)["attributes"]["TANGENT"] = broken.floats({1, 0, 0, 1, 0, 0, 1, 0, 0}, "VEC3");
  EXPECT_FALSE(broken.load());
}

TEST(GltfMaterials, EmissiveTextures) {
  Builder b = textured_triangle(make_png(1, 1, 3, 8, {255, 188, 0}));
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

TEST(GltfMaterials, TexturesAreDecodedOnce) {
  Builder b = textured_triangle(make_png(2, 2, 3, 8, four_colors));
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

TEST(GltfMaterials, BrokenImagesCostNoMoreThanThemselves) {
  // The base colour stays, and one warning says why.
  const auto warning = [](const Builder& b) {
    const Scene s = loaded(b);
    EXPECT_EQ(s.materials[0].base_color_texture, -1);
    EXPECT_EQ(albedo(s, s.triangles[0], 0.2f, 0.3f), s.materials[0].base_color);
    return s.warnings.empty() ? std::string() : s.warnings[0];
  };
  Builder b = textured_triangle({1, 2, 3});
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
  EXPECT_NE(warning(textured_triangle(cut)).find("\"colours\""), std::string::npos);
  Bytes huge = make_png(2, 2, 3, 8, four_colors);
  huge[18] = 0x40, huge[19] = 0x01;  // 16385 wide
  EXPECT_NE(warning(textured_triangle(huge)).find("the limit is 16384 a side"), std::string::npos);
  huge[18] = 0x3f, huge[22] = 0x3f;  // allowed sides, but in 80 bytes
  EXPECT_NE(warning(textured_triangle(huge)).find("its few bytes may not expand so far"), std::string::npos);
  b.json["images"][0] = {{"uri", "gone.png"}};
  EXPECT_EQ(warning(b), "base colour texture not read: \"gone.png\" is an external file, which is not allowed here");
  primitive(b).erase("material");
  EXPECT_EQ(loaded(b).warnings.size(), 1u) << "not used: a warning";
  b = textured_triangle(make_png(2, 2, 3, 8, four_colors));
  b.json["textures"][0].erase("source");
  EXPECT_EQ(warning(b), "base colour texture not read: has no PNG, JPEG or WebP image");
}

}  // namespace
}  // namespace lambent

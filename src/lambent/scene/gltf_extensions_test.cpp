// What a document says by extensions, against the same scene said without.
#include <lambent/scene/gltf_extensions.h>
#include <lambent/scene/gltf_packed_test-inl.h>

#include <lambent/bake/materials.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/textures.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

using Lines = std::vector<std::string>;

const Bytes colours = {200, 10, 20, 30, 150, 40, 50, 60, 250, 255, 255, 0};

// Hills with a material; images and textures are added.
Builder dressed(const Json& material) {
  Builder b = Hills().plain();
  b.json["materials"] = Json::array({material});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  return b;
}
size_t add_image(Builder& b, const Bytes& bytes, const char* type) {
  const size_t view = b.view(bytes);
  b.json["images"].push_back({{"bufferView", view}, {"mimeType", type}});
  return b.json["images"].size() - 1;
}

TEST(GltfWebp, IsTheSamePictureAsPng) {
  Builder png = dressed({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}), webp = png, bare = png;
  png.json["textures"] = {{{"source", add_image(png, make_png(2, 2, 3, 8, colours), "image/png")}}};
  const size_t image = add_image(webp, make_webp(2, 2, colours), "image/webp");
  webp.json["textures"] = {{{"extensions", {{"EXT_texture_webp", {{"source", image}}}}}}};
  webp.json["extensionsUsed"] = webp.json["extensionsRequired"] = {"EXT_texture_webp"};
  bare.json["textures"] = {{{"source", add_image(bare, make_webp(2, 2, colours), "image/webp")}}};
  for (const Builder* b : {&webp, &bare}) {
    const Scene s = loaded(*b);
    ASSERT_EQ(s.textures.size(), 1u);
    EXPECT_EQ(s.textures[0].rgb, loaded(png).textures[0].rgb);
    EXPECT_EQ(s.textures[0].mime_type, "image/webp");
    EXPECT_EQ(s.warnings, Lines());
  }
}

TEST(GltfWebp, HasAlpha) {
  const Bytes rgba = {200, 10, 20, 255, 30, 150, 40, 7, 50, 60, 250, 128, 255, 255, 0, 64};
  uint8_t* encoded = nullptr;
  const size_t size = WebPEncodeLosslessRGBA(rgba.data(), 2, 2, 8, &encoded);
  auto texture = decode_texture(Bytes(encoded, encoded + size), "a");
  WebPFree(encoded);
  ASSERT_TRUE(texture) << texture.error().text();
  EXPECT_EQ(texture->rgb, colours);
  EXPECT_EQ(texture->alpha, Bytes({255, 7, 128, 64}));
}

TEST(GltfWebp, AnImageThatIsBrokenLeavesTheOther) {
  Builder b = dressed({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  Bytes cut = make_webp(2, 2, colours);
  cut.resize(cut.size() / 2);
  const size_t broken = add_image(b, cut, "image/webp"), png = add_image(b, make_png(2, 2, 3, 8, colours), "image/png");
  b.json["textures"] = {{{"source", png}, {"extensions", {{"EXT_texture_webp", {{"source", broken}}}}}}};
  EXPECT_EQ(loaded(b).textures[0].rgb, colours);
  b.json["textures"][0].erase("source");
  const Scene without = loaded(b);
  EXPECT_EQ(without.materials[0].base_color_texture, -1);
  ASSERT_EQ(without.warnings.size(), 1u);
  EXPECT_NE(without.warnings[0].find("base colour texture not read"), std::string::npos) << without.warnings[0];
}

TEST(GltfWebp, IsWrittenForWhoReadsIt) {
  TemporaryFolder folder;
  Scene scene = loaded(dressed({{"pbrMetallicRoughness", Json::object()}}));
  scene.document.reset();
  for (Part& part : scene.parts) part.node = part.primitive = -1;
  auto texture = decode_texture(make_webp(2, 2, colours), "colours");
  ASSERT_TRUE(texture) << texture.error().text();
  scene.textures.push_back(*texture), scene.materials[0].base_color_texture = 0;
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), scene, {}, {}));
  auto again = load_scene(folder.file("a.glb"));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(again->textures[0].rgb, colours);
  EXPECT_EQ(again->document->json["extensionsRequired"], Json::array({"EXT_texture_webp"}));
}

TEST(DecodeTexture, SizesEndBeforeMemoryIsTaken) {
  // 16384 x 16384 by VP8L's header: 14 bits a side less one.
  Bytes webp = make_webp(2, 2, colours);
  ASSERT_EQ(webp[20], 0x2f) << "lossless";
  webp[21] = webp[22] = webp[23] = 0xff, webp[24] |= 0x0f;
  auto texture = decode_texture(webp, "a");
  ASSERT_FALSE(texture);
  EXPECT_EQ(texture.error().text(), "a: measures 16384 x 16384 pixels; its few bytes may not expand so far");
  // A PNG of one colour of 100 million pixels: deflate needs 290 kB for it.
  Bytes png = make_png(1, 1, 3, 8, {1, 2, 3});
  const int side = 10000;
  png[18] = png[22] = uint8_t(side >> 8), png[19] = png[23] = uint8_t(side & 255);
  png.resize(290'000);
  texture = decode_texture(png, "a");
  ASSERT_FALSE(texture);
  EXPECT_EQ(texture.error().text(), "a: measures 10000 x 10000 pixels; its few bytes may not expand so far");
}

TEST(DecodeTexture, WebpThatIsCutOrMovesIsRefused) {
  const Bytes whole = make_webp(2, 2, colours);
  for (size_t n = 0; n < whole.size() - 1; ++n)  // the last byte pads
    EXPECT_FALSE(decode_texture(Bytes(whole.begin(), whole.begin() + ptrdiff_t(n)), "cut")) << n;
  Bytes moving = copy_bytes("RIFF");
  put_u32(moving, 4 + 8 + 10), moving.insert(moving.end(), {'W', 'E', 'B', 'P', 'V', 'P', '8', 'X'});
  put_u32(moving, 10), moving.insert(moving.end(), {2, 0, 0, 0, 1, 0, 0, 1, 0, 0});
  auto texture = decode_texture(moving, "a");
  ASSERT_FALSE(texture);
  EXPECT_EQ(texture.error().text(), "a: is an animation");
}

TEST(GltfExtensions, UnlitIsAMatteSurfaceOfItsColour) {
  const Json base = {{"baseColorFactor", {0.5, 0.25, 0.75, 1}}, {"metallicFactor", 0.9}, {"roughnessFactor", 0.1}};
  Json matte = base;
  matte["metallicFactor"] = 0, matte["roughnessFactor"] = 1;
  const Scene a = loaded(dressed({{"pbrMetallicRoughness", base},
                                  {"emissiveFactor", {1, 1, 1}},
                                  {"extensions", {{"KHR_materials_unlit", Json::object()}}}})),
              b = loaded(dressed({{"pbrMetallicRoughness", matte}}));
  EXPECT_EQ(a.materials[0].base_color, b.materials[0].base_color);
  EXPECT_EQ(a.materials[0].metallic, b.materials[0].metallic);
  EXPECT_EQ(a.materials[0].roughness, b.materials[0].roughness);
  EXPECT_EQ(a.materials[0].emissive, Vec3(0));
  EXPECT_TRUE(a.warnings.empty());  // a bake says so, of those that it does not leave out
}

TEST(GltfExtensions, IndexAndSpecularAreFresnelsReflectance) {
  const auto dielectric = [](const Json& extensions) {
    const Material m = loaded(dressed({{"extensions", extensions}})).materials[0];
    return Vec4(m.dielectric_f0, m.dielectric_f90);
  };
  const auto ior = [](double n) { return Json{{"KHR_materials_ior", {{"ior", n}}}}; };
  EXPECT_EQ(dielectric(Json::object()), Vec4(0.04f, 0.04f, 0.04f, 1)) << "1.5";
  EXPECT_EQ(dielectric(ior(1.5)), Vec4(0.04f, 0.04f, 0.04f, 1));
  EXPECT_EQ(dielectric(ior(3)), Vec4(0.25f, 0.25f, 0.25f, 1)) << "((3 - 1) / (3 + 1))^2";
  EXPECT_EQ(dielectric(ior(1)), Vec4(0, 0, 0, 1));
  EXPECT_EQ(dielectric(ior(0)), Vec4(1, 1, 1, 1)) << "a mirror";
  Json both = ior(3);
  both["KHR_materials_specular"] = {{"specularFactor", 0.5}, {"specularColorFactor", {0, 1, 8}}};
  EXPECT_EQ(dielectric(both), Vec4(0, 0.125f, 0.5f, 0.5f)) << "weighted after it ends at 1";
}

TEST(GltfExtensions, WithoutSpecularASurfaceIsLambert) {
  const Scene s = loaded(dressed({{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.3}}},
                                  {"extensions", {{"KHR_materials_specular", {{"specularFactor", 0}}}}}}));
  const Reflection materials{Reflection::Model::materials}, diffuse{Reflection::Model::diffuse};
  const Vec3 wi = normalize(Vec3(0.3f, 0.2f, 1)), wo = normalize(Vec3(-0.4f, -0.2f, 1));
  for (const Triangle& t : s.triangles) {
    const Vec3 a = evaluate(surface_brdf(s, materials, t, 0.3f, 0.3f), wi, wo),
               b = evaluate(surface_brdf(s, diffuse, t, 0.3f, 0.3f), wi, wo);
    EXPECT_LT(length(a - b), 1e-6f);
  }
}

TEST(GltfExtensions, ABakeTellsMaterialsApartBySpecular) {
  Builder b = dressed(Json::object());
  b.json["materials"].push_back({{"extensions", {{"KHR_materials_specular", {{"specularFactor", 0.5}}}}}});
  b.json["meshes"].push_back(b.json["meshes"][0]);
  b.json["meshes"][1]["primitives"][0]["material"] = 1;
  b.json["nodes"].push_back({{"mesh", 1}, {"translation", {0, 5, 0}}});
  const Scene s = loaded(b);
  const Receivers receivers = make_vertex_receivers(s);
  const ReceiverMaterials made = make_receiver_materials(s, receivers, {Reflection::Model::materials});
  ASSERT_EQ(made.materials.size(), 2u);
  for (const Triangle& t : s.triangles) {
    const uint16_t m = made.of_receiver[receivers.front[t.v[0]]];
    const auto* white = std::get_if<MetallicRoughness>(&made.materials[m].white);
    ASSERT_TRUE(white);
    EXPECT_EQ(white->dielectric_f90, t.part == 0 ? 1.0f : 0.5f);
    EXPECT_EQ(white->dielectric_f0, Vec3(t.part == 0 ? 0.04f : 0.02f));
  }
}

TEST(GltfExtensions, SpecularOfMadeScenesIsWritten) {
  TemporaryFolder folder;
  Scene scene = loaded(dressed(Json::object()));
  scene.document.reset();
  for (Part& part : scene.parts) part.node = part.primitive = -1;
  scene.materials[0].dielectric_f0 = Vec3(0.01f, 0.02f, 0.1f), scene.materials[0].dielectric_f90 = 0.5f;
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), scene, {}, {}));
  auto again = load_scene(folder.file("a.glb"));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_LT(length(again->materials[0].dielectric_f0 - scene.materials[0].dielectric_f0), 1e-7f);
  EXPECT_EQ(again->materials[0].dielectric_f90, 0.5f);
}

TEST(GltfExtensions, TransformsOfEverySlotAreTheSameAsMovedCoordinates) {
  const double angle = 0.5, c = std::cos(angle), s = std::sin(angle);
  const Json transform = {{"offset", {0.25, -0.5}}, {"rotation", angle}, {"scale", {2, 3}}};
  Builder moved = dressed(Json::object()), turned = moved;
  Hills hills;
  for (size_t i = 0; i < hills.texcoords.size(); i += 2) {
    const double u = 2 * double(hills.texcoords[i]), v = 3 * double(hills.texcoords[i + 1]);
    hills.texcoords[i] = float(c * u + s * v + 0.25), hills.texcoords[i + 1] = float(c * v - s * u - 0.5);
  }
  moved.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = moved.floats(hills.texcoords, "VEC2");
  for (Builder* b : {&moved, &turned})
    b->json["textures"] = {{{"source", add_image(*b, make_png(2, 2, 3, 8, colours), "image/png")}}};
  const auto material = [](const Json& slot) {
    return Json{{"pbrMetallicRoughness", {{"baseColorTexture", slot}, {"metallicRoughnessTexture", slot}}},
                {"normalTexture", slot},
                {"emissiveTexture", slot},
                {"emissiveFactor", {1, 1, 1}}};
  };
  moved.json["materials"] = Json::array({material({{"index", 0}, {"texCoord", 1}})});
  turned.json["materials"] =
      Json::array({material({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}})});
  const Scene a = loaded(moved), b = loaded(turned);
  EXPECT_EQ(b.warnings, Lines());
  constexpr float tolerance = 1e-4f;  // of coordinates rounded to floats, over texels half a unit wide
  for (size_t t = 0; t < a.triangles.size(); ++t) {
    const Triangle &p = a.triangles[t], &q = b.triangles[t];
    EXPECT_LT(length(albedo(a, p, 0.2f, 0.3f) - albedo(b, q, 0.2f, 0.3f)), tolerance);
    EXPECT_LT(length(metallic_roughness(a, p, 0.2f, 0.3f) - metallic_roughness(b, q, 0.2f, 0.3f)), tolerance);
    EXPECT_LT(length(emission(a, p, 0.2f, 0.3f) - emission(b, q, 0.2f, 0.3f)), tolerance);
    const Vec3 n(0, 1, 0);
    EXPECT_LT(length(mapped_normal(a, p, 0.2f, 0.3f, n) - mapped_normal(b, q, 0.2f, 0.3f, n)), tolerance);
  }
}

TEST(GltfExtensions, WhatIsNotReadIsNamedOnce) {
  Builder b = dressed({{"extensions",
                        {{"KHR_materials_clearcoat", {{"clearcoatFactor", 1}}},
                         {"KHR_materials_sheen", Json::object()},
                         {"ACME_glitter", Json::object()}}}});
  b.json["materials"].push_back({{"extensions", {{"KHR_materials_clearcoat", Json::object()}}}});
  b.json["nodes"][0]["extensions"]["ACME_wobble"] = Json::object();
  b.json["nodes"][0]["extras"]["extensions"]["ACME_note"] = Json::object();
  b.json["extensions"]["KHR_xmp_json_ld"] = Json::object();
  b.json["extensionsUsed"] = {"KHR_materials_clearcoat", "KHR_materials_iridescence"};
  EXPECT_EQ(loaded(b).warnings,
            Lines({"KHR_materials_clearcoat is not read: surfaces have no clear coat (2 places)",
                   "KHR_materials_sheen is not read: cloth has no sheen (1 place)",
                   "extensions that are not known, and may change the picture: \"ACME_glitter\", \"ACME_wobble\""}));
}

TEST(GltfExtensions, WhatIsRequiredAndNotReadIsRefused) {
  Builder b = dressed(Json::object());
  b.json["extensionsRequired"] = {"KHR_materials_clearcoat"};
  EXPECT_EQ(message(b), "loaded") << "the surface is there without its coat";
  b.json["extensionsRequired"] = {"KHR_gaussian_splatting"};
  EXPECT_EQ(message(b), "test.glb: needs the extension \"KHR_gaussian_splatting\", which is not supported");
}

TEST(GltfExtensions, ImagesOfOtherKindsAreLeftOut) {
  const Json slot = {{"index", 0}};
  Builder b = dressed({{"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 0.5, 0.5, 1}}, {"baseColorTexture", slot}}},
                       {"normalTexture", slot},
                       {"emissiveFactor", {1, 1, 1}},
                       {"emissiveTexture", slot}});
  const Bytes ktx = {0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, '\r', '\n', 0x1a, '\n'};
  const size_t image = add_image(b, ktx, "image/ktx2");
  b.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", image}}}}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_texture_basisu"};
  const Scene s = loaded(b);
  EXPECT_EQ(s.materials[0].base_color, Vec3(0.5f));
  EXPECT_EQ(s.materials[0].base_color_texture, -1);
  EXPECT_EQ(s.materials[0].emissive, Vec3(0)) << "of unknown pattern";
  EXPECT_EQ(s.warnings, Lines({"1 texture is left out, their colour factors stand alone: the image is a "
                               "KHR_texture_basisu, which is not read"}));
  EXPECT_FALSE(s.document->json.contains("extensionsRequired"));
  EXPECT_FALSE(s.document->json["materials"][0].contains("normalTexture"));
  // With another image, that is the texture.
  b.json["textures"][0]["source"] = add_image(b, make_png(2, 2, 3, 8, colours), "image/png");
  EXPECT_EQ(loaded(b).textures[0].rgb, colours);
  EXPECT_EQ(loaded(b).warnings, Lines());
}

}  // namespace
}  // namespace lambent

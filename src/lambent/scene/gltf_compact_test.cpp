#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/gltf_unbake.h>
#include <lambent/scene/refine.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

struct Saved {
  Json json;
  Bytes binary;
};
Saved save(const Scene& scene, std::span<const GltfBlob> blobs = {}) {
  TemporaryFolder folder;
  const auto saved = save_gltf(folder.file("a.glb"), scene, blobs, {});
  EXPECT_TRUE(saved) << saved.error().text();
  const Bytes file = *read_file(folder.file("a.glb"));
  auto chunks = split_gltf(file, "");
  EXPECT_TRUE(chunks);
  return {chunks->json, {chunks->binary.begin(), chunks->binary.end()}};
}

Bytes view_bytes(const Saved& file, const Json& view) {
  const auto begin = file.binary.begin() + ptrdiff_t(view.value("byteOffset", size_t{0}));
  return {begin, begin + ptrdiff_t(view.at("byteLength").get<size_t>())};
}
Bytes view_bytes(const Saved& file, size_t view) { return view_bytes(file, file.json.at("bufferViews").at(view)); }
// An accessor with all that it refers to, in place of numbers.
Json meant(const Saved& file, size_t accessor) {
  Json a = file.json.at("accessors").at(accessor);
  for (const char* at : {"/bufferView", "/sparse/indices/bufferView", "/sparse/values/bufferView"})
    if (const Json::json_pointer place(at); a.contains(place)) a[place] = view_bytes(file, a[place].get<size_t>());
  return a;
}

// A document with every kind of reference, and with dead items between them: an accessor, a view, and 100 bytes.
Builder full_document() {
  Builder b = triangle();
  b.view(Bytes(1000, 0xdd));
  b.floats(std::vector<float>(30, 5), "VEC3");
  b.binary.resize(b.binary.size() + 100, 0xdd);
  const size_t joints = b.accessor(Bytes(12, 0), type_u8, "VEC4");
  const size_t weights = b.floats({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  b.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joints;
  b.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weights;
  b.floats(std::vector<float>(33, 6), "VEC3");
  const size_t sparse = b.accessor({{"componentType", type_f32},
                                    {"count", 3},
                                    {"type", "VEC3"},
                                    {"sparse",
                                     {{"count", 1},
                                      {"indices", {{"bufferView", b.view(Bytes{1})}, {"componentType", type_u8}}},
                                      {"values", {{"bufferView", b.view(std::vector<float>{1, 2, 3})}}}}}});
  b.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", sparse}}};
  b.view(Bytes(77, 0xdd));
  const size_t inverse = b.floats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "MAT4");
  b.json["skins"] = {{{"joints", {1}}, {"inverseBindMatrices", inverse}}};
  b.json["nodes"][0]["skin"] = 0;
  b.json["nodes"].push_back({{"name", "joint"}});
  const size_t times = b.floats({0, 1}, "SCALAR"), moves = b.floats({0, 0, 0, 1, 1, 1}, "VEC3");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", moves}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}}}};
  b.json["images"] = {{{"bufferView", b.view(make_png(1, 1, 3, 8, {9, 8, 7}))}, {"mimeType", "image/png"}}};
  b.floats(std::vector<float>(30, 7), "VEC3");
  const size_t places = b.floats({0, 0, 0, 5, 5, 5}, "VEC3");
  b.json["nodes"].push_back(
      {{"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}});
  b.json["meshes"].push_back(b.json["meshes"][0]);
  b.view(Bytes(500, 0xdd));
  // Two views of the same bytes, and one that reaches over both.
  const Json shared = b.json["bufferViews"][b.json["accessors"][moves]["bufferView"].get<size_t>()];
  b.json["bufferViews"].push_back(shared);
  b.json["meshes"][1]["primitives"][0]["attributes"]["_SHARED"] = b.accessor(
      {{"bufferView", b.json["bufferViews"].size() - 1}, {"componentType", type_f32}, {"count", 2}, {"type", "VEC3"}});
  return b;
}

// All references that a reader of the specification follows, as what they mean.
Json all_meant(const Saved& f) {
  Json out = Json::array();
  const auto add = [&](const Json& accessor) { out.push_back(meant(f, accessor.get<size_t>())); };
  for (const Json& mesh : f.json["meshes"])
    for (const Json& p : mesh["primitives"]) {
      for (const Json& a : p["attributes"]) add(a);
      add(p["indices"]);
      for (const Json& target : p["targets"])
        for (const Json& a : target) add(a);
    }
  for (const Json& skin : f.json["skins"]) add(skin["inverseBindMatrices"]);
  for (const Json& s : f.json["animations"][0]["samplers"]) add(s["input"]), add(s["output"]);
  for (const Json& image : f.json["images"]) out.push_back(view_bytes(f, image["bufferView"].get<size_t>()));
  add(f.json["nodes"][2]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"]);
  return out;
}

TEST(Compact, DropsWhatNothingRefersTo) {
  Builder b = full_document();
  b.json["nodes"][2].erase("mesh");
  auto scene = b.load();
  ASSERT_TRUE(scene) << scene.error().text();
  const Saved before{b.finished(), b.binary}, after = save(*scene);
  EXPECT_EQ(all_meant(after), all_meant(before));
  EXPECT_EQ(after.json["accessors"].size(), before.json["accessors"].size() - 3);
  EXPECT_EQ(after.json["bufferViews"].size(), before.json["bufferViews"].size() - 6);
  // 1000 + 120 + 100 + 132 + 77 + 120 + 500 bytes were dead; of each gap less than 64 stay.
  EXPECT_LE(after.binary.size(), before.binary.size() - (2049 - 5 * 64));
  for (const Json& view : after.json["bufferViews"]) EXPECT_EQ(view.value("byteOffset", 0) % 4, 0);
  // Once more there is nothing to drop.
  auto again = load_gltf(make_glb(after.json, after.binary), "again.glb", "");
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(save(*again).json, after.json);
  EXPECT_EQ(save(*again).binary, after.binary);
}

TEST(Compact, LeavesADocumentWithoutDeadBytesAsItIs) {
  Builder b = triangle();
  b.binary.resize(b.binary.size() + 13, 7);  // padding, as of a tool that aligns to 16
  b.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = b.floats({0, 0, 0, 1, 1, 1, 0, 1, 0}, "VEC3");
  const Saved after = save(*b.load());
  EXPECT_EQ(after.json, b.finished());
  ASSERT_EQ(after.binary.size(), b.binary.size());
  for (size_t v = 0; v < 4; ++v) EXPECT_EQ(view_bytes(after, v), view_bytes({b.finished(), b.binary}, v));
}

TEST(Compact, LeavesReferencesAloneThatItDoesNotKnow) {
  for (bool listed : {true, false}) {
    Builder b = full_document();
    if (listed) b.json["extensionsUsed"] = {"ACME_points"};
    else b.json["nodes"][1]["extensions"]["ACME_points"] = {{"accessor", 7}};
    const Saved after = save(*b.load());
    EXPECT_EQ(after.json, b.finished());
    EXPECT_EQ(after.binary, Bytes(b.binary.begin(), b.binary.end()));
  }
  for (const Json& reference : {Json(1000), Json("x"), Json(-1)}) {  // nobody shows this mesh, so nobody has read it
    Builder b = full_document();
    b.json["meshes"][1]["primitives"][0]["attributes"]["_PACKED"] = reference;
    EXPECT_EQ(save(*b.load()).json, b.finished());
  }
}

TEST(Compact, KeepsAlignment) {
  Builder b = full_document();
  const Bytes blob = copy_bytes("0123456789");
  const std::vector<GltfBlob> blobs{{blob, 64}};
  const Saved after = save(*b.load(), blobs);
  EXPECT_EQ(view_bytes(after, after.json["bufferViews"].size() - 1), blob);
  EXPECT_EQ(after.json["bufferViews"].back()["byteOffset"].get<size_t>() % 64, 0u);
}

TEST(Compact, ReplacedGeometryGoes) {
  Builder b = triangle();
  Scene scene = *b.load();
  ASSERT_TRUE(split_long_edges(scene, 0.5f));
  const Saved after = save(scene);
  EXPECT_EQ(after.json["accessors"].size(), 3u);  // positions, normals, indices
  EXPECT_EQ(after.json["bufferViews"].size(), 3u);
  EXPECT_LE(after.binary.size(), scene.positions.size() * 24 + scene.triangles.size() * 12 + 64);
}

TEST(Unbake, MayMeetAnything) {
  for (const char* text :
       {R"({"extensions":{"LAMBENT_transfer":1}})", R"({"extensions":[],"meshes":[{"primitives":3}]})",
        R"({"meshes":[{"primitives":[1,{"extensions":{"LAMBENT_transfer":[]}},{"extensions":7}]}]})",
        R"({"meshes":[{"primitives":[{"attributes":4,
            "extensions":{"LAMBENT_transfer":{"ownMaterial":0,"texCoord":-1}}}]}]})",
        R"({"meshes":[{"primitives":[{"material":0,
            "extensions":{"LAMBENT_transfer":{"ownMaterial":9,"ownIsDefault":true}}}]}],
            "materials":[{"emissiveTexture":{"index":0}}],"textures":[{"source":7,"sampler":"x"}],
            "extensionsUsed":[1,"LAMBENT_transfer"]})"}) {
    Json document = Json::parse(text);
    unbake(document);
    EXPECT_EQ(document.dump().find("LAMBENT"), std::string::npos) << document.dump();
  }
}

}  // namespace
}  // namespace lambent

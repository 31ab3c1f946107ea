#include <lambent/core/random.h>
#include <lambent/scene/clean.h>
#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <sys/mman.h>

namespace lambent {
namespace {

using namespace test;

// Normals are made unit again by the loader; positions in the frame of a node pass through its transform and back.
constexpr float normal_rounding = 1e-6f, frame_rounding = 2e-6f;

// Saves and loads again.
class RoundTrip {
 public:
  Scene operator()(const Scene& scene) {
    auto saved = save_gltf(path(), scene, {}, {});
    EXPECT_TRUE(saved) << saved.error().text();
    auto again = load_scene(path());
    if (again) return std::move(*again);
    ADD_FAILURE() << again.error().text();
    return {};
  }
  std::string path() const { return folder_.file("out.glb"); }
  Json json() const { return split_gltf(*read_file(path()), "")->json; }

 private:
  TemporaryFolder folder_;
};

void expect_same_material(const Material& a, const Material& b, const Scene& sa, const Scene& sb) {
  EXPECT_EQ(a.base_color, b.base_color);
  EXPECT_EQ(a.metallic, b.metallic);
  EXPECT_EQ(a.roughness, b.roughness);
  EXPECT_EQ(a.emissive, b.emissive);
  auto expect_same_texture = [&](int ia, int ib, const std::array<float, 6>& transform_a,
                                 const std::array<float, 6>& transform_b) {
    ASSERT_EQ(ia < 0, ib < 0);
    if (ia < 0) return;
    for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(transform_a[i], transform_b[i], normal_rounding);
    const Texture &ta = sa.textures[size_t(ia)], &tb = sb.textures[size_t(ib)];
    EXPECT_EQ(ta.rgb, tb.rgb);
    EXPECT_EQ(ta.wrap_s, tb.wrap_s);
    EXPECT_EQ(ta.wrap_t, tb.wrap_t);
  };
  expect_same_texture(a.base_color_texture, b.base_color_texture, a.uv_transform, b.uv_transform);
  expect_same_texture(a.metallic_roughness_texture, b.metallic_roughness_texture, a.metallic_roughness_transform,
                      b.metallic_roughness_transform);
  expect_same_texture(a.normal_texture, b.normal_texture, a.normal_transform, b.normal_transform);
  expect_same_texture(a.emissive_texture, b.emissive_texture, a.emissive_transform, b.emissive_transform);
  EXPECT_EQ(a.normal_set, b.normal_set);
  EXPECT_EQ(a.normal_scale, b.normal_scale);
  EXPECT_EQ(a.emissive_set, b.emissive_set);
  if (a.base_color_texture >= 0) {
    EXPECT_EQ(a.texcoord_set, b.texcoord_set);
  }
  if (a.metallic_roughness_texture >= 0) {
    EXPECT_EQ(a.metallic_roughness_set, b.metallic_roughness_set);
  }
}

// Positions may differ by `tolerance` times the size of the scene.
void expect_same(const Scene& a, const Scene& b, float tolerance = 0) {
  ASSERT_EQ(a.positions.size(), b.positions.size());
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  ASSERT_EQ(a.parts.size(), b.parts.size());
  const float reach = bounds(a).diagonal();
  float moved = 0, turned = 0, slid = 0, faded = 0;
  for (size_t i = 0; i < a.positions.size(); ++i) {
    moved = std::max(moved, length(a.positions[i] - b.positions[i]));
    turned = std::max(turned, length(a.normals[i] - b.normals[i]));
    for (size_t set = 0; set < 2; ++set) {  // absent and all zero are the same
      Vec2 uv_a = a.texcoords[set].empty() ? Vec2(0) : a.texcoords[set][i];
      Vec2 uv_b = b.texcoords[set].empty() ? Vec2(0) : b.texcoords[set][i];
      slid = std::max(slid, length(uv_a - uv_b));
    }
    if (!a.tangents.empty() && !b.tangents.empty()) turned = std::max(turned, length(a.tangents[i] - b.tangents[i]));
    Vec3 color_a = a.colors.empty() ? Vec3(1) : a.colors[i], color_b = b.colors.empty() ? Vec3(1) : b.colors[i];
    faded = std::max(faded, length(color_a - color_b));
  }
  EXPECT_LE(moved, tolerance * reach);
  EXPECT_LE(turned, std::max(normal_rounding, 4 * tolerance));
  EXPECT_EQ(slid, 0);
  EXPECT_LE(faded, normal_rounding);
  size_t different = 0;
  for (size_t t = 0; t < a.triangles.size(); ++t) {
    different += !std::equal(a.triangles[t].v, a.triangles[t].v + 3, b.triangles[t].v);
    different += a.triangles[t].part != b.triangles[t].part || a.triangles[t].two_sided != b.triangles[t].two_sided;
  }
  EXPECT_EQ(different, 0u);
  for (size_t p = 0; p < a.parts.size(); ++p) {
    SCOPED_TRACE(p);
    EXPECT_EQ(a.parts[p].name, b.parts[p].name);
    EXPECT_EQ(a.parts[p].vertex_count, b.parts[p].vertex_count);
    EXPECT_EQ(a.parts[p].triangle_count, b.parts[p].triangle_count);
    ASSERT_NO_FATAL_FAILURE(
        expect_same_material(a.materials[a.parts[p].material], b.materials[b.parts[p].material], a, b));
  }
}

// As another loader would make it: two parts, textures, colours, mixed sidedness.
Scene made_scene() {
  Scene s;
  for (int i = 0; i < 3; ++i) {
    Texture t;
    t.name = "texture";
    t.encoded = make_png(2, 1, 3, 8, {uint8_t(10 * (i / 2)), 20, 30, 40, 50, 60});  // the first two are the same image
    t.mime_type = "image/png";
    t.width = 2, t.height = 1, t.rgb = {uint8_t(10 * (i / 2)), 20, 30, 40, 50, 60};
    t.wrap_s = i == 1 ? Wrap::mirror : Wrap::repeat, t.wrap_t = i == 2 ? Wrap::clamp : Wrap::repeat;
    s.textures.push_back(t);
  }
  for (int i = 0; i < 4; ++i) {
    Material m;
    m.name = "m" + std::to_string(i);
    m.base_color = {0.1f * float(i), 0.3f, 1.0f / 3};
    m.metallic = 0.3f, m.roughness = 0.7f, m.emissive = i == 1 ? Vec3(0.5f, 11, 0) : Vec3(0.25f, 0, 0.1f * float(i));
    m.base_color_texture = i == 3 ? -1 : i, m.texcoord_set = i % 2;
    if (i == 1)
      m.uv_transform = {2 * std::cos(0.3f), 3 * std::sin(0.3f), 0.5f, -2 * std::sin(0.3f), 3 * std::cos(0.3f), -0.25f};
    if (i == 2) m.uv_transform = {1, 0, 0, 0, -1, 1};  // upside down
    if (i >= 2)
      m.metallic_roughness_texture = 3 - i, m.metallic_roughness_set = 1,
      m.metallic_roughness_transform = {2, 0, 0.5f, 0, 1, 0};
    if (i == 1)
      m.normal_texture = 2, m.normal_set = 1, m.normal_transform = {1, 0, 0.25f, 0, 2, 0}, m.normal_scale = -1.5f;
    if (i == 3) m.emissive_texture = 1, m.emissive_set = 1, m.emissive_transform = {3, 0, 0, 0, 1, 0.5f};
    s.materials.push_back(m);
  }
  Random random(3);
  for (uint32_t p = 0; p < 5; ++p) {
    Part part;
    part.name = p == 2 ? "" : "part " + std::to_string(p);
    part.material = p % 4, part.first_vertex = uint32_t(s.positions.size()), part.vertex_count = 4 + p;
    part.first_triangle = uint32_t(s.triangles.size()), part.triangle_count = 2;
    for (uint32_t i = 0; i < part.vertex_count; ++i) {
      s.positions.push_back({random.next(), random.next(), random.next()});
      s.normals.push_back(normalize(Vec3(random.next() - 0.5f, random.next() - 0.5f, random.next() + 0.1f)));
      s.texcoords[0].push_back(p == 0 ? Vec2(0.0f) : random.next2());
      s.texcoords[1].push_back(random.next2());
      s.tangents.push_back(Vec4(frame_about(s.normals.back())[0], p % 2 ? 1 : -1));
      s.colors.push_back(p < 2 ? Vec3(1.0f) : Vec3(random.next(), random.next(), random.next()));
    }
    uint32_t v = part.first_vertex;
    s.triangles.push_back({{v, v + 1, v + 2}, p, p >= 3}), s.triangles.push_back({{v + 3, v + 1, v}, p, p >= 3});
    s.parts.push_back(part);
  }
  return s;
}

TEST(SaveGlb, SceneWithoutADocument) {
  RoundTrip round_trip;
  Scene made = made_scene(), again = round_trip(made);
  expect_same(made, again);
  EXPECT_EQ(round_trip.json()["images"].size(), 2u) << "equal images are written once";
  EXPECT_EQ(round_trip.json()["asset"]["generator"], "lambent");
  EXPECT_EQ(again.materials[again.parts[0].material].name, "m0");
  expect_same(made, round_trip(again));
}

TEST(SaveGlb, ProceduralScene) {
  RoundTrip round_trip;
  Scene s = make_sphere(2, 2, {0.2f, 0.4f, 0.6f});
  expect_same(s, round_trip(s));
}

TEST(SaveGlb, SameInputSameBytes) {
  TemporaryFolder folder;
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), made_scene(), {}, {}));
  ASSERT_TRUE(save_gltf(folder.file("b.glb"), made_scene(), {}, {}));
  EXPECT_EQ(*read_file(folder.file("a.glb")), *read_file(folder.file("b.glb")));
}

TEST(SaveGlb, BlobsLieAtTheirAlignmentInTheFile) {
  TemporaryFolder folder;
  Bytes first = copy_bytes("first"), second = copy_bytes("second"), third = copy_bytes("third");
  std::vector<GltfBlob> blobs = {{first, 4}, {second, 4096}, {third, 64}};
  int calls = 0;
  auto saved = save_gltf(folder.file("a.glb"), made_scene(), blobs, [&](Json& document, const GltfPlaces& places) {
    ++calls;
    document["extensions"]["LAMBENT_test"] = {{"first", places.views[0][0]}};
    document["extensionsUsed"].push_back("LAMBENT_test");
    EXPECT_EQ(places.part_nodes, (std::vector<int>{0, 1, 2, 3, 4}));
    EXPECT_EQ(places.part_primitives, (std::vector<int>{0, 0, 0, 0, 0}));
  });
  ASSERT_TRUE(saved) << saved.error().text();
  EXPECT_EQ(calls, 1);
  Bytes file = *read_file(folder.file("a.glb"));
  auto chunks = split_gltf(file, "");
  ASSERT_TRUE(chunks);
  size_t view = chunks->json["extensions"]["LAMBENT_test"]["first"];
  for (const GltfBlob& blob : blobs) {
    const Json& json = chunks->json["bufferViews"][view++];
    size_t offset = json["byteOffset"], length = json["byteLength"];
    ASSERT_LE(offset + length, chunks->binary.size());
    EXPECT_EQ(size_t(chunks->binary.data() + offset - file.data()) % blob.alignment, 0u);
    EXPECT_TRUE(std::equal(blob.bytes.begin(), blob.bytes.end(), chunks->binary.data() + offset));
    EXPECT_EQ(length, blob.bytes.size());
  }
}

TEST(SaveGlb, KeepsTheDocument) {
  Builder b = triangle();
  b.json["asset"]["generator"] = "a tool";
  b.json["extras"] = {{"note", "kept"}, {"number", 0.1}};
  b.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 0.1}}}}};
  b.json["nodes"].push_back({{"camera", 0}, {"name", "eye"}});
  Scene s = *b.load();
  RoundTrip round_trip;
  expect_same(s, round_trip(s));
  Json json = round_trip.json();
  json.erase("buffers"), json.erase("bufferViews");
  Json before = b.json;
  before.erase("bufferViews");
  EXPECT_EQ(json, before);
}

TEST(SaveGlb, EmbedsBuffersAndImages) {
  TemporaryFolder folder;
  Builder b = triangle();
  Bytes png = make_png(1, 1, 3, 8, {9, 8, 7}), jpeg = {0xff, 0xd8, 0xff, 0}, other = copy_bytes("RIFF");
  write_bytes(folder.file("a.png"), png);
  write_bytes(folder.file("c.webp"), other);
  Bytes second = copy_bytes("0123456789");
  write_bytes(folder.file("second.bin"), second);
  Json json = b.finished();
  json["buffers"] = {{{"byteLength", b.binary.size()}, {"uri", "data:;base64," + base64(b.binary)}},
                     {{"byteLength", second.size()}, {"uri", "second.bin"}}};
  json["bufferViews"].push_back({{"buffer", 1}, {"byteOffset", 3}, {"byteLength", 4}});
  json["accessors"].push_back({{"bufferView", 3}, {"componentType", type_u8}, {"count", 3}, {"type", "SCALAR"}});
  json["meshes"][0]["primitives"][0]["attributes"]["_OTHER"] = json["accessors"].size() - 1;
  json["images"] = {{{"uri", "a.png"}},
                    {{"uri", "data:image/jpeg;base64," + base64(jpeg)}},
                    {{"uri", "c.webp"}},
                    {{"uri", "missing.png"}},
                    {{"uri", "a.png"}}};
  write_bytes(folder.file("in.gltf"), copy_bytes(json.dump()));
  auto s = load_scene(folder.file("in.gltf"));
  ASSERT_TRUE(s) << s.error().text();
  ASSERT_EQ(s->warnings.size(), 1u);
  EXPECT_EQ(s->warnings[0], "image 3: \"missing.png\" was not found; it stays a link");

  RoundTrip round_trip;
  expect_same(*s, round_trip(*s));
  Bytes file = *read_file(round_trip.path());
  auto chunks = split_gltf(file, "");
  const Json& out = chunks->json;
  auto view_bytes = [&](size_t view) {
    const uint8_t* p = chunks->binary.data() + size_t(out["bufferViews"][view]["byteOffset"]);
    return Bytes(p, p + size_t(out["bufferViews"][view]["byteLength"]));
  };
  ASSERT_EQ(out["buffers"].size(), 1u);
  EXPECT_FALSE(out["buffers"][0].contains("uri"));
  EXPECT_EQ(view_bytes(3), copy_bytes("3456"));
  EXPECT_EQ(view_bytes(out["images"][0]["bufferView"]), png);
  EXPECT_EQ(out["images"][0]["mimeType"], "image/png");
  EXPECT_EQ(view_bytes(out["images"][1]["bufferView"]), jpeg);
  EXPECT_EQ(out["images"][1]["mimeType"], "image/jpeg");
  EXPECT_EQ(view_bytes(out["images"][2]["bufferView"]), other);
  EXPECT_EQ(out["images"][2]["mimeType"], "image/webp");
  EXPECT_EQ(out["images"][3]["uri"], "missing.png");
  EXPECT_EQ(out["images"][4]["bufferView"], out["images"][0]["bufferView"]) << "a file named twice is embedded once";
}

// A node that mirrors, turns and stretches.
Json skew_node() {
  return {{"mesh", 0}, {"translation", {3, -2, 1}}, {"rotation", {0.5, 0.5, 0.5, 0.5}}, {"scale", {-1, 2, 0.5}}};
}

// A triangle with everything that copies must carry over, and without normals.
Builder rich_without_normals() {
  Builder b = triangle();
  Json& p = b.json["meshes"][0]["primitives"][0];
  p["attributes"].erase("NORMAL");
  p["attributes"]["TEXCOORD_0"] =
      b.accessor(std::vector<uint8_t>{0, 128, 0, 0, 255, 0, 0, 0, 1, 2, 0, 0}, type_u8, "VEC2", true);
  b.json["bufferViews"].back()["byteStride"] = 4;
  b.json["accessors"].back()["count"] = 3;
  p["attributes"]["COLOR_0"] =
      b.accessor(std::vector<uint16_t>{1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 0}, type_u16, "VEC3", true);
  b.json["bufferViews"].back()["byteStride"] = 8;
  b.json["accessors"].back()["count"] = 3;
  p["attributes"]["_MASS"] = b.floats({10, 20, 30}, "SCALAR");
  p["attributes"]["JOINTS_0"] = b.accessor(std::vector<uint8_t>{0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, type_u8, "VEC4");
  p["attributes"]["WEIGHTS_0"] = b.floats({0.25f, 0.75f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  p["targets"] = {{{"POSITION", b.floats({0, 0, 1, 0, 0, 2, 0, 0, 3}, "VEC3")}}};
  b.json["meshes"][0]["weights"] = {0.5};
  b.json["nodes"] = {{{"mesh", 0}, {"name", "body"}},
                     {{"translation", {1, 2, 3}}, {"rotation", {0, 0, 0.6, 0.8}}},
                     {{"scale", {1, 2, 1}}}};
  b.json["skins"] = {{{"joints", {1, 2}}}};
  size_t times = b.floats({0, 1}, "SCALAR"), weights = b.floats({0, 1}, "SCALAR"),
         moves = b.floats({0, 0, 0, 1, 1, 1}, "VEC3");
  b.json["animations"] = {{{"samplers", {{{"input", times}, {"output", weights}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}},
                          {{"samplers", {{{"input", times}, {"output", moves}}}},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}}}};
  return b;
}

TEST(SaveGlb, CopiedVerticesKeepAllTheirAttributes) {
  for (bool skinned : {false, true}) {
    Builder b = rich_without_normals();
    if (skinned) {
      b.json["nodes"][0]["skin"] = 0;
    } else {
      b.json["nodes"][0] = skew_node();
    }
    Scene s = *b.load();
    ASSERT_TRUE(s.parts[0].changed);
    // One more copy, as a split at a crease makes it.
    s.positions.push_back(s.positions[1]), s.normals.push_back(s.normals[1]), s.colors.push_back(s.colors[1]);
    s.texcoords[0].push_back(s.texcoords[0][1]);
    s.parts[0].source = {0, 1, 2, 1}, s.parts[0].vertex_count = 4;
    RoundTrip round_trip;
    Scene again = round_trip(s);
    expect_same(s, again);  // positions to the bit: they are copies, posed by the same transforms
    EXPECT_FALSE(again.parts[0].changed) << "now it has normals";
    Json json = round_trip.json();
    const Json& primitive = json["meshes"][0]["primitives"][0];
    const Json& mass = json["accessors"][size_t(primitive["attributes"]["_MASS"])];
    const Json& view = json["bufferViews"][size_t(mass["bufferView"])];
    float values[4];
    std::memcpy(values, split_gltf(*read_file(round_trip.path()), "")->binary.data() + size_t(view["byteOffset"]),
                sizeof values);
    EXPECT_EQ(values[2], 30);
    EXPECT_EQ(values[3], 20);
    const Json& joints = json["accessors"][size_t(primitive["attributes"]["JOINTS_0"])];
    EXPECT_EQ(joints["componentType"], type_u8);
    EXPECT_EQ(joints["count"], 4);
    EXPECT_EQ(primitive["targets"].size(), 1u);
    EXPECT_EQ(json["animations"].size(), 2u);
  }
}

TEST(SaveGlb, NewVerticesStandStillInTheirRestPose) {
  for (bool skinned : {false, true}) {
    Builder b = rich_without_normals();
    b.json["nodes"].push_back(skew_node());  // another user of the mesh, which stays as it is
    if (skinned) b.json["nodes"][0]["skin"] = 0;
    if (!skinned) b.json["nodes"][0] = skew_node(), b.json["nodes"][0]["name"] = "body";
    Scene s = *b.load();
    // A vertex that the document does not know.
    s.positions.insert(s.positions.begin() + 3, Vec3(5, 6, 7)), s.normals.insert(s.normals.begin() + 3, Vec3(0, 1, 0));
    s.colors.insert(s.colors.begin() + 3, Vec3(0.5f)), s.texcoords[0].insert(s.texcoords[0].begin() + 3, Vec2(0.5f));
    s.parts[0].source.clear(), s.parts[0].vertex_count = 4, s.parts[1].first_vertex = 4;
    s.triangles[0].v[2] = 3;
    for (uint32_t& v : s.triangles[1].v) ++v;

    RoundTrip round_trip;
    Scene again = round_trip(s);
    Json json = round_trip.json();
    EXPECT_EQ(json["animations"].size(), 1u) << "weights of a node without targets cannot be animated";
    if (!skinned) {
      expect_same(s, again, frame_rounding);
      EXPECT_NE(json["nodes"][0]["mesh"], json["nodes"][3]["mesh"]);
      continue;
    }
    // The skinned part moves to a new node after all others: parts change their order.
    ASSERT_EQ(again.parts.size(), 2u);
    EXPECT_EQ(again.parts[1].name, "body");
    EXPECT_EQ(again.parts[1].node, 4);
    EXPECT_FALSE(json["nodes"][0].contains("mesh"));
    EXPECT_FALSE(json["nodes"][0].contains("skin"));
    for (size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(again.positions[again.parts[1].first_vertex + i], s.positions[i]);
      EXPECT_LE(length(again.normals[again.parts[1].first_vertex + i] - s.normals[i]), normal_rounding);
    }
    EXPECT_EQ(again.triangles[1].v[2], again.parts[1].first_vertex + 3);
  }
}

TEST(SaveGlb, ChangedPartUnderASingularTransformMovesToItsOwnNode) {
  Builder b = triangle();
  b.json["nodes"][0]["scale"] = {2, 3, 0};  // flattens, but the triangle has no height anyway
  b.json["scenes"] = {{{"nodes", {0}}}};
  Scene s = *b.load();
  s.parts[0].changed = true;
  s.positions[0] = Vec3(0, 0, 1);
  RoundTrip round_trip;
  expect_same(s, round_trip(s));
  EXPECT_EQ(round_trip.json()["scenes"][0]["nodes"], (Json{0, 1}));
}

TEST(SaveGlb, ChangingOneOfTwoNodesCopiesTheMesh) {
  Builder b = triangle();
  b.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"translation", {5, 0, 0}}}};
  Scene s = *b.load();
  s.parts[1].changed = true;
  s.positions[3] = Vec3(7, 7, 7);
  RoundTrip round_trip;
  expect_same(s, round_trip(s), frame_rounding);
  EXPECT_EQ(round_trip.json()["meshes"].size(), 2u);
  s.parts[0].changed = true;
  s.positions[0] = Vec3(-3, 0, 0);
  expect_same(s, round_trip(s), frame_rounding);
  EXPECT_EQ(round_trip.json()["meshes"].size(), 2u) << "the last user takes the original over";
}

TEST(SaveGlb, DroppedTrianglesAndEmptiedParts) {
  Builder b = triangle();
  b.json["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}}};  // the second lies on the first
  Scene s = *b.load();
  ASSERT_EQ(s.triangles.size(), 1u);
  ASSERT_TRUE(s.parts[1].changed);
  RoundTrip round_trip;
  expect_same(s, round_trip(s));
}

TEST(SaveGlb, AddedPartsBecomeNodes) {
  for (bool with_scene : {false, true}) {
    Builder b = triangle();
    b.json["materials"] = {{{"name", "mine"}, {"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 0.25, 0.125, 1}}}}}};
    b.json["meshes"][0]["primitives"][0]["material"] = 0;
    if (with_scene) b.json["scenes"] = {Json::object(), {{"nodes", {0}}}}, b.json["scene"] = 1;
    Scene s = *b.load();
    uint32_t material = add_material(s, "floor", {0.5f, 0.5f, 0.5f});
    add_quad(s, material, "ground", {-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, 2, 3);
    RoundTrip round_trip;
    Scene again = round_trip(s);
    expect_same(s, again);
    EXPECT_EQ(again.materials[1].name, "floor");
    EXPECT_FALSE(again.triangles.back().two_sided);
  }
}

TEST(SaveGlb, NoMoreThanFourGigabytes) {
  const size_t size = size_t{1} << 32;
  void* reserved = mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);  // never read
  if (reserved == MAP_FAILED) GTEST_SKIP() << "no room for 4 GiB of addresses";
  TemporaryFolder folder;
  GltfBlob blob{{static_cast<const uint8_t*>(reserved), size}};
  auto saved = save_gltf(folder.file("a.glb"), made_scene(), {&blob, 1}, {});
  munmap(reserved, size);
  ASSERT_FALSE(saved);
  EXPECT_NE(saved.error().message.find("4 GiB"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.glb")));
}

TEST(SaveGlb, TextureWithoutItsImageIsAnError) {
  TemporaryFolder folder;
  Scene s = made_scene();
  s.textures[0].encoded.clear();
  EXPECT_FALSE(save_gltf(folder.file("a.glb"), s, {}, {}));
}

TEST(SaveGlb, RealScenes) {
  std::string data = data_folder();
  if (data.empty()) GTEST_SKIP() << "no data set: set LAMBENT_DATA";
  for (const char* name : {"CesiumMan.glb", "Fox.glb", "MorphStressTest.gltf", "room.glb", "shaderball.glb",
                           "zdm2_level.glb", "cornell_box_rounded.glb", "dutch_ship/dutch_ship_medium_1k.gltf"}) {
    SCOPED_TRACE(name);
    auto s = load_scene(data + "/meshes/" + name);
    ASSERT_TRUE(s) << s.error().text();
    RoundTrip round_trip;
    expect_same(*s, round_trip(*s));
    for (Part& part : s->parts) {  // all written anew, element by element
      if (part.changed) continue;
      part.changed = true, part.source.resize(part.vertex_count);
      for (uint32_t i = 0; i < part.vertex_count; ++i) part.source[i] = i;
    }
    expect_same(*s, round_trip(*s));
    for (Part& part : s->parts) part.source.clear();  // all written anew from the world
    expect_same(*s, round_trip(*s), frame_rounding);
  }
}

}  // namespace
}  // namespace lambent

// Files as exporters and optimisers really write them: each is the same scene as another one, said otherwise.
#include <lambent/core/random.h>
#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>

#include <algorithm>

namespace lambent {
namespace {

using namespace test;

void expect_same(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.texcoords, b.texcoords);
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  for (size_t t = 0; t < a.triangles.size(); ++t)
    EXPECT_TRUE(std::equal(a.triangles[t].v, a.triangles[t].v + 3, b.triangles[t].v)) << t;
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t p = 0; p < a.parts.size(); ++p) EXPECT_EQ(a.parts[p].material, b.parts[p].material);
}

// The scene as save_gltf() writes it, read again.
Scene saved(const Scene& scene, Json* document = nullptr, size_t* bytes = nullptr) {
  TemporaryFolder folder;
  const std::string path = folder.file("saved.glb");
  auto ok = save_gltf(path, scene, {}, [&](Json& json, const GltfPlaces&) {
    if (document) *document = json;
  });
  EXPECT_TRUE(ok) << (ok ? "" : ok.error().text());
  if (bytes) *bytes = std::filesystem::file_size(path);
  auto back = load_scene(path);
  EXPECT_TRUE(back) << (back ? "" : back.error().text());
  return back ? std::move(*back) : Scene();
}

// Places of instances, and the same as nodes: floats, a turn by an eighth as normalised shorts, and a mirror.
struct Places {
  std::vector<float> translations{1, 0, 0, 0, 2, 0, 0, 0, 3};
  std::vector<int16_t> rotations{0, 0, 0, 32767, 0, 12540, 0, 30274, 23170, 0, 0, 23170};
  std::vector<float> scales{1, 1, 1, 1, 3, 1, -2, 1, 1};
};

Builder instanced() {
  const Places p;
  Builder b = triangle();
  b.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  b.json["nodes"][0]["translation"] = {0, 0, 0.5};
  b.json["nodes"][0]["scale"] = {1, 2, 1};
  b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", b.floats(p.translations, "VEC3")},
      {"ROTATION", b.accessor(p.rotations, type_i16, "VEC4", true)},
      {"SCALE", b.floats(p.scales, "VEC3")}};
  return b;
}

Builder copied() {
  const Places p;
  Builder b = triangle();
  b.json["nodes"] = {{{"translation", {0, 0, 0.5}}, {"scale", {1, 2, 1}}, {"children", {1, 2, 3}}}};
  for (size_t i = 0; i < 3; ++i) {
    Json node = {{"mesh", 0}, {"rotation", Json::array()}};
    for (size_t c = 0; c < 4; ++c) node["rotation"].push_back(p.rotations[4 * i + c] / 32767.0);
    for (size_t c = 0; c < 3; ++c)
      node["translation"].push_back(p.translations[3 * i + c]), node["scale"].push_back(p.scales[3 * i + c]);
    b.json["nodes"].push_back(node);
  }
  return b;
}

TEST(GltfWild, InstancesAreCopies) {
  const Scene copies = loaded(copied());
  ASSERT_EQ(copies.parts.size(), 3u);
  Builder b = instanced();
  expect_same(loaded(b), copies);
  b.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  const Scene instances = loaded(b);
  expect_same(instances, copies);
  EXPECT_TRUE(instances.warnings.empty());
  // What is written has the copies as nodes, and no trace of the extension.
  Json document;
  expect_same(saved(instances, &document), copies);
  EXPECT_EQ(document["nodes"].size(), 4u);
  EXPECT_EQ(document["meshes"].size(), 1u);
  EXPECT_EQ(document.dump().find("EXT_mesh"), std::string::npos);
  EXPECT_EQ(document["accessors"].size(), 3u) << "the places' are gone";

  // Below a node that has children, and one instance where there are no attributes.
  Builder below = instanced();
  below.json["nodes"][0]["children"] = {1};
  below.json["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(loaded(below).parts.size(), 4u);
  Builder lone = triangle();
  lone.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = Json::object();
  expect_same(loaded(lone), loaded(triangle()));
  // Colours are told of, once.
  Builder coloured = instanced();
  auto& attributes = coloured.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  attributes["_COLOR_0"] = attributes["SCALE"];
  EXPECT_EQ(loaded(coloured).warnings, std::vector<std::string>{"colours of instances are not read (1 node)"});
}

TEST(GltfWild, InstancesWithoutNormalsStayOneMesh) {
  // Their normals are made and written, for all copies alike.
  Builder b = triangle();
  primitive(b)["attributes"].erase("NORMAL");
  std::vector<float> places;
  for (int i = 0; i < 100; ++i) places.insert(places.end(), {float(3 * i), 0, 0});
  b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", b.floats(places, "VEC3")}};
  const Scene scene = loaded(b);
  ASSERT_EQ(scene.parts.size(), 100u);
  Json document;
  expect_same(saved(scene, &document), scene);
  EXPECT_EQ(document["meshes"].size(), 1u);
  EXPECT_EQ(document["accessors"].size(), 3u);
}

TEST(GltfWild, InstancesMorphTogether) {
  Builder b = instanced();
  primitive(b)["targets"] = {{{"POSITION", b.floats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3")}}};
  b.json["nodes"][0]["weights"] = {1};
  b.json["animations"] = {
      {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}},
       {"samplers", {{{"input", b.floats({0, 1}, "SCALAR")}, {"output", b.floats({0, 1}, "SCALAR")}}}}}};
  const Scene scene = loaded(b);
  EXPECT_EQ(scene.positions[0], Vec3(1, 0, 1.5f));
  EXPECT_EQ(scene.document->json["animations"][0]["channels"].size(), 3u);
}

TEST(GltfWild, BrokenInstancesAreErrors) {
  const auto broken = [](auto change) {
    Builder b = instanced();
    change(b, b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]);
    return message(b);
  };
  EXPECT_NE(broken([](Builder& b, Json& a) {
              a["SCALE"] = b.floats({1, 1, 1}, "VEC3");
            }).find("differ in number"),
            std::string::npos);
  EXPECT_NE(broken([](Builder& b, Json& a) {
              a["SCALE"] = b.floats({1, 1, 1}, "SCALAR");
            }).find("3 floats"),
            std::string::npos);
  EXPECT_NE(broken([](Builder&, Json& a) { a["SCALE"] = 99; }).find("out of range"), std::string::npos);
  EXPECT_NE(broken([](Builder& b, Json& a) {
              a["TRANSLATION"] = b.floats({1, 0, 0, 0, NAN, 0, 0, 0, 3}, "VEC3");
            }).find("instance 1 is not at a finite place"),
            std::string::npos);
  EXPECT_NE(broken([](Builder& b, Json& a) {
              a = {{"TRANSLATION", b.accessor({{"componentType", type_f32}, {"count", 1 << 30}, {"type", "VEC3"}})}};
            }).find("no bytes"),
            std::string::npos);
  EXPECT_NE(broken([](Builder&, Json& a) { a = 7; }).find("attributes is not an object"), std::string::npos);
}

// Scenes without what is hidden: a child of a hidden node is, though it says visible; its lamp too.
TEST(GltfWild, HiddenNodesAreNotThere) {
  Builder b = triangle();
  b.json["extensionsUsed"] = {"KHR_node_visibility"};
  b.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  const auto visible = [](bool yes) { return Json{{"KHR_node_visibility", {{"visible", yes}}}}; };
  Json lamp = visible(true);
  lamp["KHR_lights_punctual"] = {{"light", 0}};
  b.json["nodes"] = {{{"mesh", 0}, {"extensions", visible(true)}},
                     {{"mesh", 0}, {"translation", {0, 0, 5}}, {"children", {2, 3}}, {"extensions", visible(false)}},
                     {{"mesh", 0}, {"extensions", visible(true)}},
                     {{"extensions", lamp}}};
  for (bool required : {false, true}) {
    if (required) b.json["extensionsRequired"] = {"KHR_node_visibility"};
    const Scene scene = loaded(b);
    expect_same(scene, loaded(triangle()));
    EXPECT_TRUE(scene.lights.empty());
    expect_same(saved(scene), scene);
  }
  b.json["nodes"][1]["extensions"] = visible(true);
  EXPECT_EQ(loaded(b).parts.size(), 3u);
  EXPECT_EQ(loaded(b).lights.size(), 1u);
  b.json["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = "no";
  EXPECT_EQ(message(b), "test.glb: node 1: visible is neither true nor false");
}

TEST(GltfWild, RootsThatHaveAParentStandWhereItPutsThem) {
  Builder b = triangle();
  b.json["nodes"] = {{{"translation", {0, 0, 5}}, {"children", {1, 2}}},
                     {{"mesh", 0}, {"translation", {1, 0, 0}}},
                     {{"mesh", 0}, {"translation", {2, 0, 0}}}};
  b.json["scenes"] = {{{"nodes", {0}}}};
  const Scene tree = loaded(b);
  for (const Json& roots : {Json{0, 1, 2}, Json{0, 0}, Json{1, 2}, Json{1, 0, 2}}) {
    b.json["scenes"][0]["nodes"] = roots;
    const Scene scene = loaded(b);
    expect_same(scene, tree);
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_NE(scene.warnings[0].find("shown once, where their parents put them"), std::string::npos);
  }
  b.json["scenes"][0]["nodes"] = {2};
  EXPECT_EQ(loaded(b).positions[0], Vec3(2, 0, 5));
}

// A grid of n x n quads as `pieces` primitives over one accessor of positions, and of colours in a form of their own.
Builder grid_in_pieces(int n, int pieces) {
  Builder b;
  std::vector<float> positions, normals;
  std::vector<uint8_t> colors;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      positions.insert(positions.end(), {float(i), float(j), 0.01f * float(i * j)}),
          normals.insert(normals.end(), {0, 0, 1});
      colors.insert(colors.end(), {uint8_t(i), uint8_t(j), 7, 255});
    }
  const Json attributes = {{"POSITION", b.floats(positions, "VEC3")},
                           {"NORMAL", b.floats(normals, "VEC3")},
                           {"COLOR_0", b.accessor(colors, type_u8, "VEC4", true)}};
  b.json["meshes"] = {{{"primitives", Json::array()}}};
  for (int p = 0; p < pieces; ++p) {
    std::vector<uint16_t> indices;
    for (int j = p * n / pieces; j < (p + 1) * n / pieces; ++j)
      for (int i = 0; i < n; ++i) {
        const int a = j * (n + 1) + i, c = a + n + 1;
        for (int v : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(uint16_t(v));
      }
    b.json["meshes"][0]["primitives"].push_back({{"attributes", attributes}, {"indices", b.indices(indices)}});
  }
  b.json["nodes"] = {{{"mesh", 0}}};
  return b;
}

TEST(GltfWild, PrimitivesTakeWhatTheyUseOfSharedAccessors) {
  constexpr int n = 64, pieces = 32;
  const Scene whole = loaded(grid_in_pieces(n, 1)), cut = loaded(grid_in_pieces(n, pieces));
  EXPECT_FALSE(whole.parts[0].changed);
  // Two rows of quads have three rows of vertices.
  EXPECT_EQ(cut.positions.size(), size_t(pieces * 3 * (n + 1)));
  EXPECT_EQ(cut.colors.size(), cut.positions.size());
  ASSERT_EQ(cut.triangles.size(), whole.triangles.size());
  for (size_t t = 0; t < cut.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = cut.triangles[t].v[k], c = whole.triangles[t].v[k];
      EXPECT_EQ(cut.positions[a], whole.positions[c]);
      EXPECT_EQ(cut.normals[a], whole.normals[c]);
      EXPECT_EQ(cut.colors[a], whole.colors[c]);
    }
  // The file does not grow by primitives x vertices, comes back the same, and needs no change any more.
  size_t bytes = 0;
  const Scene back = saved(cut, nullptr, &bytes);
  expect_same(back, cut);
  EXPECT_EQ(back.colors, cut.colors);
  for (const Part& part : back.parts) EXPECT_FALSE(part.changed);
  EXPECT_LT(bytes, 3 * grid_in_pieces(n, 1).glb().size());
  // What other primitives have there does no harm; one without triangles is left as it is.
  Builder broken = triangle();
  primitive(broken)["attributes"]["POSITION"] = broken.floats({0, 0, 0, 2, 0, 0, 0, 1, 0, NAN, 1e30f, 0}, "VEC3");
  primitive(broken)["attributes"].erase("NORMAL");
  EXPECT_NE(message(broken).find("vertex 3 is not at a finite position"), std::string::npos);
  broken.json["meshes"].push_back(broken.json["meshes"][0]);
  EXPECT_EQ(loaded(broken).positions.size(), 3u);
  Builder idle = grid_in_pieces(2, 2);
  primitive(idle, 1)["indices"] = idle.indices({0, 0, 0});
  const Scene still = loaded(idle);
  EXPECT_EQ(still.parts[1].vertex_count, 9u);
  expect_same(saved(still), still);
}

TEST(GltfWild, TexturesReadAnySetOfCoordinates) {
  const Bytes colors = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  const std::vector<float> places{0.25f, 0.25f, 0.75f, 0.25f, 0.25f, 0.75f};
  const auto textured = [&](size_t set, size_t named) {
    Builder b = triangle();
    for (size_t k = 0; k < set; ++k)
      primitive(b)["attributes"]["TEXCOORD_" + std::to_string(k)] = b.floats({9, 9, 8, 8, 7, 7}, "VEC2");
    primitive(b)["attributes"]["TEXCOORD_" + std::to_string(set)] = b.floats(places, "VEC2");
    primitive(b)["material"] = 0;
    b.json["images"] = {{{"bufferView", b.view(make_png(2, 2, 3, 8, colors))}, {"mimeType", "image/png"}}};
    b.json["textures"] = {{{"source", 0}}};
    b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}, {"texCoord", named}}}}}}};
    return b;
  };
  const Scene first = loaded(textured(0, 0));
  for (size_t set : {1, 2, 3, 7, 31}) {
    const Scene scene = loaded(textured(set, set));
    EXPECT_TRUE(scene.warnings.empty());
    EXPECT_GT(scene.texcoords.size(), set);
    for (Vec2 at : {Vec2(0.1f, 0.2f), Vec2(0.7f, 0.1f), Vec2(0.3f, 0.6f)})
      EXPECT_EQ(albedo(scene, scene.triangles[0], at.x, at.y), albedo(first, first.triangles[0], at.x, at.y)) << set;
    EXPECT_EQ(saved(scene).texcoords, scene.texcoords);
  }
  // Beyond all: the base colour, and a warning.
  const Scene beyond = loaded(textured(2, 4000000000));
  EXPECT_EQ(albedo(beyond, beyond.triangles[0], 0.1f, 0.2f), Vec3(1));
  ASSERT_EQ(beyond.warnings.size(), 1u);
  EXPECT_NE(beyond.warnings[0].find("TEXCOORD_4000000000"), std::string::npos);
}

TEST(GltfWild, CoordinatesBeyondAnyUseAreAnError) {
  const char* expected = "test.glb: mesh 0, primitive 0: vertex 1 is not at a finite position or beyond 1e9";
  for (float far : {1.1e9f, 1e19f, -3e38f}) {
    Builder b = triangle();
    primitive(b)["attributes"]["POSITION"] = b.floats({0, 0, 0, 2, far, 0, 0, 1, 0}, "VEC3");
    EXPECT_EQ(message(b), expected);
  }
  Builder b = triangle();
  b.json["nodes"][0]["scale"] = {6e8, 1, 1};
  EXPECT_EQ(message(b), expected);
  b.json["nodes"][0]["scale"] = {4e8, 1, 1};
  EXPECT_EQ(message(b), "loaded");
}

}  // namespace
}  // namespace lambent

// Compressed geometry against the same scene said plainly.
#include <lambent/core/random.h>
#include <lambent/scene/gltf_compressed.h>
#include <lambent/scene/gltf_packed_test-inl.h>
#include <lambent/scene/pose.h>

#include <draco/core/varint_encoding.h>
#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

constexpr const char* draco_name = "KHR_draco_mesh_compression";

Scene loaded(const Bytes& bytes) {
  auto scene = load_gltf(bytes, "test.glb", "");
  if (scene) return std::move(*scene);
  ADD_FAILURE() << scene.error().text();
  return *triangle().load();
}

std::string message(const Bytes& bytes) {
  auto scene = load_gltf(bytes, "test.glb", "");
  return scene ? "loaded" : scene.error().text();
}

// The same vertices and triangles in the same order.
void expect_same(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.texcoords[0], b.texcoords[0]);
  EXPECT_EQ(a.colors, b.colors);
  ASSERT_EQ(a.triangles.size(), b.triangles.size());
  for (size_t t = 0; t < a.triangles.size(); ++t) {
    std::array<uint32_t, 3> p, q;  // from the same corner on: the codecs turn triangles
    std::copy_n(a.triangles[t].v, 3, p.begin()), std::copy_n(b.triangles[t].v, 3, q.begin());
    std::rotate(p.begin(), std::min_element(p.begin(), p.end()), p.end());
    std::rotate(q.begin(), std::min_element(q.begin(), q.end()), q.end());
    EXPECT_EQ(p, q) << t;
  }
}

// A corner of a triangle with all that it carries.
using Corner = std::array<float, 11>;
std::vector<std::array<Corner, 3>> sorted_corners(const Scene& s) {
  std::vector<std::array<Corner, 3>> out;
  for (const Triangle& t : s.triangles) {
    std::array<Corner, 3> corners;
    for (size_t k = 0; k < 3; ++k) {
      const Vec3 p = s.positions[t.v[k]], n = s.normals[t.v[k]], c = s.colors[t.v[k]];
      const Vec2 uv = s.texcoords[0][t.v[k]];
      corners[k] = {p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y, c.x, c.y, c.z};
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    out.push_back(corners);
  }
  std::sort(out.begin(), out.end());
  return out;
}

TEST(GltfDraco, SequentialIsTheSameFile) {
  const Hills hills;
  expect_same(loaded(draco_file(hills, false, 0)), loaded(hills.plain()));
}

TEST(GltfDraco, EdgebreakerIsTheSameTriangles) {
  const Hills hills;
  EXPECT_EQ(sorted_corners(loaded(draco_file(hills, true, 0))), sorted_corners(loaded(hills.plain())));
}

TEST(GltfDraco, QuantisedIsWithinItsSteps) {
  const Hills hills;
  constexpr int bits = 14;
  const auto close = sorted_corners(loaded(draco_file(hills, true, bits))),
             plain = sorted_corners(loaded(hills.plain()));
  ASSERT_EQ(close.size(), plain.size());
  // Half a step of the widest range (4 of positions), and of octahedral normals, whose steps are at most twice as wide.
  const float step = 4.0f / float((1 << bits) - 1);
  for (size_t t = 0; t < close.size(); ++t)
    for (size_t k = 0; k < 3; ++k)
      for (size_t c = 0; c < plain[t][k].size(); ++c) EXPECT_NEAR(close[t][k][c], plain[t][k][c], 0.51f * step) << t;
}

TEST(GltfDraco, WhatIsSavedIsPlain) {
  const Hills hills;
  TemporaryFolder folder;
  Builder b = draco_file(hills, true, 11);
  for (int copies = 0; copies < 2; ++copies) b.json["meshes"].push_back(b.json["meshes"][0]);
  b.json["meshes"][2]["primitives"][0]["attributes"].erase("COLOR_0");
  for (int n : {1, 2}) b.json["nodes"].push_back({{"mesh", n}, {"translation", {0, 9 * n, 0}}});
  Scene scene = loaded(b);
  ASSERT_EQ(scene.parts.size(), 3u);
  EXPECT_EQ(scene.document->json["meshes"][0], scene.document->json["meshes"][1]) << "decoded once";
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), scene, {}, {}));
  auto bytes = read_file(folder.file("a.glb"));
  ASSERT_TRUE(bytes);
  const Scene again = loaded(*bytes);
  expect_same(again, scene);
  const std::string json = again.document->json.dump();
  EXPECT_EQ(json.find("draco"), std::string::npos);
  EXPECT_FALSE(again.document->json.contains("extensionsRequired"));
  // Positions, normals, coordinates, colours twice over but for the latter; the stream itself is gone.
  const size_t attributes = hills.count() * (32 * 2 + 4), indices = hills.indices.size() * 4 * 2;
  EXPECT_LT(again.document->buffers[0].size(), attributes + indices + 2 * 64);
}

TEST(GltfDraco, OtherAttributesStayBesideIt) {
  const Hills hills;
  Builder b = draco_file(hills, false, 0);
  Json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["extensions"][draco_name]["attributes"].erase("TEXCOORD_0");
  primitive["attributes"]["TEXCOORD_0"] = b.floats(hills.texcoords, "VEC2");
  expect_same(loaded(b), loaded(hills.plain()));
}

// The beginning of a stream that states these counts.
Bytes lying_stream(bool edgebreaker, uint32_t first, uint32_t second) {
  draco::EncoderBuffer buffer;
  const char magic[] = {'D', 'R', 'A', 'C', 'O', 2, 2, draco::TRIANGULAR_MESH, char(edgebreaker), 0, 0};
  buffer.Encode(magic, sizeof magic);
  if (edgebreaker) buffer.Encode(uint8_t(0));
  draco::EncodeVarint(first, &buffer), draco::EncodeVarint(second, &buffer);
  for (int i = 0; i < 100; ++i) buffer.Encode(uint8_t(1));
  return Bytes(buffer.data(), buffer.data() + buffer.size());
}

TEST(GltfDraco, CountsThatLieEndBeforeMemoryIsTaken) {
  const Hills hills;
  for (bool edgebreaker : {false, true})
    for (auto [first, second] : {std::pair{400'000'000u, 300'000'000u}, {2'000'000u, 3u}, {3u, 2'000'000u}}) {
      Builder b = draco_file(hills, false, 0);
      b.json["meshes"][0]["primitives"][0]["extensions"][draco_name]["bufferView"] =
          b.view(lying_stream(edgebreaker, first, second));
      EXPECT_EQ(message(b.glb()),
                "test.glb: mesh 0, primitive 0: KHR_draco_mesh_compression states more than its bytes may expand to");
    }
  Builder b = draco_file(hills, false, 0);
  b.json["meshes"][0]["primitives"][0]["extensions"][draco_name]["bufferView"] = b.view(lying_stream(true, 30, 20));
  EXPECT_EQ(message(b.glb()), "test.glb: mesh 0, primitive 0: KHR_draco_mesh_compression is broken");
}

TEST(GltfMeshopt, IsTheSameFile) {
  const Hills hills;
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
    expect_same(loaded(meshopt_file(hills, name).glb()), loaded(hills.plain()));
}

TEST(GltfMeshopt, SequencesOfIndices) {
  const Hills hills;
  MeshoptBuilder m = meshopt_file(hills);
  const std::vector<uint16_t> strip = {0, 5, 1, 6, 2, 7, 3, 8, 4, 9};
  const size_t view = m.view(meshopt_sequence(strip, hills.count()), strip.size(), 2, "INDICES");
  Json& primitive = m.file.json["meshes"][0]["primitives"][0];
  primitive["mode"] = 5;
  primitive["indices"] =
      m.file.accessor({{"bufferView", view}, {"componentType", type_u16}, {"count", strip.size()}, {"type", "SCALAR"}});
  Builder plain = hills.plain();
  plain.json["meshes"][0]["primitives"][0]["mode"] = 5;
  plain.json["meshes"][0]["primitives"][0]["indices"] = plain.indices(strip);
  expect_same(loaded(m.glb()), loaded(plain));
}

TEST(GltfMeshopt, FiltersAreWithinTheirSteps) {
  const Hills hills;
  const size_t count = hills.count();
  MeshoptBuilder m = meshopt_file(hills);
  std::vector<float> padded;  // four floats a normal
  for (size_t i = 0; i < count; ++i)
    padded.insert(padded.end(), {hills.normals[3 * i], hills.normals[3 * i + 1], hills.normals[3 * i + 2], 0});
  std::vector<int16_t> normals(4 * count);
  meshopt_encodeFilterOct(normals.data(), count, 8, 16, padded.data());
  std::vector<uint32_t> positions(3 * count);
  meshopt_encodeFilterExp(positions.data(), count, 12, 20, hills.positions.data());
  Json& attributes = m.file.json["meshes"][0]["primitives"][0]["attributes"];
  Json normal = {{"componentType", type_i16}, {"count", count}, {"type", "VEC3"}, {"normalized", true}};
  normal["bufferView"] = m.view(meshopt_attributes(normals.data(), count, 8), count, 8, "ATTRIBUTES", "OCTAHEDRAL");
  attributes["NORMAL"] = m.file.accessor(normal);
  Json position = {{"componentType", type_f32}, {"count", count}, {"type", "VEC3"}};
  position["bufferView"] =
      m.view(meshopt_attributes(positions.data(), count, 12), count, 12, "ATTRIBUTES", "EXPONENTIAL");
  attributes["POSITION"] = m.file.accessor(position);
  const Scene close = loaded(m.glb()), plain = loaded(hills.plain());
  for (size_t i = 0; i < count; ++i)
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(close.normals[i][c], plain.normals[i][c], 2e-4f) << "16 bits";
      EXPECT_NEAR(close.positions[i][c], plain.positions[i][c], 4e-6f) << "20 bits of up to 4";
    }
}

TEST(GltfMeshopt, QuaternionsOfAnAnimation) {
  // Less than half a circle from one to the next.
  const Hills hills;
  const std::vector<float> times = {0, 1, 2}, turns = {0, 0, 0, 1, 0.24f, 0.3f, -0.32f, 0.8660254f, 0, 0.6f, 0, 0.8f};
  const auto animate = [&](Builder& b, const Json& output) {
    const size_t input = b.floats(times, "SCALAR");
    b.json["accessors"][input]["min"] = {0}, b.json["accessors"][input]["max"] = {2};
    b.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "rotation"}}}}}},
                             {"samplers", {{{"input", input}, {"output", b.accessor(output)}}}}}};
  };
  std::vector<int16_t> packed(4 * times.size());
  meshopt_encodeFilterQuat(packed.data(), times.size(), 8, 16, turns.data());
  MeshoptBuilder m = meshopt_file(hills);
  Json output = {{"componentType", type_i16}, {"count", 3}, {"type", "VEC4"}, {"normalized", true}};
  output["bufferView"] = m.view(meshopt_attributes(packed.data(), 3, 8), 3, 8, "ATTRIBUTES", "QUATERNION");
  animate(m.file, output);
  Builder plain = hills.plain();
  const Json floats = {{"bufferView", plain.view(turns)}, {"componentType", type_f32}, {"count", 3}, {"type", "VEC4"}};
  animate(plain, floats);
  for (double time : {0.0, 0.5, 1.0, 2.0}) {
    auto a = pose_scene(loaded(m.glb()), 0, time), b = pose_scene(loaded(plain), 0, time);
    ASSERT_TRUE(a) << a.error().text();
    ASSERT_TRUE(b) << b.error().text();
    for (size_t i = 0; i < a->positions.size(); ++i)
      EXPECT_LT(length(a->positions[i] - b->positions[i]), 5e-4f) << "15 bits, 4 wide";
  }
}

TEST(GltfMeshopt, WhatIsSavedIsPlain) {
  const Hills hills;
  TemporaryFolder folder;
  const Scene scene = loaded(meshopt_file(hills).glb());
  ASSERT_TRUE(save_gltf(folder.file("a.glb"), scene, {}, {}));
  auto bytes = read_file(folder.file("a.glb"));
  ASSERT_TRUE(bytes);
  const Scene again = loaded(*bytes);
  expect_same(again, scene);
  EXPECT_EQ(again.document->json.dump().find("meshopt"), std::string::npos);
  EXPECT_EQ(again.document->json["buffers"].size(), 1u);
  EXPECT_LT(again.document->buffers[0].size(), hills.count() * 36 + hills.indices.size() * 2 + 6 * 64);
}

TEST(GltfMeshopt, WhatIsNotReadIsRefusedByNameOrTakenFromTheFallback) {
  const Hills hills;
  const Json& (*extension_of)(const Json&) = [](const Json& json) -> const Json& {
    return json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"];
  };
  MeshoptBuilder m = meshopt_file(hills);
  const size_t at = extension_of(m.finished())["byteOffset"].get<size_t>();
  m.file.binary[at] = 0xa2;
  EXPECT_EQ(message(m.glb()),
            "test.glb: buffer view 0: EXT_meshopt_compression: version 2 of the attribute codec is not supported");
  // The bytes of the fallback, where there are any: positions, in another buffer.
  Json json = m.finished();
  Bytes positions(hills.positions.size() * sizeof(float));
  std::memcpy(positions.data(), hills.positions.data(), positions.size());
  json["buffers"][1]["uri"] = "data:application/octet-stream;base64," + base64(positions);
  expect_same(loaded(make_glb(json, m.file.binary)), loaded(hills.plain()));

  json = meshopt_file(hills).finished();
  json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["filter"] = "SPLINE";
  EXPECT_EQ(message(make_glb(json, meshopt_file(hills).file.binary)),
            "test.glb: buffer view 0: EXT_meshopt_compression: the filter \"SPLINE\" is not supported");
}

// Buffers that say nothing of themselves may lack bytes as well, where only compressed views stand in them.
TEST(GltfMeshopt, PlaceholdersNeedNoMark) {
  const Hills hills;
  const MeshoptBuilder m = meshopt_file(hills);
  Json json = m.finished();
  json["buffers"][1].erase("extensions");
  expect_same(loaded(make_glb(json, m.file.binary)), loaded(hills.plain()));
  json["bufferViews"][0].erase("extensions");
  EXPECT_EQ(message(make_glb(json, m.file.binary)), "test.glb: buffer view 0: reaches past the end of buffer 1");
}

TEST(GltfMeshopt, WhatLiesIsRefused) {
  const Hills hills;
  const MeshoptBuilder good = meshopt_file(hills);
  const auto told = [&](const Json& change) {
    Json json = good.finished();
    json["bufferViews"][size_t(change["view"])]["extensions"]["EXT_meshopt_compression"].update(change["with"]);
    return message(make_glb(json, good.file.binary));
  };
  const std::string view = "test.glb: buffer view 0: ", ours = view + "EXT_meshopt_compression: ";
  EXPECT_EQ(told({{"view", 0}, {"with", {{"count", 4'000'000'000u}}}}),
            ours + "is broken: too few bytes for its count");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"count", hills.count() + 300}}}}), ours + "is broken");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"byteStride", 6}}}}), ours + "its byteStride is not a multiple of 4");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"byteStride", 0}}}}), ours + "its byteStride is not a multiple of 4");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"filter", "OCTAHEDRAL"}}}}),
            ours + "OCTAHEDRAL goes with a stride of 4 or 8");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"mode", "LINES"}}}}), ours + "mode \"LINES\" does not exist");
  EXPECT_EQ(told({{"view", 0}, {"with", {{"byteLength", 1'000'000}}}}),
            view + "its compressed stream reaches past the end of buffer 0");
  EXPECT_EQ(told({{"view", 4}, {"with", {{"count", 97}}}}),
            "test.glb: buffer view 4: EXT_meshopt_compression: its count is not a multiple of 3");
  EXPECT_EQ(told({{"view", 4}, {"with", {{"count", 3'000'000}}}}),
            "test.glb: buffer view 4: EXT_meshopt_compression: is broken: too few bytes for its count");
}

TEST(GltfMeshopt, ManyViewsOfOneStreamEndByTheBudget) {
  // 16 MiB of zeros in 256 KiB of stream, said 64 times over.
  constexpr size_t count = size_t{1} << 16, stride = 256;
  MeshoptBuilder m = meshopt_file(Hills());
  m.view(meshopt_attributes(Bytes(count * stride, 0).data(), count, stride), count, stride, "ATTRIBUTES");
  Json json = m.finished();
  const Json last = json["bufferViews"].back();
  for (int i = 0; i < 64; ++i) json["bufferViews"].push_back(last);
  EXPECT_NE(message(make_glb(json, m.file.binary)).find("the file expands to more than it may"), std::string::npos);
}

// Any change of a compressed file: an error of one line, or a scene.
TEST(GltfCompressed, ChangedBytesGiveAnErrorOrAValidScene) {
  const Hills hills;
  for (const Bytes& file :
       {draco_file(hills, true, 10).glb(), draco_file(hills, false, 0).glb(), meshopt_file(hills).glb()}) {
    Random random(5);
    size_t read = 0;
    for (int i = 0; i < 1500; ++i) {
      Bytes changed = file;
      for (int k = 0; k < 1 + i % 3; ++k) changed[random.next64() % changed.size()] = uint8_t(random.next64());
      auto scene = load_gltf(changed, "changed", "");
      if (!scene) {
        ASSERT_EQ(scene.error().text().find('\n'), std::string::npos);
        continue;
      }
      ++read;
      ASSERT_FALSE(scene->triangles.empty());
      for (const Triangle& t : scene->triangles)
        for (uint32_t v : t.v) ASSERT_LT(v, scene->positions.size());
      for (Vec3 p : scene->positions) ASSERT_TRUE(is_finite(p));
    }
    EXPECT_GT(read, 10u) << "some bytes are of no consequence";
  }
}

TEST(GltfCompressed, EveryTruncationIsAnError) {
  const Hills hills;
  for (const Bytes& file : {draco_file(hills, true, 10).glb(), meshopt_file(hills).glb()})
    for (size_t n = 0; n < file.size(); ++n)
      ASSERT_FALSE(load_gltf(Bytes(file.begin(), file.begin() + ptrdiff_t(n)), "cut", "")) << n;
}

// The seeds of the fuzzer are these files.
TEST(GltfCompressed, SeedsAreReadAsTheSameScene) {
  const std::string folder = std::filesystem::path(__FILE__).parent_path() / "../../../fuzz/corpus_gltf/";
  const auto plain = sorted_corners(loaded(Hills().plain()));
  for (const char* name : {"draco_edgebreaker.glb", "draco_sequential.glb", "meshopt.glb"}) {
    auto bytes = read_file(folder + name);
    ASSERT_TRUE(bytes) << name;
    EXPECT_EQ(sorted_corners(loaded(*bytes)), plain) << name;
  }
}

}  // namespace
}  // namespace lambent

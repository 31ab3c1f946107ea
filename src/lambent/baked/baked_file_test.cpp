#include <lambent/baked/baked_file.h>
#include <lambent/core/file.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

namespace lambent {
namespace {

struct TemporaryFile {
  std::string path;
  explicit TemporaryFile(const std::string& name)
      : path((std::filesystem::temp_directory_path() / ("lambent_" + std::to_string(::getpid()) + "_" + name)).string()) {}
  ~TemporaryFile() { std::filesystem::remove(path); }
};

struct Small {
  Scene scene;
  Receivers receivers;
  WritableTransfer transfer;
};

Small small_bake(int channels, Precision precision) {
  Small s;
  const uint32_t m = add_material(s.scene, "grey", Vec3(0.5f));
  add_box(s.scene, m, "box", Vec3(-1), Vec3(1), 2);
  add_quad(s.scene, add_material(s.scene, "sheet", Vec3(0.2f, 0.5f, 0.7f)), "sheet", Vec3(2, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1);
  s.scene.materials.back().double_sided = true;
  for (Triangle& t : s.scene.triangles) t.two_sided = t.part == 1;
  s.receivers = make_vertex_receivers(s.scene);
  s.transfer = make_transfer({.order = 3}, 1, channels, s.receivers.count(), precision);
  Random random(2);
  std::vector<float> row(size_t(9 * channels));
  for (size_t r = 0; r < s.receivers.count(); ++r) {
    for (float& v : row) v = random.next();
    store_receiver(s.transfer, r, row);
  }
  return s;
}

TEST(BakedFile, ComesBackAsItWas) {
  for (Precision precision : {Precision::half, Precision::single})
    for (int channels : {1, 3}) {
      const TemporaryFile file("round_trip.glb");
      const Small s = small_bake(channels, precision);
      ASSERT_TRUE(save_baked(file.path, s.scene, s.receivers, s.transfer.transfer, R"({"options":{"order":3}})"));
      EXPECT_TRUE(is_baked(file.path));
      auto back = load_baked(file.path);
      ASSERT_TRUE(back) << back.error().text();
      EXPECT_EQ(back->scene.positions, s.scene.positions);
      EXPECT_EQ(back->scene.normals, s.scene.normals);
      EXPECT_EQ(back->scene.triangles.size(), s.scene.triangles.size());
      EXPECT_EQ(back->front, s.receivers.front);
      EXPECT_EQ(back->back, s.receivers.back);
      EXPECT_EQ(back->transfer.light.order, 3);
      EXPECT_EQ(back->transfer.channels, channels);
      EXPECT_EQ(back->transfer.precision, precision);
      EXPECT_TRUE(std::equal(back->transfer.data.begin(), back->transfer.data.end(), s.transfer.transfer.data.begin(), s.transfer.transfer.data.end()));
      EXPECT_EQ(back->provenance, R"({"options":{"order":3}})");
      EXPECT_EQ(reinterpret_cast<uintptr_t>(back->transfer.data.data()) % 64, 0u);  // in place, fit for SIMD
    }
}

TEST(BakedFile, MatricesComeBackWithTheirLastReflection) {
  Small s = small_bake(1, Precision::half);
  const size_t n = s.receivers.count();
  Random random(8);
  for (OutgoingKind kind : {OutgoingKind::map, OutgoingKind::svd, OutgoingKind::sh, OutgoingKind::hsh}) {
    Outgoing o;
    o.kind = kind, o.order = 2, o.has_b = kind == OutgoingKind::sh;
    const bool mapped = kind == OutgoingKind::map || kind == OutgoingKind::svd;
    if (mapped)
      for (int m = 0; m < 3; ++m) {
        ViewMap map{5, 4, std::vector<ViewWeights>(100)};
        for (ViewWeights& w : map.values) w = ViewWeights(random.next(), random.next(), random.next(), random.next());
        o.maps.push_back(std::move(map));
      }
    for (size_t r = 0; r < n; ++r) {
      if (mapped) o.map_of.push_back(uint16_t(r % 3));
      o.frames.push_back(frame_about(normalize_or(Vec3(random.next(), random.next(), random.next() - 0.5f), Vec3(0, 0, 1))));
    }
    const WritableTransfer w = make_transfer({.order = 3}, o.rows(), 3, n, Precision::single);
    std::vector<float> values(w.transfer.receiver_values());
    for (size_t r = 0; r < n; ++r) {
      for (float& v : values) v = random.next();
      store_receiver(w, r, values);
    }
    const TemporaryFile file("matrix.glb"), cut("matrix_cut.glb");
    ASSERT_TRUE(save_baked(file.path, s.scene, s.receivers, w.transfer, "{}", &o));
    auto back = load_baked(file.path);
    ASSERT_TRUE(back) << back.error().text();
    ASSERT_TRUE(back->outgoing);
    EXPECT_EQ(back->transfer.rows, o.rows());
    EXPECT_TRUE(std::equal(back->transfer.data.begin(), back->transfer.data.end(), w.transfer.data.begin(), w.transfer.data.end()));
    std::vector<ViewWeights> a(size_t(o.rows())), b(a.size());
    for (size_t r = 0; r < n; ++r) {
      const Vec3 view = normalize_or(o.frames[r] * Vec3(0.3f, -0.5f, 0.6f), Vec3(0));
      evaluate_outgoing(o, r, view, a), evaluate_outgoing(*back->outgoing, r, view, b);
      for (size_t k = 0; k < a.size(); ++k) EXPECT_LT(glm::length(a[k] - b[k]), mapped ? 2e-3f : 1e-5f);  // maps are halves
    }
    const std::vector<uint8_t> bytes = *read_file(file.path);
    for (size_t length = 0; length < bytes.size(); length += 997) {
      const std::span<const uint8_t> piece(bytes.data(), length);
      ASSERT_TRUE(write_file_atomically(cut.path, {&piece, 1}));
      EXPECT_FALSE(load_baked(cut.path)) << length;
    }
  }
}

TEST(BakedFile, IsTheSameBytesEveryTime) {
  const TemporaryFile a("a.glb"), b("b.glb");
  const Small s = small_bake(3, Precision::half);
  ASSERT_TRUE(save_baked(a.path, s.scene, s.receivers, s.transfer.transfer, "{}"));
  ASSERT_TRUE(save_baked(b.path, s.scene, s.receivers, s.transfer.transfer, "{}"));
  EXPECT_EQ(*read_file(a.path), *read_file(b.path));
}

TEST(BakedFile, RefusesEveryTruncation) {
  const TemporaryFile whole("whole.glb"), cut("cut.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(save_baked(whole.path, s.scene, s.receivers, s.transfer.transfer, "{}"));
  const std::vector<uint8_t> bytes = *read_file(whole.path);
  // Every length at the front, where the headers are; then every 61st.
  for (size_t length = 0; length < bytes.size(); length += length < 256 ? 1 : 61) {
    const std::span<const uint8_t> piece(bytes.data(), length);
    ASSERT_TRUE(write_file_atomically(cut.path, {&piece, 1}));
    EXPECT_FALSE(load_baked(cut.path)) << length;
  }
}

// Replaces text in the JSON chunk by text of the same length.
std::vector<uint8_t> edited(std::vector<uint8_t> bytes, const std::string& from, const std::string& to) {
  EXPECT_EQ(from.size(), to.size());
  const auto at = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
  EXPECT_NE(at, bytes.end()) << from;
  if (at != bytes.end()) std::copy(to.begin(), to.end(), at);
  return bytes;
}

TEST(BakedFile, RefusesHeadersThatLie) {
  const TemporaryFile whole("lie.glb"), lying("lying.glb");
  const Small s = small_bake(1, Precision::half);
  ASSERT_TRUE(save_baked(whole.path, s.scene, s.receivers, s.transfer.transfer, "{}"));
  const std::vector<uint8_t> bytes = *read_file(whole.path);
  const std::string receivers = "\"receivers\":" + std::to_string(s.receivers.count());
  const std::pair<std::string, std::string> lies[] = {{"\"version\":1}", "\"version\":2}"},
                                                      {"\"order\":3", "\"order\":4"},
                                                      {"\"order\":3", "\"order\":0"},
                                                      {"\"channels\":1", "\"channels\":2"},
                                                      {"\"channels\":1", "\"channels\":3"},
                                                      {receivers, receivers.substr(0, receivers.size() - 1) + (receivers.back() == '0' ? "1" : "0")},
                                                      {"\"kind\":\"diffuse\"", "\"kind\":\"unknown\""},
                                                      {"\"precision\":\"half\"", "\"precision\":\"hal?\""}};
  for (const auto& [from, to] : lies) {
    const auto changed = edited(bytes, from, to);
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    auto result = load_baked(lying.path);
    ASSERT_FALSE(result) << to;
    EXPECT_EQ(result.error().text().find('\n'), std::string::npos);
    EXPECT_NE(result.error().text().find(lying.path), std::string::npos);
  }
}

TEST(BakedFile, LobesComeBackAndTheirHeadersMayNotLie) {
  Small s = small_bake(1, Precision::half);
  const LightBasis light{2, LobeKind::cosine_power, {{Vec3(0, 1, 0), 50}, {glm::normalize(Vec3(0.3f, -0.5f, 0.8f)), 77777.5f}}, {"desk", "roof"}};
  const WritableTransfer w = make_transfer(light, 1, 1, s.receivers.count(), Precision::half);
  const TemporaryFile file("lobes.glb"), lying("lobes_lying.glb");
  ASSERT_TRUE(save_baked(file.path, s.scene, s.receivers, w.transfer, "{}"));
  auto back = load_baked(file.path);
  ASSERT_TRUE(back) << back.error().text();
  const LightBasis& got = back->transfer.light;
  EXPECT_EQ(got.order, 2);
  EXPECT_EQ(got.lobe_kind, LobeKind::cosine_power);
  EXPECT_EQ(got.groups, light.groups);
  ASSERT_EQ(got.lobes.size(), 2u);
  for (size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(got.lobes[k].axis, light.lobes[k].axis);
    EXPECT_EQ(got.lobes[k].sharpness, light.lobes[k].sharpness);
  }
  const std::vector<uint8_t> bytes = *read_file(file.path);
  const std::pair<std::string, std::string> lies[] = {{"cosine_power", "cosine_tower"},           {"lobeKind", "lobeKine"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,-5.0]"}, {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,5e99]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,2.0,0.0,50.0]"}, {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,0.50]"},
                                                      {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.0,null]"}, {"[0.0,1.0,0.0,50.0]", "[0.0,1.0,0.000050]"},
                                                      {"[0.0,1.0,0.0,50.0],", "                   "}, {"\"desk\",", "       "}};
  for (const auto& [from, to] : lies) {
    const auto changed = edited(bytes, from, to);
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    auto result = load_baked(lying.path);
    ASSERT_FALSE(result) << to;
    EXPECT_NE(result.error().text().find(lying.path), std::string::npos);
  }
}

TEST(BakedFile, RefusesOtherThings) {
  EXPECT_FALSE(load_baked("/nonexistent/x.glb"));
  EXPECT_FALSE(load_baked("/tmp"));
  EXPECT_FALSE(is_baked("/nonexistent/x.glb"));
}

}  // namespace
}  // namespace lambent

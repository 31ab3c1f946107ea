#pragma once
// A small scene with made-up transfer, files that go away, and headers that lie.
#include <lambent/baked/baked_file.h>
#include <lambent/core/file.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>
#include <lambent/image/image.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>
#include <lambent/scene/procedural.h>
#include <gtest/gtest.h>
#include <cstring>
#include <filesystem>

namespace lambent {
namespace {

struct TemporaryFile {
  std::string path;
  explicit TemporaryFile(const std::string& name)
      : path((std::filesystem::temp_directory_path() / ("lambent_" + std::to_string(::getpid()) + "_" + name))
                 .string()) {}
  ~TemporaryFile() { std::filesystem::remove(path); }
};

struct Small {
  Scene scene;
  Receivers receivers;
  WritableTransfer transfer;
};

[[maybe_unused]] Small small_bake(int channels, Precision precision) {
  Small s;
  const uint32_t m = add_material(s.scene, "grey", Vec3(0.5f));
  add_box(s.scene, m, "box", Vec3(-1), Vec3(1), 2);
  add_quad(s.scene, add_material(s.scene, "sheet", Vec3(0.2f, 0.5f, 0.7f)), "sheet", Vec3(2, 0, 0), Vec3(0, 0, 1),
           Vec3(1, 0, 0), 1, 1);
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

[[maybe_unused]] Baked baked_of(const Small& s) {
  return make_baked(s.scene, s.receivers, s.transfer.transfer, DiffuseRows{});
}
[[maybe_unused]] Baked with_provenance(Baked baked, const std::string& text) {
  baked.provenance = text;
  return baked;
}
[[maybe_unused]] Baked with_errors(Baked baked, std::vector<float> errors) {
  baked.surface.fit_errors = std::move(errors);
  return baked;
}

// Replaces text in the JSON chunk by text of the same length.
[[maybe_unused]] std::vector<uint8_t> edited(std::vector<uint8_t> bytes, const std::string& from,
                                             const std::string& to) {
  EXPECT_EQ(from.size(), to.size());
  const auto at = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
  EXPECT_NE(at, bytes.end()) << from;
  if (at != bytes.end()) std::copy(to.begin(), to.end(), at);
  return bytes;
}

// Each of `lies`, (from, to) of equal length, told once in place of the first `from` after `after`: refused in one line
// that names the file.
[[maybe_unused]] void expect_refused(const std::string& path, const std::string& after,
                                     std::initializer_list<std::pair<std::string, std::string>> lies) {
  const TemporaryFile lying("lie.glb");
  const std::vector<uint8_t> bytes = *read_file(path);
  const std::string text(bytes.begin(), bytes.end());
  const size_t begin = text.find(after);
  ASSERT_NE(begin, std::string::npos) << after;
  for (const auto& [from, to] : lies) {
    ASSERT_EQ(from.size(), to.size()) << from;
    const size_t at = text.find(from, begin);
    ASSERT_NE(at, std::string::npos) << from;
    std::vector<uint8_t> changed = bytes;
    std::copy(to.begin(), to.end(), changed.begin() + ptrdiff_t(at));
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(lying.path, {&piece, 1}));
    auto result = load_baked(lying.path);
    ASSERT_FALSE(result) << to;
    EXPECT_EQ(result.error().text().find('\n'), std::string::npos);
    EXPECT_NE(result.error().text().find(lying.path), std::string::npos);
  }
}

}  // namespace
}  // namespace lambent

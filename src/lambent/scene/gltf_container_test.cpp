#include <lambent/core/uri.h>
#include <lambent/scene/gltf_test-inl.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

TEST(SplitGltf, GivesJsonAndBinary) {
  Bytes binary = {1, 2, 3, 4, 5};
  Bytes file = make_glb({{"hello", "world"}}, binary);
  auto chunks = split_gltf(file, "a.glb");
  ASSERT_TRUE(chunks);
  EXPECT_EQ(chunks->json["hello"], "world");
  ASSERT_EQ(chunks->binary.size(), 8u);  // padded to a multiple of four
  EXPECT_EQ(Bytes(chunks->binary.begin(), chunks->binary.begin() + 5), binary);
  EXPECT_EQ(chunks->binary.data(), file.data() + file.size() - 8) << "the chunk is used in place";

  auto plain = split_gltf(copy_bytes("{\"a\": [1, 2]}"), "a.gltf");
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->json["a"][1], 2);
  EXPECT_TRUE(plain->binary.empty());
}

TEST(SplitGltf, IgnoresUnknownChunks) {
  Bytes file = make_glb(Json::object(), {9});
  put_u32(file, 4), put_u32(file, 0x12345678), put_u32(file, 0);
  for (size_t i = 0; i < 4; ++i) file[8 + i] = uint8_t(file.size() >> (8 * i));
  auto chunks = split_gltf(file, "a.glb");
  ASSERT_TRUE(chunks);
  EXPECT_EQ(chunks->binary[0], 9);
}

TEST(SplitGltf, RefusesEveryTruncation) {
  Bytes file = make_glb({{"asset", {{"version", "2.0"}}}}, {1, 2, 3, 4});
  for (size_t n = 0; n < file.size(); ++n) {
    EXPECT_FALSE(split_gltf(std::span(file).first(n), "a.glb")) << n << " bytes";
  }
  EXPECT_TRUE(split_gltf(file, "a.glb"));
}

TEST(SplitGltf, RefusesOtherVersionsLengthsAndTypes) {
  Bytes good = make_glb(Json::object(), {1, 2, 3, 4});
  auto with = [&](size_t at, uint8_t value) {
    Bytes bad = good;
    bad[at] = value;
    auto chunks = split_gltf(bad, "a.glb");
    return chunks ? std::string("loaded") : chunks.error().text();
  };
  EXPECT_EQ(with(4, 1), "a.glb: GLB version 1 is not supported, only 2");
  EXPECT_EQ(with(8, 12), "a.glb: the GLB header gives a length too small for it");
  EXPECT_EQ(with(12, 200), "a.glb: a GLB chunk reaches past the end of the file");
  EXPECT_EQ(with(15, 255), "a.glb: a GLB chunk reaches past the end of the file");
  EXPECT_EQ(with(16, 'X'), "a.glb: the first GLB chunk is not JSON");
  EXPECT_EQ(with(20, '!'), "a.glb: JSON does not parse");
}

TEST(SplitGltf, RefusesDeepNestingBrokenTextAndOtherFiles) {
  auto message = [](const std::string& text) {
    auto chunks = split_gltf(copy_bytes(text), "a.gltf");
    return chunks ? std::string("loaded") : chunks.error().message;
  };
  EXPECT_EQ(message("{\"a\":" + std::string(63, '[') + std::string(63, ']') + "}"), "loaded");
  EXPECT_EQ(message("{\"a\":" + std::string(64, '[') + std::string(64, ']') + "}"), "JSON nests deeper than 64");
  EXPECT_EQ(message(std::string(1000000, '[')), "JSON nests deeper than 64");
  EXPECT_EQ(message("{\"a\": \"[[[[\\\"[[[[\"}"), "loaded") << "brackets in strings are text";
  EXPECT_EQ(message("{\"a\": 1e999}"), "JSON does not parse");
  EXPECT_EQ(message("{\"a\": \"\xff\"}"), "JSON does not parse");
  EXPECT_EQ(message("[]"), "not glTF: the JSON is not an object");
  EXPECT_EQ(message(""), "is empty");
  EXPECT_EQ(message("o bunny"), "JSON does not parse");
}

TEST(DataUri, DecodesBase64) {
  const std::string binary("\xff\0\x80z", 4);
  for (const std::string& text : {std::string(), std::string("f"), std::string("fo"), std::string("foo"), binary}) {
    std::string type;
    auto bytes = decode_data_uri("data:image/png;base64," + base64(copy_bytes(text)), "", &type);
    ASSERT_TRUE(bytes);
    EXPECT_EQ(*bytes, copy_bytes(text));
    EXPECT_EQ(type, "image/png");
  }
  EXPECT_EQ(*decode_data_uri("data:;base64,Zm8", "", nullptr), copy_bytes("fo")) << "padding may be left out";
  for (const char* bad : {"data:;base64,Zm9v!", "data:;base64,Z", "data:;base64,Zm=8",
                          "data:;base64,Zm8==", "data:;base64,Z===", "data:text/plain,hello", "data:;base64"}) {
    EXPECT_FALSE(decode_data_uri(bad, "", nullptr)) << bad;
  }
}

class ExternalFile : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(outer.path / "scene" / "sub");
    write_bytes(outer.file("secret.bin"), copy_bytes("secret"));
    write_bytes(outer.file("scene/inside.bin"), copy_bytes("inside"));
    write_bytes(outer.file("scene/sub/with space.bin"), copy_bytes("space"));
    std::filesystem::create_symlink("../secret.bin", outer.path / "scene" / "link_out.bin");
    std::filesystem::create_symlink("..", outer.path / "scene" / "folder_out");
    std::filesystem::create_symlink("sub/with space.bin", outer.path / "scene" / "link_in.bin");
    std::filesystem::create_directories(outer.path / "scene2");
    write_bytes(outer.file("scene2/x.bin"), copy_bytes("neighbour"));
    std::filesystem::create_symlink("../scene2/x.bin", outer.path / "scene" / "neighbour.bin");
  }
  Result<Bytes> read(const std::string& uri) { return read_external_file(uri, outer.file("scene"), "a.gltf"); }
  TemporaryFolder outer;
};

TEST_F(ExternalFile, ReadsWhatLiesInside) {
  ASSERT_TRUE(read("inside.bin"));
  EXPECT_EQ(*read("inside.bin"), copy_bytes("inside"));
  EXPECT_EQ(*read("./sub/with%20space.bin"), copy_bytes("space"));
  EXPECT_EQ(*read("sub\\with space.bin"), copy_bytes("space"));
  EXPECT_EQ(*read("link_in.bin"), copy_bytes("space"));
}

TEST_F(ExternalFile, RefusesToLeaveTheFolder) {
  for (const char* uri : {"../secret.bin",
                          "%2e%2e/secret.bin",
                          "..%2Fsecret.bin",
                          "sub/../../secret.bin",
                          "sub/../inside.bin",
                          "..\\secret.bin",
                          "/etc/passwd",
                          "%2Fetc/passwd",
                          "file:///etc/passwd",
                          "http://localhost/x",
                          "C:\\x.bin",
                          "c%3A/x.bin",
                          "//host/x",
                          "link_out.bin",
                          "folder_out/secret.bin",
                          "neighbour.bin",
                          "",
                          "inside.bin%00.png",
                          "sub",
                          "."}) {
    auto bytes = read(uri);
    ASSERT_FALSE(bytes) << uri;
    EXPECT_EQ(bytes.error().where, "a.gltf");
  }
  EXPECT_EQ(read("nothing.bin").error().text(), "a.gltf: \"nothing.bin\" was not found");
}

TEST_F(ExternalFile, RefusesAllWithoutAFolder) { EXPECT_FALSE(read_external_file("inside.bin", "", "a.gltf")); }

TEST(InQuotes, StaysOnOneShortLine) {
  EXPECT_EQ(in_quotes("a\nb"), "\"a?b\"");
  EXPECT_LT(in_quotes(std::string(100000, 'x')).size(), 200u);
}

}  // namespace
}  // namespace lambent

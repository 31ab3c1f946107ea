// Baked files that are a .gltf and .bin files beside it.
#include <lambent/baked/baked_test-inl.h>
#include <lambent/baked/extension.h>

#include <lambent.h>

#include <sys/stat.h>

#include <fstream>

namespace lambent {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr size_t least_limit = 65536;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("lambent_set_" + std::to_string(::getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string at(const std::string& name) const { return (path / name).string(); }
  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const auto& entry : fs::directory_iterator(path)) out.push_back(entry.path().filename().string());
    std::sort(out.begin(), out.end());
    return out;
  }
};

// All of a bake's fields, as they would be written.
std::string fingerprint(const BakedFields& fields) {
  BlobWriter bulk;
  std::string text = encode_fields(fields, bulk).dump();
  for (const auto& blob : bulk.blobs) text += content_hash(blob.bytes);
  return text;
}

// Transfer of several pieces of 64 KiB, over a plane.
Baked large_bake(size_t side) {
  Scene scene;
  add_quad(scene, add_material(scene, "grey", Vec3(0.5f)), "sheet", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), int(side),
           int(side));
  const Receivers receivers = make_vertex_receivers(scene);
  const WritableTransfer t = make_transfer({.order = 4}, 1, 3, receivers.count(), Precision::single);
  Random random(5);
  std::vector<float> row(16 * 3);
  for (size_t r = 0; r < receivers.count(); ++r) {
    for (float& v : row) v = random.next();
    store_receiver(t, r, row);
  }
  return make_baked(std::move(scene), receivers, t.transfer, DiffuseRows{});
}

// Whether an address is of a mapped file whose name ends so.
bool is_mapped(const void* address, const std::string& ending) {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const size_t dash = line.find('-');
    const auto begin = std::stoull(line.substr(0, dash), nullptr, 16),
               end = std::stoull(line.substr(dash + 1), nullptr, 16);
    const auto at = reinterpret_cast<uintptr_t>(address);
    if (at >= begin && at < end) return line.ends_with(ending);
  }
  return false;
}

TEST(GltfSet, EveryKindComesBackAsFromOneFile) {
  const Folder folder;
  const fs::path golden = fs::path(__FILE__).parent_path() / "../../../tests/golden";
  size_t tried = 0;
  for (const auto& entry : fs::directory_iterator(golden)) {
    if (entry.path().extension() != ".glb") continue;
    SCOPED_TRACE(entry.path().filename().string());
    auto one = load_baked(entry.path().string());
    ASSERT_TRUE(one) << one.error().text();
    const auto look = load_look(*MappedFile::open(entry.path().string()), entry.path().string());
    const std::string path = folder.at("a b%.gltf");  // a name that a URI cannot hold as it is
    ASSERT_TRUE(save_baked(path, *one, look ? &*look : nullptr, least_limit));
    EXPECT_TRUE(is_baked(path));
    auto set = load_baked(path);
    ASSERT_TRUE(set) << set.error().text();
    EXPECT_EQ(fingerprint(*set), fingerprint(*one));
    EXPECT_EQ(set->scene.positions, one->scene.positions);
    EXPECT_EQ(set->scene.normals, one->scene.normals);
    EXPECT_EQ(set->scene.textures.size(), one->scene.textures.size());
    auto plain = load_scene(path);
    ASSERT_TRUE(plain) << plain.error().text();
    EXPECT_EQ(plain->positions, one->scene.positions);
    const auto again = load_look(*MappedFile::open(path), path);
    ASSERT_EQ(again.has_value(), look.has_value());
    if (look) {
      EXPECT_EQ(again->png, look->png);
    }
    // And back into one file, of the same bytes as from one.
    ASSERT_TRUE(save_baked(folder.at("b.glb"), *set, look ? &*look : nullptr));
    ASSERT_TRUE(save_baked(folder.at("c.glb"), *one, look ? &*look : nullptr));
    EXPECT_EQ(fingerprint(*load_baked(folder.at("b.glb"))), fingerprint(*load_baked(folder.at("c.glb"))));
    lambent_file* opened = nullptr;
    EXPECT_EQ(lambent_open(path.c_str(), &opened), LAMBENT_OK) << lambent_error();
    lambent_close(opened);
    ++tried;
  }
  EXPECT_GE(tried, 20u);
}

TEST(GltfSet, LongTransferIsReadInPlaceAcrossFiles) {
  const Folder folder;
  const Baked bake = large_bake(40);
  ASSERT_TRUE(save_baked(folder.at("x.gltf"), bake, nullptr, least_limit));
  size_t bins = 0;
  for (const std::string& name : folder.names()) {
    if (!name.ends_with(".bin")) continue;
    ++bins;
    EXPECT_LE(fs::file_size(folder.at(name)), least_limit) << name;
  }
  const size_t bytes = bytes_of(bake.surface.store);
  EXPECT_GE(bins, bytes / least_limit);
  EXPECT_GE(bins, 4u);
  EXPECT_EQ(files_of(folder.at("x.gltf")).size(), bins + 1);
  auto back = read_fields(folder.at("x.gltf"));
  ASSERT_TRUE(back) << back.error().text();
  const auto& there = std::get<Transfer>(back->surface.store).data;
  const auto& truth = std::get<Transfer>(bake.surface.store).data;
  EXPECT_TRUE(std::equal(there.begin(), there.end(), truth.begin(), truth.end()));
  EXPECT_TRUE(is_mapped(there.data(), ".bin"));
  EXPECT_TRUE(is_mapped(there.data() + there.size() - 1, ".bin"));
  EXPECT_FALSE(is_mapped(truth.data(), ".bin"));
  // Where a piece is shifted, it is copied, and has the same values.
  Json document = Json::parse(*read_file(folder.at("x.gltf")));
  const size_t view = document["extensions"]["LAMBENT_transfer"]["transfer"]["bufferView"][1];
  const size_t buffer = document["bufferViews"][view]["buffer"];
  const std::string bin = folder.at(document["buffers"][buffer]["uri"]);
  std::vector<uint8_t> shifted = *read_file(bin);
  shifted.insert(shifted.begin(), 8, 0);
  const std::span<const uint8_t> piece(shifted);
  ASSERT_TRUE(write_file_atomically(bin, {&piece, 1}));
  document["buffers"][buffer]["byteLength"] = shifted.size();
  for (Json& v : document["bufferViews"])
    if (v["buffer"] == buffer) v["byteOffset"] = v["byteOffset"].get<size_t>() + 8;
  ASSERT_TRUE(write_file_atomically(folder.at("x.gltf"), document.dump()));
  auto copied = read_fields(folder.at("x.gltf"));
  ASSERT_TRUE(copied) << copied.error().text();
  const auto& moved = std::get<Transfer>(copied->surface.store).data;
  EXPECT_TRUE(std::equal(moved.begin(), moved.end(), truth.begin(), truth.end()));
  EXPECT_FALSE(is_mapped(moved.data(), ".bin"));
}

TEST(GltfSet, PiecesInDataUrisAreOneTransfer) {
  const fs::path seeds = fs::path(__FILE__).parent_path() / "../../../fuzz/corpus_baked";
  auto whole = load_baked((seeds / "rgb_single.glb").string()), pieces = load_baked((seeds / "pieces.gltf").string());
  ASSERT_TRUE(whole && pieces) << pieces.error().text();
  EXPECT_EQ(fingerprint(*pieces), fingerprint(*whole));
}

TEST(GltfSet, AppearsWholeAndTakesItsOldFilesAlong) {
  const Folder folder;
  const std::string path = folder.at("x.gltf");
  ASSERT_TRUE(save_baked(path, large_bake(40), nullptr, least_limit));
  const std::vector<std::string> before = folder.names();
  ASSERT_TRUE(write_file_atomically(folder.at("x.77.bin"), "somebody else's"));
  ::chmod(path.c_str(), 0640);
  ASSERT_TRUE(save_baked(path, large_bake(10)));
  EXPECT_EQ(folder.names(), (std::vector<std::string>{"x.0.bin", "x.77.bin", "x.gltf"}));
  EXPECT_EQ(fs::status(path).permissions(), fs::perms(0640));
  ASSERT_TRUE(load_baked(path));
  // One of its files cannot be written: all stays as it was.
  fs::create_directory(folder.at("x.1.bin"));
  const std::string whole = content_hash(*read_file(path)) + content_hash(*read_file(folder.at("x.0.bin")));
  auto failed = save_baked(path, large_bake(40), nullptr, least_limit);
  ASSERT_FALSE(failed);
  EXPECT_EQ(content_hash(*read_file(path)) + content_hash(*read_file(folder.at("x.0.bin"))), whole);
  EXPECT_EQ(folder.names(), (std::vector<std::string>{"x.0.bin", "x.1.bin", "x.77.bin", "x.gltf"}));
  // A set of another's: nothing of it appears before that is whole.
  fs::remove(folder.at("x.1.bin"));
  {
    FileSet outer;
    ASSERT_TRUE(save_baked(folder.at("y.gltf"), large_bake(10)));
    EXPECT_FALSE(fs::exists(folder.at("y.gltf")) || fs::exists(folder.at("y.0.bin")));
  }
  EXPECT_FALSE(fs::exists(folder.at("y.gltf")) || fs::exists(folder.at("y.0.bin")));
  {
    FileSet outer;
    ASSERT_TRUE(save_baked(folder.at("y.gltf"), large_bake(10)));
    ASSERT_TRUE(outer.commit());
  }
  EXPECT_TRUE(load_baked(folder.at("y.gltf")));
}

TEST(GltfSet, LiesAreRefusedInOneLine) {
  const Folder folder;
  ASSERT_TRUE(save_baked(folder.at("x.gltf"), large_bake(40), nullptr, least_limit));
  ASSERT_TRUE(write_file_atomically(folder.at("short.bin"), "short"));
  fs::create_symlink("/etc/hostname", folder.at("link.bin"));
  const Json good = Json::parse(*read_file(folder.at("x.gltf")));
  const auto refused = [&](const std::string& expected, auto lie) {
    SCOPED_TRACE(expected);
    Json document = good;
    lie(document, document["extensions"]["LAMBENT_transfer"]["transfer"]["bufferView"]);
    ASSERT_TRUE(write_file_atomically(folder.at("lie.gltf"), document.dump()));
    for (const std::string& text :
         {load_baked(folder.at("lie.gltf")).error().text(), read_fields(folder.at("lie.gltf")).error().text()}) {
      EXPECT_NE(text.find(expected), std::string::npos) << text;
      EXPECT_NE(text.find("lie.gltf"), std::string::npos) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
    lambent_file* file = nullptr;
    EXPECT_EQ(lambent_open(folder.at("lie.gltf").c_str(), &file), LAMBENT_BROKEN);
    EXPECT_NE(std::string(lambent_error()).find(expected), std::string::npos) << lambent_error();
  };
  const size_t last = good["buffers"].size() - 1;
  const auto uri = [&](const char* name) { return [=](Json& d, Json&) { d["buffers"][last]["uri"] = name; }; };
  refused("outside the scene's folder", uri("../x.0.bin"));
  refused("outside the scene's folder", uri("%2E%2E/x.0.bin"));
  refused("leads outside", uri("link.bin"));
  refused("not a relative path", uri("/etc/passwd"));
  refused("not a relative path", uri("file:///etc/passwd"));
  refused("not a relative path", uri("http://example.org/x.bin"));
  refused("was not found", uri("gone.bin"));
  refused("is truncated", uri("short.bin"));
  refused("cannot be read", uri("."));
  refused("is truncated", [&](Json& d, Json&) { d["buffers"][last]["byteLength"] = size_t{1} << 40; });
  refused("overlap", [](Json&, Json& views) { views[1] = views[0]; });
  refused("does not exist", [](Json&, Json& views) { views[1] = 1000000; });
  refused("empty or too long", [](Json&, Json& views) { views = Json::array(); });
  refused("not a number", [](Json&, Json& views) { views[0] = "all"; });
  refused("where its header makes", [](Json&, Json& views) { views.erase(views.size() - 1); });
  refused("out of range", [](Json& d, Json& views) { d["bufferViews"][size_t(views[0])]["byteLength"] = 1 << 20; });
  // In memory there are no files beside.
  const auto bytes = *read_file(folder.at("x.gltf"));
  lambent_file* file = nullptr;
  EXPECT_EQ(lambent_open_memory(bytes.data(), bytes.size(), &file), LAMBENT_BROKEN);
  EXPECT_NE(std::string(lambent_error()).find("external file"), std::string::npos) << lambent_error();
  EXPECT_EQ(lambent_open(folder.at("x.gltf").c_str(), &file), LAMBENT_OK) << lambent_error();
  lambent_close(file);
}

TEST(OpenParts, MapsWholePagesAndCopiesOthers) {
  const Folder folder;
  const auto write = [&](const char* name, size_t bytes, uint8_t first) {
    std::vector<uint8_t> values(bytes);
    for (size_t i = 0; i < bytes; ++i) values[i] = uint8_t(first + i * 7);
    const std::span<const uint8_t> piece(values);
    EXPECT_TRUE(write_file_atomically(folder.at(name), {&piece, 1}));
    return values;
  };
  const auto a = write("a.bin", 2 * least_limit, 1), b = write("b.bin", least_limit + 100, 9);
  using Part = MappedFile::Part;
  for (const size_t offset : {size_t{0}, least_limit, size_t{12}}) {
    const std::vector<Part> parts{{folder.at("a.bin"), offset, least_limit}, {folder.at("b.bin"), 0, 50}};
    auto joined = MappedFile::open_parts(parts);
    ASSERT_TRUE(joined) << joined.error().text();
    std::vector<uint8_t> truth(a.begin() + ptrdiff_t(offset), a.begin() + ptrdiff_t(offset + least_limit));
    truth.insert(truth.end(), b.begin(), b.begin() + 50);
    EXPECT_TRUE(std::equal(truth.begin(), truth.end(), joined->bytes().begin(), joined->bytes().end()));
    EXPECT_EQ(is_mapped(joined->bytes().data(), "a.bin"), offset != 12);
  }
  EXPECT_FALSE(MappedFile::open_parts(std::vector<Part>{{folder.at("a.bin"), least_limit, least_limit + 1}}));
  EXPECT_FALSE(MappedFile::open_parts(std::vector<Part>{{folder.at("none.bin"), 0, 1}}));
  EXPECT_FALSE(MappedFile::open_parts(std::vector<Part>{{folder.at("a.bin"), SIZE_MAX, 2}}));
  EXPECT_TRUE(MappedFile::open_parts({}));
}

}  // namespace
}  // namespace lambent

#include <lambent/pipeline/durable.h>

#include <lambent/pipeline/bake.h>

#include "temporary_folder.h"

#include <gtest/gtest.h>

#include <atomic>

namespace lambent {
namespace {

class Durable : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  std::vector<std::string> warnings;
  Job job{nullptr, [this](const std::string& line) { warnings.push_back(line); }};
  void SetUp() override {
    folder.write("m.mtl", "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl red\nKd 0.8 0.2 0.1\nKe 1 1 1\n");
    folder.write("s.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\nusemtl grey\nf 4 3 2 1\n"
                 "usemtl red\nf 1 2 6 5\n");
  }
  BakeRequest request() const {
    BakeRequest r;
    r.scene = folder.file("s.obj"), r.output = folder.file("out.glb"), r.checkpoint = folder.file("kept");
    r.samples = 64, r.order = 3, r.max_edge = 0.1f;
    return r;
  }
  // Ends at the second bounce.
  void cut_short(BakeRequest r) {
    Progress progress([&](const std::string& stage, double) {
      if (stage == "bounce 2" || stage == "solving") progress_->cancel();
    });
    progress_ = &progress;
    Job cancelled = job;
    cancelled.progress = &progress;
    auto outcome = bake_to_file(r, cancelled);
    ASSERT_FALSE(outcome);
    EXPECT_EQ(outcome.error().message, "cancelled; the same command goes on from " + r.checkpoint);
    EXPECT_FALSE(std::filesystem::exists(r.output));
  }
  Progress* progress_ = nullptr;
};

TEST_F(Durable, ABakeGoesOnWhereItWas) {
  BakeRequest whole = request();
  whole.output = folder.file("whole.glb"), whole.checkpoint = "off";
  ASSERT_TRUE(bake_to_file(whole, job));
  cut_short(request());
  BakeRequest other_memory = request();  // which changes no result
  other_memory.memory = size_t{1} << 28;
  auto second = bake_to_file(other_memory, job);
  ASSERT_TRUE(second) << second.error().text();
  EXPECT_GT(second->json.value("resumed", 0), 2);
  EXPECT_EQ(*read_file(whole.output), *read_file(request().output));
  EXPECT_FALSE(std::filesystem::exists(folder.file("kept")));
  EXPECT_TRUE(warnings.empty()) << warnings[0];
}

TEST_F(Durable, OtherRequestsAndInputsAreRefusedByName) {
  cut_short(request());
  BakeRequest other = request();
  other.samples = 128;
  auto refused = bake_to_file(other, job);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("is of another request: samples was 64, and is 128"), std::string::npos)
      << refused.error().text();
  other = request(), other.order = 2;
  EXPECT_NE(bake_to_file(other, job).error().text().find("order was 3, and is 2"), std::string::npos);
  // A file that only the scene names.
  folder.write("m.mtl", "newmtl grey\nKd 0.6 0.5 0.5\nnewmtl red\nKd 0.8 0.2 0.1\nKe 1 1 1\n");
  EXPECT_NE(bake_to_file(request(), job).error().text().find("is of another input: \"m.mtl\" has changed"),
            std::string::npos)
      << bake_to_file(request(), job).error().text();
  auto found = find_checkpoints(folder.path.string());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].folder, folder.file("kept"));
  EXPECT_NE(found[0].stale.find("m.mtl has changed"), std::string::npos) << found[0].stale;
  // Of another build.
  SetUp();
  ASSERT_TRUE(find_checkpoints(folder.path.string())[0].stale.empty());
  auto identity = nlohmann::json::parse(*read_file(folder.file("kept/checkpoint.json")));
  identity["build"] = "lambent 0.0";
  folder.write("kept/checkpoint.json", identity.dump());
  EXPECT_NE(bake_to_file(request(), job).error().text().find("another build"), std::string::npos);
  // Of nothing that can be read.
  for (const char* text : {"", "[]", "{\"request\": 3}", "\xff\xff", "{\"request\": {}, \"inputs\": {\"a\": 1}}"}) {
    folder.write("kept/checkpoint.json", text);
    EXPECT_FALSE(bake_to_file(request(), job)) << text;
    EXPECT_EQ(find_checkpoints(folder.path.string()).size(), 1u);
  }
}

TEST_F(Durable, OutputsReplaceNoInput) {
  folder.write("out.exr", "");
  BakeRequest sky = request();
  sky.transfer = "lightmap", sky.atlas = "16x16", sky.max_edge = 0, sky.order = 0;
  ASSERT_TRUE(bake_to_file(sky, job));  // makes out.exr
  const auto picture = *read_file(folder.file("out.exr"));
  BakeRequest destroys = sky;
  destroys.sky = folder.file("out.exr");
  auto refused = bake_to_file(destroys, job);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, folder.file("out.exr"));
  EXPECT_EQ(*read_file(folder.file("out.exr")), picture);
  BakeRequest itself = request();
  itself.scene = folder.file("out.glb");
  EXPECT_FALSE(bake_to_file(itself, job));
  itself = request(), itself.depfile = folder.file("m.mtl");
  EXPECT_FALSE(bake_to_file(itself, job));
}

TEST_F(Durable, DepfilesNameWhatWasRead) {
  BakeRequest r = request();
  r.depfile = folder.file("out.d"), r.checkpoint = "off";
  ASSERT_TRUE(bake_to_file(r, job));
  const auto bytes = *read_file(r.depfile);
  const std::vector<std::string> files = files_of_depfile(std::string(bytes.begin(), bytes.end()));
  EXPECT_EQ(files, (std::vector<std::string>{folder.file("s.obj"), folder.file("m.mtl")}));
  const std::vector<std::string> odd{"a b", "c$d", "e#f", "g:h", "i\\j"};
  EXPECT_EQ(files_of_depfile(depfile_text({"o ut", "x"}, odd)), odd);
  EXPECT_EQ(depfile_text({"o"}, {"a b", "c$d"}), "o: \\\n  a\\ b \\\n  c$$d\n");
}

// The names that are looked at before the work are those that are written after it.
TEST_F(Durable, PicturesAreNamedBeforehand) {
  for (const char* directional : {"none", "sh:2"})
    for (const char* direct : {"included", "separate"})
      for (bool each : {false, true}) {
        BakeRequest r = request();
        r.transfer = "lightmap", r.atlas = "16x16", r.max_edge = 0, r.order = 0, r.sky = "uniform:1";
        r.directional = directional, r.direct = direct, r.light_groups = each;
        if (std::string(directional) != "none" && std::string(direct) == "separate") continue;
        std::vector<std::string> names, written;
        Job listens = job;
        listens.inputs_read = [&](const std::vector<std::string>& pictures) {
          names = pictures;
          return Result<void>();
        };
        auto outcome = bake_with_summary(r, listens);
        ASSERT_TRUE(outcome) << outcome.error().text();
        for (const auto& [name, picture] : outcome->pictures) written.push_back(name);
        EXPECT_EQ(names, written);
        EXPECT_FALSE(names.empty());
      }
}

}  // namespace
}  // namespace lambent

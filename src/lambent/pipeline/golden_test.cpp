// Files that versions before this one wrote, one of every kind, and what those versions drew of them (tests/golden/):
// they are still read, and drawn to the same pixels.
#include <lambent/pipeline/draw.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

namespace lambent {
namespace {

// lambent render NAME.glb --camera 3,2,4,1,0.5,1,40 --size 16x12 --spp 4 --env sky:... --background none, but for what
// some kinds do not take.
DrawRequest golden_request(const std::string& name) {
  DrawRequest request{.baked = std::string(LAMBENT_GOLDEN) + "/" + name + ".glb", .background = "none"};
  if (name != "diffuse_fixed_view") request.camera = "3,2,4,1,0.5,1,40", request.size = "16x12", request.spp = 4;
  if (name == "indirect") request.background = "env", request.lamp = {"sphere@1,1.2,1,0.1=30,20,10"};
  else if (name == "lightmap") request.lamp = {"lamp=1,0.5,0.25", "sky=0.5,1,2"};
  else if (name != "lightmap_directional") request.env = "sky:elevation=40,azimuth=20,turbidity=4";
  // What they drew was not kept from ringing.
  if (!request.env.empty() && !name.starts_with("blocks") && name != "diffuse_directional" &&
      name.find("fixed_light") == std::string::npos)
    request.window = "none";
  return request;
}

std::vector<std::string> golden_names() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(LAMBENT_GOLDEN))
    if (entry.path().extension() == ".glb") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

class Golden : public testing::TestWithParam<std::string> {};

TEST_P(Golden, IsDrawnAsItWas) {
  const auto drawing = draw(golden_request(GetParam()));
  ASSERT_TRUE(drawing) << drawing.error().text();
  ASSERT_EQ(drawing->frames.size(), 1u);
  const Image& image = drawing->frames[0];
  const auto then = load_image(std::string(LAMBENT_GOLDEN) + "/" + GetParam() + ".exr");
  ASSERT_TRUE(then) << then.error().text();
  ASSERT_EQ(image.width, then->width);
  ASSERT_EQ(image.height, then->height);
  ASSERT_EQ(image.alpha.size(), then->alpha.size());
  // The picture has half floats: 11 bits, and 2^-24 where they are denormal. Sums in lanes of another width differ in
  // single precision, next to nothing of that.
  auto rounding = [](float value) { return 1.01f * (std::abs(value) * 0x1p-11f + 0x1p-25f); };
  float brightest = 0;
  for (size_t i = 0; i < image.rgb.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(image.rgb[i][c], then->rgb[i][c], rounding(then->rgb[i][c])) << "pixel " << i;
      brightest = std::max(brightest, then->rgb[i][c]);
    }
    EXPECT_NEAR(image.alpha[i], then->alpha[i], rounding(then->alpha[i])) << "pixel " << i;
  }
  EXPECT_GT(brightest, 0.05f);  // it shows something
}

INSTANTIATE_TEST_SUITE_P(Files, Golden, testing::ValuesIn(golden_names()), [](const auto& info) { return info.param; });

// Every kind that a file can have is among them.
TEST(GoldenFiles, AreOfEveryKind) {
  std::set<DrawKind> kinds;
  std::set<size_t> stores, places, rows;
  for (const std::string& name : golden_names()) {
    const auto baked = load_baked(std::string(LAMBENT_GOLDEN) + "/" + name + ".glb");
    ASSERT_TRUE(baked) << baked.error().text();
    kinds.insert(kind_of(baked->surface));
    std::vector<const Field*> fields{&baked->surface};
    for (const Field& field : baked->more) fields.push_back(&field);
    for (const Field* field : fields)
      stores.insert(field->store.index()), places.insert(field->where.index()), rows.insert(field->rows.index());
  }
  EXPECT_EQ(kinds.size(), std::size(draw_kind_names) - 1);  // a transfer texture is no baked file
  EXPECT_EQ(stores.size(), std::variant_size_v<Store>);
  EXPECT_EQ(places.size(), std::variant_size_v<Placement>);
  EXPECT_EQ(rows.size(), std::variant_size_v<Rows>);
}

}  // namespace
}  // namespace lambent

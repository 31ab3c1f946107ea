// Files that versions before this one wrote, one of every kind, and what those versions drew of them (tests/golden/):
// they are still read, and drawn to the same pixels.
#include <lambent/pipeline/golden_test-inl.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

namespace lambent {
namespace {

using test::golden_names;

DrawRequest golden_request(const std::string& name) {
  DrawRequest request = test::golden_request(name);
  // What they drew was not kept from ringing.
  if (!request.env.empty() && !name.starts_with("blocks") && !name.starts_with("wavelets") &&
      name != "diffuse_directional" && name != "diffuse_compact" && name != "diffuse_steerable" &&
      name.find("fixed_light") == std::string::npos)
    request.window = "none";
  if (name == "indirect") request.near_rays = 0;  // they read all bounces off surfels
  return request;
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
  // Shadow rays that graze an edge meet it or not, by how wide the vectors of the ray tracer are.
  const bool by_rays = GetParam().starts_with("indirect");
  float brightest = 0;
  double error = 0, all = 0;
  for (size_t i = 0; i < image.rgb.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float now = image.rgb[i][c], before = then->rgb[i][c];
      if (!by_rays) EXPECT_NEAR(now, before, rounding(before)) << "pixel " << i;
      error += double(now - before) * double(now - before), all += double(before) * double(before);
      brightest = std::max(brightest, before);
    }
    EXPECT_NEAR(image.alpha[i], then->alpha[i], rounding(then->alpha[i])) << "pixel " << i;
  }
  EXPECT_LT(std::sqrt(error / all), 0.01);
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

#include <lambent/pipeline/golden_test-inl.h>
#include <lambent/pipeline/live.h>

#include <gtest/gtest.h>

#include <algorithm>

namespace lambent {
namespace {

using test::golden_names;
using test::golden_request;

constexpr const char* live_file = "diffuse";

std::string error_of(const Result<void>& result) { return result ? "" : result.error().text(); }

// All work that there is, and how many pieces it was.
int finish(LivePicture& picture) {
  int pieces = 0;
  for (;; ++pieces) {
    const auto more = picture.work();
    EXPECT_TRUE(more) << more.error().text();
    if (!more || !*more || pieces > 1000) return pieces;
  }
}

void expect_same(const Image& a, const Image& b) {
  ASSERT_EQ(a.width, b.width);
  ASSERT_EQ(a.height, b.height);
  for (size_t i = 0; i < a.rgb.size(); ++i) EXPECT_EQ(a.rgb[i], b.rgb[i]) << "pixel " << i;
  EXPECT_EQ(a.alpha, b.alpha);
}

Image drawn(const Baked& baked, const DrawRequest& request) {
  auto drawing = draw(baked, request);
  EXPECT_TRUE(drawing) << drawing.error().text();
  return drawing ? drawing->frames.at(0) : Image();
}

struct Opened {
  Baked baked;
  DrawRequest request;
};
Opened open(const std::string& name) {
  Opened out{{}, golden_request(name)};
  auto baked = load_baked(out.request.baked);
  EXPECT_TRUE(baked) << baked.error().text();
  if (baked) out.baked = std::move(*baked);
  return out;
}

class Live : public testing::TestWithParam<std::string> {};

// Of every kind, whatever was seen before: once nothing is left to do it is the picture that render draws.
TEST_P(Live, BecomesThePicture) {
  const auto [baked, request] = open(GetParam());
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  EXPECT_GE(finish(*picture), 1);
  EXPECT_TRUE(picture->done());
  expect_same(picture->image(), drawn(baked, request));
}

TEST_P(Live, FollowsLightAndView) {
  const auto [baked, request] = open(GetParam());
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  DrawRequest moved = request;
  const bool turns = !request.env.empty(), looks = GetParam() != "diffuse_fixed_view";
  for (int frame = 0; frame < 5; ++frame) {
    if (turns) moved.env_rotate = std::to_string(30 * frame) + ",0,0";
    if (looks) moved.camera = std::to_string(3 - frame % 2) + ",2,4,1,0.5,1,40";
    ASSERT_EQ(error_of(picture->ask(moved)), "");
    const auto worked = picture->work(true, 1e-5);  // never enough: the coarsest that there is
    ASSERT_TRUE(worked) << worked.error().text();
    EXPECT_TRUE(*worked);
  }
  finish(*picture);
  expect_same(picture->image(), drawn(baked, moved));
  // And back: the same bytes as before.
  ASSERT_EQ(error_of(picture->ask(request)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, request));
}

INSTANTIATE_TEST_SUITE_P(Files, Live, testing::ValuesIn(golden_names()), [](const auto& info) { return info.param; });

TEST(LivePicture, DoesOnlyWhatHasChanged) {
  const auto [baked, request] = open(live_file);
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  EXPECT_EQ(finish(*picture), request.spp);
  EXPECT_FALSE(*picture->work());
  DrawRequest asked = request;
  asked.env_rotate = "90,0,0";
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  ASSERT_TRUE(*picture->work());
  EXPECT_GT(picture->times().relight, 0);
  EXPECT_EQ(picture->times().trace, 0);  // the camera stands
  finish(*picture);
  asked.camera = "3,2.5,4,1,0.5,1,40";
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  ASSERT_TRUE(*picture->work());
  EXPECT_EQ(picture->times().relight, 0);  // nor has the light changed
  EXPECT_GT(picture->times().trace, 0);
  finish(*picture);
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  EXPECT_TRUE(picture->done());
}

TEST(LivePicture, KeepsWhatItShowsOnErrors) {
  const auto [baked, request] = open(live_file);
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  finish(*picture);
  const Image before = picture->image();
  for (const auto& [change, part] : std::vector<std::pair<std::function<void(DrawRequest&)>, std::string>>{
           {[](DrawRequest& r) { r.env = "no_such_file.hdr"; }, "no_such_file.hdr"},
           {[](DrawRequest& r) { r.env_rotate = "1,2"; }, "--env-rotate"},
           {[](DrawRequest& r) { r.camera = "0,0,0"; }, "--camera"},
           {[](DrawRequest& r) { r.size = "0x4"; }, "--size"},
           {[](DrawRequest& r) { r.brdf = "phong:0.5,20"; }, "--brdf"},
           {[](DrawRequest& r) { r.show = "bounce:1"; }, "--terms"},
           {[](DrawRequest& r) { r.insert = {"a.obj@0,0,0"}; }, "--insert"},
           {[](DrawRequest& r) { r.animation = "0"; }, ""}}) {
    DrawRequest asked = request;
    change(asked);
    const std::string error = error_of(picture->ask(asked));
    EXPECT_NE(error, "");
    EXPECT_NE(error.find(part), std::string::npos) << error;
    finish(*picture);
    expect_same(picture->image(), before);
  }
}

TEST(LivePicture, OneCoefficientIsItsColumn) {
  const auto [baked, request] = open("diffuse_grey_single");
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  EXPECT_NE(error_of(picture->look_as(Look::coefficient, 1 << 20)), "");
  EXPECT_NE(error_of(picture->look_as(Look::coefficient, -1)), "");
  ASSERT_EQ(error_of(picture->look_as(Look::coefficient, 0)), "");
  finish(*picture);
  const Image first = picture->image();
  // Of the constant harmonic, transfer is nowhere negative (red), and somewhere it is light (blue).
  float most = 0;
  for (const Vec3& pixel : first.rgb) {
    EXPECT_EQ(pixel.x, 0.0f);
    most = std::max(most, pixel.z);
  }
  EXPECT_GT(most, 0.1f);
  for (const Look look : {Look::receivers, Look::density}) {
    ASSERT_EQ(error_of(picture->look_as(look)), "");
    finish(*picture);
    EXPECT_FALSE(std::equal(first.rgb.begin(), first.rgb.end(), picture->image().rgb.begin()));
  }
  ASSERT_EQ(error_of(picture->look_as(Look::picture)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, request));
}

}  // namespace
}  // namespace lambent

#pragma once
// A live picture beside what draw() makes of the same request.
#include <lambent/pipeline/golden_test-inl.h>
#include <lambent/pipeline/live.h>

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace lambent::test {

inline std::string error_of(const Result<void>& result) { return result ? "" : result.error().text(); }

// All work that there is, and how many pieces it was.
inline int finish(LivePicture& picture) {
  int pieces = 0;
  for (;; ++pieces) {
    const auto more = picture.work();
    EXPECT_TRUE(more) << more.error().text();
    if (!more || !*more || pieces > 1000) return pieces;
  }
}

inline void expect_same(const Image& a, const Image& b) {
  ASSERT_EQ(a.width, b.width);
  ASSERT_EQ(a.height, b.height);
  for (size_t i = 0; i < a.rgb.size(); ++i) EXPECT_EQ(a.rgb[i], b.rgb[i]) << "pixel " << i;
  EXPECT_EQ(a.alpha, b.alpha);
}

inline Image drawn(const Baked& baked, const DrawRequest& request) {
  auto drawing = draw(baked, request);
  EXPECT_TRUE(drawing) << drawing.error().text();
  return drawing ? drawing->frames.at(0) : Image();
}

struct Opened {
  Baked baked;
  DrawRequest request;
};
inline Opened open_golden(const std::string& name) {
  Opened out{{}, golden_request(name)};
  if (out.request.env.starts_with("sky:")) out.request.env += ",width=64";  // quicker, and the same for both
  auto baked = load_baked(out.request.baked);
  EXPECT_TRUE(baked) << baked.error().text();
  if (baked) out.baked = std::move(*baked);
  return out;
}

// A request after the other on one picture: each becomes what render draws, hurried through before or not.
inline void expect_each_drawn(const Baked& baked, const std::vector<DrawRequest>& requests) {
  auto picture = LivePicture::make(baked, requests.front());
  ASSERT_TRUE(picture) << picture.error().text();
  Image before;
  for (const DrawRequest& request : requests) {
    SCOPED_TRACE(testing::Message() << "request " << &request - requests.data());
    ASSERT_EQ(error_of(picture->ask(request)), "");
    ASSERT_TRUE(picture->work(true, 1e-5));
    finish(*picture);
    expect_same(picture->image(), drawn(baked, request));
    if (&request != requests.data()) EXPECT_NE(picture->image().rgb, before.rgb);
    before = picture->image();
  }
}

}  // namespace lambent::test

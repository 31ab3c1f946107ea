#pragma once
// Eight bits of what a screen shows: lround(255 srgb_encode(x)) of x in [0, 1], without a power for each.
#include <lambent/image/image.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace lambent::tool {

class SrgbBytes {
 public:
  // The encoding rises, so that bisecting the floats finds where each byte begins.
  SrgbBytes() {
    for (unsigned k = 1; k < 256; ++k) {
      uint32_t below = 0, from = one;
      while (from - below > 1) {
        const uint32_t middle = (below + from) / 2;
        (encoded(middle) >= k ? from : below) = middle;
      }
      begin_[k] = std::bit_cast<float>(from);
    }
    begin_[256] = std::numeric_limits<float>::infinity();
    for (uint32_t i = 0; i < near_.size(); ++i) near_[i] = uint8_t(encoded(i << dropped));
  }

  uint8_t operator()(float x) const {
    if (!(x > 0)) return 0;
    if (x >= 1) return 255;
    unsigned k = near_[std::bit_cast<uint32_t>(x) >> dropped];
    while (x >= begin_[k + 1]) ++k;
    return uint8_t(k);
  }

 private:
  static constexpr uint32_t one = 0x3f800000, dropped = 16;
  static unsigned encoded(uint32_t bits) {
    return unsigned(std::lround(255 * srgb_encode(std::bit_cast<float>(bits))));
  }

  std::array<float, 257> begin_ = {};
  std::array<uint8_t, (one >> dropped) + 1> near_ = {};
};

}  // namespace lambent::tool

#pragma once
// Three weights in four bytes: nine bits each and the exponent of the greatest. Source: EXT_texture_shared_exponent.
// What round_shared() gives is a half float as well, exactly.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace lambent {

inline constexpr int shared_bits = 9, least_exponent = -15;

// 2^e, of normal numbers.
inline float power_of_two(int e) { return std::bit_cast<float>(uint32_t(e + 127) << 23); }

// Greatest e of the three: values below 2^e, no less than 2^least_exponent.
inline int shared_exponent(const float* c) {
  const float most = std::max({c[0], c[1], c[2], 0.0f});
  return std::max(int(std::bit_cast<uint32_t>(most) >> 23) - 126, least_exponent);
}

// Three that can be packed, next above or below; of numbers to 65,000. `dither`, each in [0, 1), decides which: where
// it is even, the mean is the number itself, while rounding to the nearest would make all weights of a surface of one
// colour wrong alike. Below 0 they are 0: an interpolation's weight may be, by its rounding.
inline void round_shared(const float* from, const float* dither, float* to) {
  int e = shared_exponent(from);
  if (std::max({from[0], from[1], from[2], 0.0f}) * power_of_two(shared_bits - e) >= float((1 << shared_bits) - 1)) ++e;
  const float up = power_of_two(shared_bits - e), down = power_of_two(e - shared_bits);
  for (int c = 0; c < 3; ++c) to[c] = std::floor(std::max(from[c], 0.0f) * up + dither[c]) * down;
}

inline uint32_t pack_shared(const float* c) {
  const int e = shared_exponent(c);
  const float up = power_of_two(shared_bits - e);
  return uint32_t(c[0] * up) | uint32_t(c[1] * up) << 9 | uint32_t(c[2] * up) << 18 |
         uint32_t(e - least_exponent) << 27;
}
inline void unpack_shared(uint32_t bits, float* c) {
  const float down = power_of_two(int(bits >> 27) + least_exponent - shared_bits);
  for (int k = 0; k < 3; ++k) c[k] = float(bits >> (9 * k) & 511) * down;
}

}  // namespace lambent

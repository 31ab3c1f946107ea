// Follows: B. Burley, "Practical hash-based Owen scrambling", JCGT 2020; P. Shirley and K. Chiu, "A low distortion map
// between disk and square", JGT 1997.
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <algorithm>

namespace lambent {
namespace {

uint32_t reverse_bits(uint32_t x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Owen scramble of a bit-reversed number: every bit is flipped by a hash of the bits below it (Laine and Karras 2011,
// in the form that Burley gives).
uint32_t laine_karras(uint32_t x, uint32_t seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}
uint32_t owen(uint32_t x, uint32_t seed) { return reverse_bits(laine_karras(reverse_bits(x), seed)); }

// Second Sobol' dimension: direction numbers of the polynomial x + 1.
uint32_t sobol_second(uint32_t index) {
  uint32_t x = 0;
  for (uint32_t v = 1u << 31; index; index >>= 1, v ^= v >> 1)
    if (index & 1) x ^= v;
  return x;
}

}  // namespace

Vec2 sobol_owen(uint32_t index, uint32_t seed) {
  uint32_t sx = uint32_t(hash64(seed, 1)), sy = uint32_t(hash64(seed, 2));
  return {to_unit_float(owen(reverse_bits(index), sx)), to_unit_float(owen(sobol_second(index), sy))};
}

Vec2 square_to_disk(Vec2 u) {
  float a = 2 * u.x - 1, b = 2 * u.y - 1;
  if (a == 0 && b == 0) return {0, 0};
  float r, phi;
  if (a * a > b * b) r = a, phi = (pi / 4) * (b / a);
  else r = b, phi = pi / 2 - (pi / 4) * (a / b);
  return {r * std::cos(phi), r * std::sin(phi)};
}

Vec2 disk_to_square(Vec2 d) {
  const float r = length(d);
  if (r == 0) return Vec2(0.5f);
  // Within the quarter of the disk about an axis, the coordinate along it is +-r and the other that times 4 phi / pi,
  // phi from the axis.
  float a, b;
  if (std::abs(d.x) > std::abs(d.y)) a = std::copysign(r, d.x), b = a * (4 / pi) * std::atan(d.y / d.x);
  else b = std::copysign(r, d.y), a = b * (4 / pi) * std::atan(d.x / d.y);
  return clamp(0.5f * (Vec2(a, b) + 1.0f), Vec2(0), Vec2(1));
}

Vec3 square_to_cosine_hemisphere(Vec2 u) {
  Vec2 d = square_to_disk(u);
  return {d.x, d.y, std::sqrt(std::max(0.0f, 1 - d.x * d.x - d.y * d.y))};
}

Vec3 square_to_sphere(Vec2 u) {
  float z = 1 - 2 * u.x, r = std::sqrt(std::max(0.0f, 1 - z * z)), phi = 2 * pi * u.y;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace lambent

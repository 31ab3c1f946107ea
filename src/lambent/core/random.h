#pragma once
// Random numbers are keyed, never drawn from shared state: the same (key, counter) gives the same number on any thread.
#include <lambent/core/vec.h>

#include <cstdint>

namespace lambent {

// Mixes 64 bits (Stafford's variant 13 of the splitmix64 finaliser).
inline uint64_t hash64(uint64_t x) {
  x ^= x >> 30, x *= 0xbf58476d1ce4e5b9ull;
  x ^= x >> 27, x *= 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
inline uint64_t hash64(uint64_t a, uint64_t b) {
  return hash64(hash64(a + 0x9e3779b97f4a7c15ull) ^ (b + 0xd1b54a32d192ed03ull));
}

// Uniform in [0, 1), from the upper 24 bits.
inline float to_unit_float(uint32_t bits) { return float(bits >> 8) * 0x1p-24f; }

// A stream of random numbers for one (key, stream) pair.
struct Random {
  uint64_t state;
  explicit Random(uint64_t key, uint64_t stream = 0) : state(hash64(key, stream)) {}
  uint64_t next64() { return hash64(state += 0x9e3779b97f4a7c15ull); }
  float next() { return to_unit_float(uint32_t(next64() >> 32)); }
  Vec2 next2() {
    uint64_t bits = next64();
    return {to_unit_float(uint32_t(bits >> 32)), to_unit_float(uint32_t(bits))};
  }
};

}  // namespace lambent

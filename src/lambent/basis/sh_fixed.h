#pragma once
// Harmonics of one direction for an order that the compiler knows: straight code, without a call. Follows: P.-P. Sloan,
// "Efficient spherical harmonic evaluation" (2013); the recurrences of sh_tables.h.
#include <lambent/basis/sh_tables.h>

#include <cstdint>
#include <cstring>
#include <span>

namespace lambent {
namespace sh_fixed {  // of evaluate_sh alone

// Harmonics of +-m and bands l and up.
template <int order, int m, int l, class T>
[[gnu::always_inline]] inline void bands(T z, T c, T s, T q1, T q2, T* __restrict out) {
  if constexpr (l < order) {
    constexpr auto& t = sh_tables_rounded<T>;
    T q;
    if constexpr (l == m) q = t.diagonal[m];
    else if constexpr (l == m + 1) q = z * t.a[l][m] * q1 + T(0);  // the loop's 0 q2, for the sign of a zero
    else q = z * t.a[l][m] * q1 + t.b[l][m] * q2;
    out[sh_index(l, m)] = m > 0 ? q * c : q;
    if constexpr (m > 0) out[sh_index(l, -m)] = q * s;
    bands<order, m, l + 1>(z, c, s, q, q1, out);
  }
}

// c + i s is (x + iy)^m.
template <int order, int m, class T>
[[gnu::always_inline]] inline void frequencies(T x, T y, T z, T c, T s, T* __restrict out) {
  if constexpr (m < order) {
    bands<order, m, m>(z, c, s, T(0), T(0), out);
    if constexpr (m == 0) frequencies<order, 1>(x, y, z, x, y, out);
    else frequencies<order, m + 1>(x, y, z, c * x - s * y, c * y + s * x, out);
  }
}

// Four floats, as every target has them: choosing a wider vector at run time would take as long as it saves.
typedef float Four __attribute__((vector_size(16)));
typedef int32_t FourBits __attribute__((vector_size(16)));
constexpr float factor(const float (&table)[max_sh_order][max_sh_order], int l, int m) {
  return m < l ? table[l][m] : 0;
}

// Bands l and up of frequencies 0 .. 3, side by side. Lanes of frequencies above l are +0 until their band comes. What
// band 2 stores beyond itself is overwritten by band 3 and by whoever calls.
template <int order, int l>
[[gnu::always_inline]] inline void four_frequencies(Four z, Four c, Four s, Four q1, Four q2, float* __restrict out) {
  if constexpr (l < order) {
    constexpr auto& t = sh_tables_rounded<float>;
    constexpr Four a = {factor(t.a, l, 0), factor(t.a, l, 1), factor(t.a, l, 2), factor(t.a, l, 3)};
    constexpr Four b = {factor(t.b, l, 0), factor(t.b, l, 1), factor(t.b, l, 2), factor(t.b, l, 3)};
    Four q = z * a * q1 + b * q2;
    if constexpr (l < 4) {
      constexpr Four first = {0, l == 1 ? t.diagonal[1] : 0, l == 2 ? t.diagonal[2] : 0, l == 3 ? t.diagonal[3] : 0};
      q = (Four)((FourBits)q | (FourBits)first);
    }
    if constexpr (l == 1) {
      out[2] = q[0];
    } else {
      const Four cosines = q * c, sines = q * s, backwards = {sines[3], sines[2], sines[1], sines[0]};
      std::memcpy(out + sh_index(l, -3), &backwards, sizeof backwards);
      std::memcpy(out + sh_index(l, 0), &cosines, sizeof cosines);
    }
    four_frequencies<order, l + 1>(z, c, s, q, q1, out);
  }
}

// All harmonics of one direction.
template <int order, class T>
[[gnu::always_inline]] inline void evaluate(T x, T y, T z, T* __restrict out) {
  if constexpr (order < 4 || sizeof(T) > sizeof(float)) {
    frequencies<order, 0>(x, y, z, T(1), T(0), out);
  } else {
    const float c2 = x * x - y * y, s2 = x * y + y * x, c3 = c2 * x - s2 * y, s3 = c2 * y + s2 * x;
    const Four c = {1, x, c2, c3}, s = {0, y, s2, s3}, q0 = {sh_tables_rounded<T>.diagonal[0]};
    four_frequencies<order, 1>(Four{z, z, z, z}, c, s, q0, Four{}, out);
    const float linear = sh_tables_rounded<T>.diagonal[1];
    out[0] = sh_tables_rounded<T>.diagonal[0], out[1] = linear * y, out[3] = linear * x;
    frequencies<order, 4>(x, y, z, c3 * x - s3 * y, c3 * y + s3 * x, out);
  }
}

}  // namespace sh_fixed

// evaluate_sh of sh.h (one direction) within the caller's code, without its 1.7 ns for the call: order^2
// values for the unit direction d, to the same bits unless the caller is compiled to fuse multiplications and additions
// (-mfma without -ffp-contract=off).
template <int order>
inline void evaluate_sh(Vec3 d, std::span<float, size_t(sh_count(order))> out) {
  static_assert(order >= 1 && order <= max_sh_order);
  sh_fixed::evaluate<order>(d.x, d.y, d.z, out.data());
}
template <int order>
inline void evaluate_sh(Vec3d d, std::span<double, size_t(sh_count(order))> out) {
  static_assert(order >= 1 && order <= max_sh_order);
  sh_fixed::evaluate<order>(d.x, d.y, d.z, out.data());
}

}  // namespace lambent

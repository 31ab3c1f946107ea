#pragma once
// The rotation Rz(a) Rx(-90) Rz(b) Rx(90) Rz(c) over any number type T with + - * <, so that its work can be counted.
// Source: local-deformable-prt, which gives the multiplications for n = 3 .. 9 as 53, 121, 217, 345, 509, 713, 961.
//
// A quarter turn about x swaps the parities in y and z and keeps that in x. A band's harmonics fall into four classes
// by parity, cosines and sines of even and odd m, and each class maps to one class only: of the (2l+1)^2 entries l^2 +
// l + 1 are not zero, in four dense blocks. The turn back is the transpose. Blocks of one entry are +-1 and cost
// nothing.
#include <lambent/basis/sh.h>

namespace lambent::zyz {

// Class 0 is cosines of even m (0, 2, ..), 1 of odd m (1, 3, ..), 2 sines of even m (2, 4, ..), 3 of odd m (1, 3, ..).
constexpr int class_size(int l, int c) { return c == 0 ? l / 2 + 1 : c == 2 ? l / 2 : (l + 1) / 2; }
constexpr int class_m(int c, int k) { return c == 0 ? 2 * k : c == 1 ? 2 * k + 1 : c == 2 ? -2 * k - 2 : -2 * k - 1; }
// The class that a quarter turn about x takes to class c.
constexpr int class_source(int l, int c) {
  constexpr int even[4] = {0, 2, 1, 3}, odd[4] = {3, 1, 2, 0};
  return l % 2 ? odd[c] : even[c];
}

// Blocks of the +90 degree turn for l = 2 .. max_sh_order - 1, classes 0 .. 3, row-major, one after another.
const std::vector<double>& quarter_turn_blocks();

// Bands 2 .. order - 1, here and below.
template <class T>
void quarter_turn(int order, const T* block, bool back, const T* in, T* out) {
  for (int l = 2; l < order; ++l)
    for (int c = 0; c < 4; ++c) {
      const int source = class_source(l, c), n = class_size(l, c), centre = l * (l + 1);
      const int from = back ? c : source, to = back ? source : c;
      for (int r = 0; r < n; ++r) {
        T& result = out[centre + class_m(to, r)];
        const T& leading = in[centre + class_m(from, 0)];
        if (n == 1) {
          result = block[0] < T(0) ? -leading : leading;
          continue;
        }
        result = block[back ? r : r * n] * leading;
        for (int k = 1; k < n; ++k)
          result = result + block[back ? k * n + r : r * n + k] * in[centre + class_m(from, k)];
      }
      block += n * n;
    }
}

// Two multiplications a multiple: cos(m+1)t + cos(m-1)t = 2 cos t cos mt, or cos(m+1)t - cos(m-1)t = -2 sin t sin mt,
// whichever has the greater factor: each loses digits where its factor is small.
template <class T>
void turn_about_z(int order, T cosine, T sine, T* f) {
  auto size = [](T x) { return x < T(0) ? -x : x; };
  const bool by_sine = size(cosine) < size(sine);
  const T twice_cosine = cosine + cosine, twice_sine = sine + sine;
  T c0 = T(1), s0 = T(0), c = cosine, s = sine;
  for (int m = 1; m < order; ++m) {
    if (m > 1) {
      const T next_c = by_sine ? twice_cosine * c - c0 : c0 - twice_sine * s;
      const T next_s = by_sine ? twice_cosine * s - s0 : s0 + twice_sine * c;
      c0 = c, s0 = s, c = next_c, s = next_s;
    }
    for (int l = m < 2 ? 2 : m; l < order; ++l) {
      T& plus = f[l * (l + 1) + m];
      T& minus = f[l * (l + 1) - m];
      const T p = plus;
      plus = p * c - minus * s;
      minus = p * s + minus * c;
    }
  }
}

// angles are (cos, sin) of a, b, c; f has order^2 values and is rotated in place, scratch as many.
template <class T>
void rotate_bands(int order, const T angles[6], const T* blocks, T* f, T* scratch) {
  turn_about_z(order, angles[4], angles[5], f);
  quarter_turn(order, blocks, false, f, scratch);
  turn_about_z(order, angles[2], angles[3], scratch);
  quarter_turn(order, blocks, true, scratch, f);
  turn_about_z(order, angles[0], angles[1], f);
}

// All bands; R row-major, for the linear band, whose functions point along (-x, -y, z).
template <class T>
void rotate(int order, const T R[9], const T angles[6], const T* blocks, T* f, T* scratch) {
  if (order > 1) {
    const T x = f[3], y = f[1], z = f[2];
    f[3] = R[0] * x + R[1] * y - R[2] * z;
    f[1] = R[3] * x + R[4] * y - R[5] * z;
    f[2] = R[8] * z - R[6] * x - R[7] * y;
  }
  if (order > 2) rotate_bands(order, angles, blocks, f, scratch);
}

}  // namespace lambent::zyz

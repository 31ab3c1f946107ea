#pragma once
// Real spherical harmonics: orthonormal, with the Condon-Shortley sign, coefficient index l(l+1)+m, evaluated at raw
// (x, y, z) with +z as the pole. ORDER n means n bands, l = 0 .. n-1, and n^2 coefficients. Other systems' conventions:
// sh_convert.h. Source: P.-P. Sloan, "Stupid spherical harmonics tricks" (2008); general-prt.
#include <lambent/core/vec.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Bands at most.
inline constexpr int max_sh_order = 16;

// Coefficients of an order; the index of (l, m); the band of an index.
constexpr int sh_count(int order) { return order * order; }
constexpr int sh_index(int l, int m) { return l * (l + 1) + m; }
constexpr int sh_band(int index) {
  int l = 0;
  while ((l + 1) * (l + 1) <= index) ++l;
  return l;
}

// Values of the first order^2 harmonics at the unit direction d, into out[0 .. order^2); of none for order 0.
void evaluate_sh(int order, Vec3 d, std::span<float> out);
void evaluate_sh(int order, Vec3d d, std::span<double> out);
// The same for many unit directions (x[i], y[i], z[i]) in SIMD lanes, to the same bits: harmonic k of direction i goes
// to out[k * stride + i], stride >= x.size(); out may not overlap the directions. Fastest where out stays in the
// first-level cache, begins on a cache line and the stride is a multiple of 16 but not of 1024 (docs/products.md).
void evaluate_sh(int order, std::span<const float> x, std::span<const float> y, std::span<const float> z, size_t stride,
                 std::span<float> out);

// Coefficients of a function of direction by quadrature that is exact for functions within `exact_order` bands
// (Gauss-Legendre in z, even spacing about it).
std::vector<double> project_sh(int order, const std::function<double(Vec3d)>& f, int exact_order = 64);

// Value at d of the function with these coefficients (as many as a square number).
float reconstruct_sh(std::span<const float> coefficients, Vec3 d);
Vec3 reconstruct_sh(std::span<const Vec3> coefficients, Vec3 d);

// Order of a coefficient vector: the square root of its length, which must be a square.
int sh_order(size_t coefficient_count);

// Convolution with the clamped cosine max(0, cos t) multiplies band l by this: pi, 2 pi/3, pi/4, 0, -pi/24, 0, pi/64,
// ...
double clamped_cosine(int l);

// A rotation of functions, (Rf)(s) = f(R^-1 s), as one dense block a band, row-major, bands one after another.
// Source: J. Ivanic and K. Ruedenberg 1996 with their 1998 corrections.
struct ShRotation {
  int order = 0;
  std::vector<float> blocks;
};
ShRotation make_sh_rotation(int order, const Mat3& R);
void rotate_sh(const ShRotation& rotation, std::span<const float> in, std::span<float> out);  // not in place
std::vector<Vec3> rotate_sh(const ShRotation& rotation, std::span<const Vec3> in);

// Rotates by R = Rz(a) Ry(b) Rz(c) without building R's blocks: turns about z, and fixed quarter turns about x.
class ShZyzRotator {
 public:
  explicit ShZyzRotator(int order);
  // In place, order^2 values.
  void rotate(float a, float b, float c, std::span<float> coefficients) const;

 private:
  int order_;
  ShRotation quarter_x_, quarter_x_back_;
};

// Windows against ringing, as factors a band.
enum class ShWindow { none, hann, lanczos, automatic };
// Factors of the fixed windows, w_l for l = 0 .. order-1: Hann (1 + cos(pi l / order)) / 2, Lanczos sinc(pi l / order).
std::vector<float> sh_window(ShWindow window, int order);
// Windows a light. `automatic` takes the weakest window 1 / (1 + k l^2 (l+1)^2) under which the luminance of unshadowed
// irradiance is nowhere negative (to 1e-3 of its mean). Returns the factors used.
std::vector<float> apply_sh_window(ShWindow window, std::span<Vec3> light);

}  // namespace lambent

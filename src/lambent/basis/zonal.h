#pragma once
// Zonal harmonics: functions that are symmetric about an axis. Source: local-deformable-prt, section 3.1.
//
// g(s) = sum_l g_l y_l0(s_z) is symmetric about +z, with one ZONAL COEFFICIENT g_l a band (eq. 2). Its LOBE
// COEFFICIENTS g*_l = sqrt(4 pi / (2l + 1)) g_l (eq. 4) are what convolution and rotation want: turned so that +z comes
// to the axis s*, it has the spherical harmonics y_lm(s*) g*_l (eq. 6). All functions below take lobe coefficients;
// order n means n of them.
#include <lambent/basis/sh.h>

namespace lambent {

// (2l + 1) / (4 pi): the sum of squares of a band's harmonics in any direction.
inline double band_energy(int l) { return (2 * l + 1) / (4 * std::numbers::pi); }

// Between the two scalings, in place (eq. 4).
void zonal_to_lobe(std::span<double> coefficients);
void lobe_to_zonal(std::span<double> coefficients);

// P_0(x) .. P_{count-1}(x).
void evaluate_legendre(double x, std::span<double> out);

// Lobe coefficients of the function whose value at polar angle t is f(cos t), by quadrature. f may have kinks or jumps
// at the given ascending cosines; between them it should be smooth.
std::vector<double> project_zonal(int order, const std::function<double(double)>& f,
                                  std::span<const double> kinks = {});

// The lobe's value at an angle of that cosine from its axis.
double evaluate_lobe(std::span<const double> lobe, double cosine);

// f convolved with g (eq. 3): band l of f times g*_l. In may be out; `sh` and `out` have order^2 values.
void convolve_sh(std::span<const float> lobe, std::span<const float> sh, std::span<float> out);

// Unit axis about which the linear band of a function is symmetric, (-f_11, -f_1-1, f_10) normalised: the "optimal
// linear lobe" (section 3.3). +z where the band vanishes. Order 2 at least.
Vec3 linear_axis(std::span<const float> sh);

// The lobe coefficients about a given axis that come closest to a function (eq. 18).
std::vector<float> closest_lobe(std::span<const float> sh, Vec3 axis);

// A sum of lobes about several axes (eq. 7): the same order for each.
struct ZonalSum {
  int order = 0;
  std::vector<Vec3> axes;           // unit
  std::vector<float> coefficients;  // [lobe][band]
  std::span<const float> lobe(size_t i) const {
    return std::span(coefficients).subspan(i * size_t(order), size_t(order));
  }
};
// Its value in a direction, without forming the harmonics.
double evaluate_zonal(const ZonalSum& sum, Vec3d d);
// Its order^2 spherical harmonics (eq. 7).
std::vector<float> zonal_to_sh(const ZonalSum& sum);
// (Rf)(s) = f(R^-1 s): turns the axes and leaves the coefficients alone (eq. 10).
ZonalSum rotate_zonal(const ZonalSum& sum, const Mat3& R);

// Diffuse reflection at a thin sheet that lets the share `alpha` through (eq. 22-23): lobe coefficients about the
// outward normal of max(0, cos t) + alpha max(0, -cos t), over pi.
std::vector<double> membrane_lobe(int order, double alpha);

}  // namespace lambent

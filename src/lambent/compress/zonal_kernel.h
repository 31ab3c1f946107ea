#pragma once
// Fits of zonal lobes, eight side by side in SIMD lanes, in double. Source: local-deformable-prt, section 4.1.
//
// With the axes s_i given, the bands are independent and linear: band l of the target, t_l, is fitted by sum_i g_il
// y_l(s_i) with
//   G_l g_l = b_l,   (G_l)_ij = y_l(s_i) . y_l(s_j) = k_l P_l(s_i . s_j),   (b_l)_i = y_l(s_i) . t_l = t_l(s_i),   k_l
//   = (2l+1)/4pi,
// by the addition theorem: only the target is ever evaluated, at the axes alone. What is left to minimise is a function
// of 2N angles,
//   psi(s) = |t|^2 - sum_l b_l . g_l,
// (variable projection) by Newton's method, damped, with its exact gradient and Hessian.
#include <lambent/core/aligned.h>

#include <cstddef>
#include <vector>

namespace lambent {

inline constexpr size_t zonal_lanes = 8;
inline constexpr int max_zonal_lobes = 8;

// One batch. All arrays have lanes innermost. Channels share axes and have coefficients of their own.
struct ZonalBatch {
  int order = 0, first_band = 0, channels = 1, lobes = 1;  // bands [first_band, order) are fitted
  AlignedVector<double> t;     // [channel][order^2][lane]: targets; bands below first_band count for nothing
  AlignedVector<double> axes;  // [lobe][3][lane], unit
  AlignedVector<double> g;     // [channel][band - first_band][lobe][lane]
  AlignedVector<double> psi;   // [lane]: squared error, plus ridge |g|^2
  AlignedVector<double> scratch;
  int bands() const { return order - first_band; }
  double* target(int channel, int coefficient) {
    return t.data() + size_t(channel * order * order + coefficient) * zonal_lanes;
  }
  double* axis(int lobe, int component) { return axes.data() + size_t(lobe * 3 + component) * zonal_lanes; }
  double* coefficient(int channel, int band, int lobe) {
    return g.data() + size_t((channel * bands() + band - first_band) * lobes + lobe) * zonal_lanes;
  }
};
ZonalBatch make_zonal_batch(int order, int first_band, int channels, int lobes);

struct ZonalRefineOptions {
  int iterations = 30;      // steps of Newton's method at most; 0 solves for the coefficients alone
  double tolerance = 1e-6;  // stops where a step would gain less than this share of psi
  double ridge = 1e-9;      // squared coefficients count this much, in psi: keeps nearly equal axes from huge ones
};
// From the axes in the batch to the nearest minimum: axes, g and psi. Target bands of zero are fitted by zeros.
void refine_zonal(ZonalBatch& batch, const ZonalRefineOptions& options);

// psi and its derivatives at the batch's axes, for tests. Angles are along frame_about(axis)'s first two columns, two a
// lobe.
struct ZonalDerivatives {
  std::vector<double> psi, gradient, hessian;  // [lane], [2 lobes][lane], [2 lobes][2 lobes][lane]
};
ZonalDerivatives differentiate_zonal(ZonalBatch& batch, double ridge);

// Directions to begin from, with their harmonics: half of a cube's surface in n x n cells a face.
struct ZonalStarts {
  int order = 0;
  std::vector<double> directions;  // [direction][3]
  std::vector<double> y;           // [direction][order^2]
};
ZonalStarts make_zonal_starts(int order, int n);
// Sets the axis of lobe 0 to the best of the starts for a single lobe (eq. 18), or to the target's linear axis (sum of
// channels) where that is better.
void choose_start(ZonalBatch& batch, const ZonalStarts& starts);

// out = target - sum of the batch's lobes, [channel][order^2][lane]; bands below first_band are copied.
void zonal_residual(const ZonalBatch& batch, double* out);

}  // namespace lambent

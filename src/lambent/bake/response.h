#pragma once
// How a material answers light, over the incident basis (basis/cosine_basis.h): the vectors O_j(wo) = integral of f(wi,
// wo) z_j(wi) cos over the hemisphere, and what is made of them: few rows by singular values, rows of an outgoing
// basis. Source: general-prt, "Final reflection"; separable BRDFs by SVD; local-deformable-prt eq. 14-15.
#include <lambent/basis/cosine_basis.h>
#include <lambent/brdf/brdf.h>
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// A material as a function of its base colour, in which it is linear: `black` is its BRDF at base colour 0, `white`
// at 1. A BRDF that has no base colour is black = white = itself.
struct LinearMaterial {
  Brdf black, white;
};

// O_j of each material over a grid of views, rows = order^2. `samples` directions a view, drawn from the BRDF. Where
// reflection is isotropic, O is integrated for one view of each height, with what is odd about its plane left out, and
// turned to the others; else for the views of one quadrant, and mirrored. Errors: cancelled.
Result<std::vector<ViewMap>> make_responses(std::span<const LinearMaterial> materials, const CosineBasis& basis,
                                            int grid, int samples, Progress* progress = nullptr);

// What the incident basis does not hold of a reflectance: of the integral of f^2 cos over the hemisphere, mean over
// views by their cosine, the part outside the basis' span, [0, 1]. 0 for Lambert, near 1 for a mirror. `samples`
// directions a view, drawn from the BRDF.
double energy_beyond(const Brdf& brdf, const CosineBasis& basis, int samples = 4096);

// O = sum_r g_r(wo) h_rj: the rows h and the weights g, by singular values of O weighed by the cosine of the view. At
// most max_rows, and as few as leave a relative error (root of the weighed sum of squares) of `tolerance`.
struct FactoredResponse {
  int rows = 0;
  std::vector<float> h;                 // rows x order^2
  ViewMap g;                            // rows
  bool constant = false;                // g is the same in every view (Lambert)
  std::vector<double> singular_values;  // all of them
  double error = 0;                     // what is left out, relative
};
FactoredResponse factor_response(const ViewMap& response, int max_rows, double tolerance);

// Phong's lobe by convolution (general-prt, "Phong-like BRDFs"): light times visibility and cosine, cut off at the
// incident order, is convolved with the lobe about the mirrored view. Rows over the incident basis, of one channel:
// order^2 for harmonics of the mirrored view, a diffuse row, and one for diffuse reflection of the base colour. Empty
// for what is not Phong or Lambert.
std::vector<float> convolve_phong(const LinearMaterial& material, const CosineBasis& basis, int channel);
// The eigenvalues of convolution with Phong's lobe (n + 2) / (2 pi) cos^n over the half sphere, by band: (n + 2) *
// integral of t^n P_l over [0, 1].
std::vector<double> phong_convolution(float exponent, int order);

// The matrix C of outgoing bases: coefficients over wo of each component (a.r, a.g, a.b, b) of O_j, order^2 x
// order_in^2 for each. `kind` is sh, hemisphere or hsh; or lobes are given, and there are as many as those, fitted by
// least squares over the hemisphere.
std::array<std::vector<float>, 4> project_response(const ViewMap& response, OutgoingKind kind, int order,
                                                   std::span<const Lobe> lobes = {});

}  // namespace lambent

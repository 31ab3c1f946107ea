#pragma once
// Files of measured reflection.
#include <lambent/brdf/measured.h>
#include <lambent/core/result.h>

#include <span>

namespace lambent {

// Either format, told apart by the bytes.
//
// MERL binary (little-endian): three 32-bit counts, cells of theta_h, theta_d and of phi_d over half a turn (90, 90,
// 180; smaller tables are read too), then that many 64-bit numbers for red, for green and for blue, to be multiplied by
// 1/1500, 1.15/1500 and 1.66/1500. Negative numbers mean "not measured": the nearest smaller theta_d that was stands in
// for them.
//
// Cornell text: comments from # to the end of the line; the number of wavelengths, the wavelengths in nm, rising; then
// rows of theta_i phi_i theta_o phi_o (radians) and f at each wavelength. Taken as isotropic and mirror-symmetric.
// Spectra become linear Rec. 709 under D65, such that a perfect white is (1, 1, 1); what is outside the gamut is
// clamped to 0. The scattered samples are resampled to a table (resample_measured()).
//
// Errors: missing; neither format; truncated or too long; numbers that are not finite, out of range, or (Cornell)
// negative.
Result<MeasuredTable> load_measured(const std::string& path);
Result<MeasuredTable> load_measured(std::span<const uint8_t> bytes, const std::string& where);

struct MeasuredSample {
  HalfDifference angles;
  Vec3 f;
};

// A table of these counts of cells. A cell's value is a mean of the logarithms of its nearest samples, by the weights
// ((R - d) / (R d))^2, R the distance of the first that is left out; so a cell at a sample has its value. phi_d and its
// mirror image are one. Source: R. Franke and G. Nielson, "Smooth interpolation of large sets of scattered data", 1980,
// after D. Shepard.
MeasuredTable resample_measured(std::span<const MeasuredSample> samples, int theta_h, int theta_d, int phi_d);

}  // namespace lambent

#pragma once
// From spectra to linear Rec. 709.
#include <lambent/core/vec.h>

namespace lambent {

// CIE 1931 colour matching functions (x, y, z) at a wavelength in nanometres, as sums of lobes; within 1 % of their
// peaks. Source: Wyman, Sloan and Shirley 2013, "Simple analytic approximations to the CIE XYZ color matching
// functions".
Vec3d cie_matching_functions(double nanometres);

// Linear Rec. 709 of XYZ; out-of-gamut channels are negative. White is D65.
Vec3d rec709_from_xyz(Vec3d xyz);

// Relative power of the CIE standard illuminant D65, 100 at 560 nm; linear between the tabulated 10 nm, 0 outside 380
// to 780 nm.
double illuminant_d65(double nanometres);

}  // namespace lambent

#pragma once
// Fast rotation of spherical harmonics by turns about z and fixed quarter turns about x, for one rotation of one
// function (for many functions by the same rotation: make_sh_rotation). Source: local-deformable-prt, digression on SH
// rotation.
#include <lambent/basis/sh.h>

namespace lambent {

// R = Rz(a) Ry(b) Rz(c), as cosines and sines; sin_b >= 0.
struct EulerZyz {
  float cos_a = 1, sin_a = 0, cos_b = 1, sin_b = 0, cos_c = 1, sin_c = 0;
};
// For any rotation matrix. Where b is 0 or 180 degrees only a + c or a - c is determined: a is 0 then. Near there a and
// c are uncertain one by one, but c is taken from what a leaves of R, so that the product is as exact as R.
EulerZyz euler_zyz(const Mat3& R);

// (Rf)(s) = f(R^-1 s) for the rotation R; order^2 values, in may be out. Nothing is allocated but tables at the first
// call.
void rotate_sh_zyz(const Mat3& R, std::span<const float> in, std::span<float> out);
void rotate_sh_zyz(const Mat3& R, std::span<const Vec3> in, std::span<Vec3> out);

}  // namespace lambent

#pragma once
// A row of a lat-long map's texels, cut along the texels of a cube, in SIMD lanes chosen at run time. Source:
// locally-adaptive-products, section 4; cube_parts.h does the same one texel at a time, and what is left of it here.
#include <lambent/core/aligned.h>
#include <lambent/core/vec.h>

#include <cstdint>

namespace lambent {

// What a texel of the cube has received; the fourths are 0.
struct CubeSum {
  alignas(32) float energy[4], moment[4];  // moment: the sum of energy's channels, times its direction
};

// Corners of the map's texels along a parallel; with room for 16 more, copies of the last.
struct CornerRow {
  AlignedVector<float> x, y, z;  // direction
  AlignedVector<float> u, v;     // on its face, in texels
  AlignedVector<int32_t> face, column, row;
  void resize(size_t n) {
    for (AlignedVector<float>* a : {&x, &y, &z, &u, &v}) a->resize(n);
    for (AlignedVector<int32_t>* a : {&face, &column, &row}) a->resize(n);
  }
};

// x, y, z are set, `padded` of them, a multiple of 16: sets the rest.
void place_corners(int size, size_t padded, CornerRow& corners);

// Adds the light of `count` texels between two parallels, each of so many steradians; texel i has radiance[i / split].
void add_texels(int size, const CornerRow& above, const CornerRow& below, const Vec3* radiance, int split, int count,
                float solid_angle, CubeSum* sums);

}  // namespace lambent

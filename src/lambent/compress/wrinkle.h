#pragma once
// The wrinkle: a groove of cosine shape in a plane, as a table of zonal lobes over the place across it and its depth.
// Source: local-deformable-prt, section 4.2 (wrinkle model).
#include <lambent/transfer/zonal_transfer.h>

namespace lambent {

// The groove runs along y and is 1 wide: height -d cos^2(pi x) for |x| <= 1/2, and 0 beyond, with z outward.
struct WrinkleOptions {
  int order = 6, lobes = 3;
  int size = 32;             // places and depths in the table, [2, 256]
  float max_depth = 1.0f;    // (0, 10]
  float albedo = 0.5f;       // of the groove, for bounces, [0, 1)
};

// Transfer vectors of `count` places at the centres of equal parts of the groove, [place][order^2], in the frame of the plane. Exact up to
// quadrature: light is distant, so nothing changes along the groove and bounces happen in its cross-section.
std::vector<float> simulate_wrinkle(int order, int count, float depth, float albedo);

struct WrinkleTable {
  int size = 0;
  float max_depth = 0;
  ZonalTransfer transfer;  // receiver depth * size + place; depths go from max_depth / size in equal steps
  double rms = 0;          // relative error at the table's own entries
};
// Each entry's fit goes on from its neighbours', from the deepest groove up, so that lobes correspond and the table can be interpolated.
// Errors: options out of range.
Result<WrinkleTable> make_wrinkle_table(const WrinkleOptions& options);

// Values at x in [-1/2, 1/2] and a depth, bilinear in all of them, axes brought back to length 1; beyond the table, its edge.
std::vector<float> sample_wrinkle(const WrinkleTable& table, float x, float depth);

}  // namespace lambent

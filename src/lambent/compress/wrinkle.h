#pragma once
// The wrinkle: a groove of cosine shape in a plane, as a table of zonal lobes over the place across it and its depth.
// Source: local-deformable-prt, section 4.2 (wrinkle model).
#include <lambent/core/progress.h>
#include <lambent/transfer/zonal_texture.h>

namespace lambent {

// The groove runs along y and is 1 wide: height -d cos^2(pi x) for |x| <= 1/2, and 0 beyond, with z outward.
struct WrinkleOptions {
  int order = 6, lobes = 3;
  int size = 32;           // places and depths in the table, [3, 256]
  float max_depth = 1.0f;  // (0, 10]
  float albedo = 0.5f;     // of the groove, for bounces, [0, 1)
  int iterations = 200;    // of fitting all entries at once; 0 leaves each as it was fitted alone
};

// Transfer vectors of `count` places evenly from border to border of the groove, [place][order^2], in the frame of the
// plane. Exact up to quadrature: light is distant, so nothing changes along the groove and bounces happen in its
// cross-section.
std::vector<float> simulate_wrinkle(int order, int count, float depth, float albedo);

struct WrinkleTable {
  ZonalTexture texture;  // of grooves
  double rms = 0;        // relative error at the table's own entries
};
// Lobes of neighbours correspond, and all entries are fitted together to what lies between them, so that the table can
// be interpolated. Errors: options out of range.
Result<WrinkleTable> make_wrinkle_table(const WrinkleOptions& options, Progress* progress = nullptr);

}  // namespace lambent

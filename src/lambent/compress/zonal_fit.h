#pragma once
// Transfer -> transfer as zonal lobes. Source: local-deformable-prt, sections 3.3 and 4.1; docs/zonal.md has the errors
// to expect.
#include <lambent/core/progress.h>
#include <lambent/transfer/zonal_transfer.h>

namespace lambent {

struct ZonalFitOptions {
  int lobes = 4;        // a receiver, [1, 8]
  int starts = 8;       // further searches from random axes where the error is above `retry`, [0, 1000]
  float retry = 0.01f;  // relative error of a receiver's vector, [0, 1]
  float ridge = 1e-6f;  // what squared coefficients count in the squared error, [0, 1]: keeps them fit for half floats
  uint32_t seed = 1;    // of the random axes
  Precision precision = Precision::half;  // of the result
  // What squared errors of each row count in the report; empty: alike. Every row is fitted for itself.
  std::vector<float> row_weights;
};

struct ZonalFitReport {
  double rms = 0;  // sqrt(sum |fit - t|^2 / sum |t|^2) over all receivers, rows and channels, of what is stored
  std::vector<float> errors;  // |fit - t| / |t| of each receiver, over its rows; 0 where t is 0
  double seconds = 0;
  size_t retried = 0;  // rows of receivers that were searched again from random axes
};

// Receivers should be in the order of a space-filling curve, as the bake leaves them: along it, each fit also begins
// from its neighbours', and lobes keep their number and sign from one receiver to the next. The result does not depend
// on threads. Errors: options out of range; columns other than harmonics; cancelled.
Result<ZonalTransfer> fit_zonal(const Transfer& transfer, const ZonalFitOptions& options,
                                ZonalFitReport* report = nullptr, Progress* progress = nullptr);

}  // namespace lambent

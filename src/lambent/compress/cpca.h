#pragma once
// Clustered principal component analysis: Transfer -> CpcaTransfer. Receivers with like transfer form clusters; within
// one, the transfer is a mean and `rank` components, and a receiver keeps which cluster and `rank` weights. Relighting
// multiplies light with each cluster's few vectors once a frame, and then takes rank products a row at each receiver.
// Source: general-prt, "Clustered PCA"; Sloan, Hall, Hart and Snyder 2003.
#include <lambent/core/progress.h>
#include <lambent/transfer/cpca_transfer.h>

namespace lambent {

struct CpcaOptions {
  int clusters = 64;   // [1, 65535], at most the number of receivers
  int rank = 8;        // components a cluster, [0, 64]
  int iterations = 4;  // of assigning receivers to the cluster that fits best and fitting the clusters anew, [1, 64]
};

// Deterministic, whatever the thread count. error: relative RMS of the values, root of sum |T - T'|^2 / sum |T|^2.
// Errors: options out of range; cancelled.
Result<CpcaTransfer> compress_cpca(const Transfer& transfer, const CpcaOptions& options, double* error = nullptr,
                                   Progress* progress = nullptr);

}  // namespace lambent

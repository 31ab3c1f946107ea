#pragma once
// Transfer in clusters: each has a mean and a few components, each receiver a cluster and weights (compress/cpca.h).
#include <lambent/transfer/transfer.h>

namespace lambent {

// Limits of the file.
inline constexpr int max_cpca_clusters = 65535;
inline constexpr int max_cpca_rank = 64;

// T of a receiver = the mean of its cluster + a weighted sum of the cluster's components.
struct CpcaTransfer {
  LightBasis light;
  int rows = 1, channels = 1;
  size_t receivers = 0;
  int clusters = 0, rank = 0;
  // [cluster][1 + rank][row][channel][column]: the mean, then orthonormal components.
  std::vector<float> vectors;
  std::vector<uint16_t> cluster_of;  // by receiver
  std::vector<uint16_t> weights;     // halves, [receiver][rank]
  size_t receiver_values() const { return size_t(rows) * size_t(channels) * light.count(); }
  size_t bytes() const { return vectors.size() * 4 + cluster_of.size() * 2 + weights.size() * 2; }
};

// One receiver's values again, [row][channel][column].
std::vector<float> load_receiver(const CpcaTransfer& t, size_t receiver);

}  // namespace lambent

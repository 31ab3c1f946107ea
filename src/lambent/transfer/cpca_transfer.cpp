#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/transfer/cpca_transfer.h>

namespace lambent {

std::vector<float> load_receiver(const CpcaTransfer& t, size_t receiver) {
  LAMBENT_CHECK(receiver < t.receivers);
  const size_t D = t.receiver_values(), rank = size_t(t.rank);
  const float* v = t.vectors.data() + size_t(t.cluster_of[receiver]) * (1 + rank) * D;
  std::vector<float> out(v, v + D);
  for (size_t i = 0; i < rank; ++i) {
    const float w = half_to_float(t.weights[receiver * rank + i]);
    for (size_t k = 0; k < D; ++k) out[k] += w * v[(1 + i) * D + k];
  }
  return out;
}

}  // namespace lambent

// Follows: general-prt, "Clustered PCA": light times the clusters' vectors once a frame, then `rank` products a row and receiver.
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/relight.h>

namespace lambent {

void relight(const CpcaTransfer& t, std::span<const Vec3> light, Relit& out) {
  const size_t C = t.light.count(), rows = size_t(t.rows), rank = size_t(t.rank), channels = size_t(t.channels);
  LAMBENT_CHECK(light.size() >= C && t.cluster_of.size() == t.receivers && t.weights.size() == t.receivers * rank);
  const size_t blocks = (t.receivers + transfer_block - 1) / transfer_block;
  out.rows = t.rows;
  out.values.resize(blocks * rows * 3 * transfer_block);
  // Once a frame: each cluster's vectors times the light, [cluster][1 + rank][row][r, g, b].
  const size_t each = 3 * rows;
  out.scratch.resize(size_t(t.clusters) * (1 + rank) * each);
  parallel_for(size_t(t.clusters) * (1 + rank), 16, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v)
      for (size_t row = 0; row < rows; ++row)
        for (size_t c = 0; c < 3; ++c) {
          const float* x = t.vectors.data() + ((v * rows + row) * channels + std::min(c, channels - 1)) * C;
          float sum = 0;
          for (size_t k = 0; k < C; ++k) sum += x[k] * light[k][int(c)];
          out.scratch[v * each + row * 3 + c] = sum;
        }
  });
  parallel_for(blocks, 256, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      float* values = out.values.data() + b * rows * 3 * transfer_block;
      if ((b + 1) * transfer_block > t.receivers) std::fill(values, values + rows * 3 * transfer_block, 0.0f);
      for (size_t i = 0; i < std::min(transfer_block, t.receivers - b * transfer_block); ++i) {
        const size_t r = b * transfer_block + i;
        const float* L = out.scratch.data() + size_t(t.cluster_of[r]) * (1 + rank) * each;
        for (size_t e = 0; e < each; ++e) values[e * transfer_block + i] = L[e];
        for (size_t k = 0; k < rank; ++k) {
          L += each;
          const float w = half_to_float(t.weights[r * rank + k]);
          for (size_t e = 0; e < each; ++e) values[e * transfer_block + i] += w * L[e];
        }
      }
    }
  });
}

}  // namespace lambent

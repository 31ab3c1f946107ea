#pragma once
// What is kept of the incident rows X of a receiver: its material's last reflection, as far as it can be applied before
// the view is known.
#include <lambent/bake/matrix.h>

namespace lambent {

// For each material and channel a matrix, rows x order^2, and what is left to apply (outgoing.h).
struct LastReflection {
  Outgoing outgoing;
  int rows = 0, channels = 1;
  std::vector<std::array<std::vector<float>, 3>> h;  // by material, by channel
};
// `channels`: of X. Errors: cancelled.
Result<LastReflection> make_last_reflection(const std::vector<ViewMap>& responses, const ReceiverMaterials& materials,
                                            const MatrixOptions& options, const CosineBasis& basis, int channels,
                                            Progress* progress);

// X of a receiver, [order^2][channel][width], as the rows that are kept.
void store_rows(const LastReflection& last, const ReceiverMaterials& materials, const WritableTransfer& out,
                size_t receiver, const float* x, size_t channels, size_t width);

}  // namespace lambent

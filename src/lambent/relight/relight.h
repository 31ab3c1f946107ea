#pragma once
// outgoing = O . T . light. This is T . light for every row of every receiver: one stream over the transfer, bound by
// memory bandwidth. O is left to whoever draws: the albedo for diffuse transfer, the last reflection towards the eye
// for other rows.
#include <lambent/core/aligned.h>
#include <lambent/core/vec.h>
#include <lambent/transfer/cpca_transfer.h>

#include <span>

namespace lambent {

// T . light, [block][row][r, g, b][receiver in block], blocks as in the transfer. For diffuse transfer the only row is
// the exit radiance of a white receiver.
struct Relit {
  int rows = 1;
  AlignedVector<float> values;
  AlignedVector<float> scratch;  // of whatever computes them
  Vec3 at(size_t receiver, int row = 0) const {
    const float* v = values.data() + (receiver / transfer_block * size_t(rows) + size_t(row)) * (3 * transfer_block) +
                     receiver % transfer_block;
    return {v[0], v[transfer_block], v[2 * transfer_block]};
  }
  void set(size_t receiver, int row, Vec3 value) {
    float* v = values.data() + (receiver / transfer_block * size_t(rows) + size_t(row)) * (3 * transfer_block) +
               receiver % transfer_block;
    v[0] = value.x, v[transfer_block] = value.y, v[2 * transfer_block] = value.z;
  }
};

// light: coefficients of radiance, at least as many as there are columns (harmonics of higher order are cut off). Sizes
// `out` on first use and allocates nothing after that. All cores; the sum of each receiver has a fixed order.
void relight(const Transfer& transfer, std::span<const Vec3> light, Relit& out);

// The same into memory of the caller's, [receiver][row][r, g, b]: receiver r begins at out[r * stride]. `stride`, in
// floats, is 3 rows at least. Fastest with one row, a stride of 3 and memory that begins on a cache line.
void relight(const Transfer& transfer, std::span<const Vec3> light, std::span<float> out, size_t stride);

// What was relit in blocks, so arranged.
void interleave(const Relit& relit, size_t receivers, std::span<float> out, size_t stride);

// The same from clusters: what relighting the whole transfer gives, but for the compression's error.
void relight(const CpcaTransfer& transfer, std::span<const Vec3> light, Relit& out);

}  // namespace lambent

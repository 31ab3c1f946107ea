#pragma once
// outgoing = O . T . light. For diffuse transfer O is the receiver's albedo, left to whoever draws; this is T . light for every
// receiver: one stream over the transfer, bound by memory bandwidth.
#include <lambent/core/aligned.h>
#include <lambent/core/vec.h>
#include <lambent/transfer/transfer.h>

#include <span>

namespace lambent {

// Exit radiance of a white receiver, [block][r, g, b][receiver in block], blocks as in the transfer.
struct Relit {
  AlignedVector<float> values;
  Vec3 at(size_t receiver) const {
    const float* v = values.data() + receiver / transfer_block * (3 * transfer_block) + receiver % transfer_block;
    return {v[0], v[transfer_block], v[2 * transfer_block]};
  }
};

// light: coefficients of radiance, at least order^2 of them (a light of higher order is cut off). Sizes `out` on first use and
// allocates nothing after that. All cores; the sum of each receiver has a fixed order.
void relight(const Transfer& transfer, std::span<const Vec3> light, Relit& out);

}  // namespace lambent

#pragma once
// Solution vectors as they are stored.
#include <lambent/core/ranks.h>
#include <lambent/transfer/transfer.h>

namespace lambent {

// x, [receiver][row][column][channel] with `width` floats a row, as a Transfer. `places`: of each receiver, where it is
// in x; empty: in their order.
Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision, std::span<const uint32_t> places = {});

// One receiver's rows of it. `values`: scratch.
void store_columns_of(const WritableTransfer& out, size_t receiver, const float* x, size_t width,
                      std::vector<float>& values);

// Each rank has stored its own receivers, and gets the others'. `shares`: of the receivers, by whole blocks of storage.
void gather_stored(const Shares& shares, const WritableTransfer& out);

}  // namespace lambent

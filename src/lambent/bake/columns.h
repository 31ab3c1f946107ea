#pragma once
// Solution vectors as they are stored.
#include <lambent/core/ranks.h>
#include <lambent/transfer/transfer.h>

namespace lambent {

// x, [receiver][row][column][channel] with `width` floats a row, as a Transfer.
Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision);

// Each rank has stored its own receivers, and gets the others'. `shares`: of the receivers, by whole blocks of storage.
void gather_stored(const Shares& shares, const WritableTransfer& out);

}  // namespace lambent

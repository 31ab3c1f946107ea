#pragma once
// Solution vectors as they are stored.
#include <lambent/bake/thin.h>
#include <lambent/transfer/transfer.h>

namespace lambent {

// x, [receiver][row][column][channel] with `width` floats a row, as a Transfer.
Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision);

// The same, one row a receiver, of all receivers where x holds those of the chosen ones (thin.h).
Transfer store_spread(const LightBasis& light, const float* x, const Spread& spread, int channels, size_t receivers,
                      size_t width, Precision precision);

}  // namespace lambent

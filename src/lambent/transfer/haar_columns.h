#pragma once
// Transfer in wavelets read by columns, for what is made of it: bounces, pixels.
#include <lambent/transfer/haar_transfer.h>

namespace lambent {

// The entries of columns [first, first + count): that of receiver r in column c to out[r * stride + (c - first) *
// step]; nothing else is written. Says how many there are.
size_t load_columns(const HaarTransfer& t, size_t first, size_t count, size_t stride, size_t step, float* out);

// Of each receiver's row, all channels: the sum of squares.
std::vector<double> haar_squares(const HaarTransfer& t);

}  // namespace lambent

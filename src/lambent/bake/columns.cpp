#include <lambent/bake/columns.h>
#include <lambent/core/parallel.h>

namespace lambent {

void store_columns_of(const WritableTransfer& out, size_t receiver, const float* x, size_t width,
                      std::vector<float>& values) {
  const Transfer& t = out.transfer;
  const size_t columns = t.columns(), n = size_t(t.channels);
  values.resize(t.receiver_values());
  for (size_t row = 0; row < size_t(t.rows); ++row)
    for (size_t k = 0; k < columns; ++k)
      for (size_t c = 0; c < n; ++c) values[(row * n + c) * columns + k] = x[row * width + n * k + c];
  store_receiver(out, receiver, values);
}

Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision, std::span<const uint32_t> places) {
  WritableTransfer out = make_transfer(light, int(rows), channels, receivers, precision);
  parallel_for(receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values;
    for (size_t r = begin; r < end; ++r)
      store_columns_of(out, r, x + (places.empty() ? r : places[r]) * rows * width, width, values);
  });
  return std::move(out.transfer);
}

void gather_stored(const Shares& shares, const WritableTransfer& out) {
  const size_t block = out.transfer.block_values() * out.transfer.value_bytes();
  shares.gather_each(transfer_block, out.values, block);
}

}  // namespace lambent

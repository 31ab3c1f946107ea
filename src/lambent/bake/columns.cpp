#include <lambent/bake/columns.h>
#include <lambent/core/parallel.h>

namespace lambent {

Transfer store_columns(const LightBasis& light, const float* x, size_t rows, int channels, size_t receivers,
                       size_t width, Precision precision) {
  const size_t columns = light.count(), n = size_t(channels);
  WritableTransfer out = make_transfer(light, int(rows), channels, receivers, precision);
  parallel_for(receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values(rows * n * columns);
    for (size_t r = begin; r < end; ++r) {
      for (size_t row = 0; row < rows; ++row)
        for (size_t k = 0; k < columns; ++k)
          for (size_t c = 0; c < n; ++c) values[(row * n + c) * columns + k] = x[(r * rows + row) * width + n * k + c];
      store_receiver(out, r, values);
    }
  });
  return std::move(out.transfer);
}

Transfer store_spread(const LightBasis& light, const float* x, const Spread& spread, int channels, size_t receivers,
                      size_t width, Precision precision) {
  const size_t columns = light.count(), n = size_t(channels);
  WritableTransfer out = make_transfer(light, 1, channels, receivers, precision);
  parallel_for(receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> values(n * columns), row(width);
    for (size_t r = begin; r < end; ++r) {
      spread.row(r, x, width, row.data());
      for (size_t k = 0; k < columns; ++k)
        for (size_t c = 0; c < n; ++c) values[c * columns + k] = row[n * k + c];
      store_receiver(out, r, values);
    }
  });
  return std::move(out.transfer);
}

}  // namespace lambent

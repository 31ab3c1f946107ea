#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/transfer/transfer.h>

#include <cstring>

namespace lambent {

WritableTransfer make_transfer(LightBasis light, int rows, int channels, size_t receivers, Precision precision) {
  WritableTransfer w;
  LAMBENT_CHECK(light.count() <= max_columns && rows >= 1 && (channels == 1 || channels == 3));
  w.transfer.light = std::move(light), w.transfer.rows = rows, w.transfer.channels = channels, w.transfer.receivers = receivers, w.transfer.precision = precision;
  auto memory = std::make_shared<AlignedVector<uint8_t>>(w.transfer.bytes());
  w.values = memory->data();
  w.transfer.data = *memory;
  w.transfer.storage = std::move(memory);
  return w;
}

void store_receiver(const WritableTransfer& w, size_t receiver, std::span<const float> values) {
  const Transfer& t = w.transfer;
  LAMBENT_CHECK(receiver < t.receivers && values.size() == t.receiver_values());
  size_t at = receiver / transfer_block * t.block_values() + receiver % transfer_block;
  for (float v : values) {
    if (t.precision == Precision::half) {
      const uint16_t h = float_to_half(v);
      std::memcpy(w.values + 2 * at, &h, 2);
    } else {
      std::memcpy(w.values + 4 * at, &v, 4);
    }
    at += transfer_block;
  }
}

std::vector<float> load_receiver(const Transfer& t, size_t receiver) {
  LAMBENT_CHECK(receiver < t.receivers);
  std::vector<float> values(t.receiver_values());
  size_t at = receiver / transfer_block * t.block_values() + receiver % transfer_block;
  for (float& v : values) {
    if (t.precision == Precision::half) {
      uint16_t h;
      std::memcpy(&h, t.data.data() + 2 * at, 2);
      v = half_to_float(h);
    } else {
      std::memcpy(&v, t.data.data() + 4 * at, 4);
    }
    at += transfer_block;
  }
  return values;
}

}  // namespace lambent

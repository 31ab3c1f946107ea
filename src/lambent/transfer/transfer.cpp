#include <lambent/core/check.h>
#include <lambent/transfer/blocks.h>

namespace lambent {

WritableTransfer make_transfer(LightBasis light, int rows, int channels, size_t receivers, Precision precision) {
  WritableTransfer w;
  LAMBENT_CHECK(light.count() <= max_columns && rows >= 1 && (channels == 1 || channels == 3));
  w.transfer.light = std::move(light), w.transfer.rows = rows, w.transfer.channels = channels,
  w.transfer.receivers = receivers, w.transfer.precision = precision;
  auto memory = std::make_shared<AlignedVector<uint8_t>>(w.transfer.bytes());
  w.values = memory->data();
  w.transfer.data = *memory;
  w.transfer.storage = std::move(memory);
  return w;
}

void store_receiver(const WritableTransfer& w, size_t receiver, std::span<const float> values) {
  LAMBENT_CHECK(receiver < w.transfer.receivers && values.size() == w.transfer.receiver_values());
  store_values(w.values, w.transfer.precision, receiver, values);
}

std::vector<float> load_receiver(const Transfer& t, size_t receiver) {
  LAMBENT_CHECK(receiver < t.receivers);
  std::vector<float> values(t.receiver_values());
  load_values(t.data.data(), t.precision, receiver, values);
  return values;
}

}  // namespace lambent

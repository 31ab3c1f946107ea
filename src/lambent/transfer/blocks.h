#pragma once
// Values of receivers in blocks of 16, [block][value][receiver in block]: the layout of everything that is stored at
// receivers.
#include <lambent/core/half.h>
#include <lambent/transfer/transfer.h>

#include <cstring>

namespace lambent {

inline void store_values(uint8_t* data, Precision precision, size_t receiver, std::span<const float> values) {
  size_t at = receiver / transfer_block * values.size() * transfer_block + receiver % transfer_block;
  for (float v : values) {
    if (precision == Precision::half) {
      const uint16_t h = float_to_half(v);
      std::memcpy(data + 2 * at, &h, 2);
    } else {
      std::memcpy(data + 4 * at, &v, 4);
    }
    at += transfer_block;
  }
}

inline void load_values(const uint8_t* data, Precision precision, size_t receiver, std::span<float> values) {
  size_t at = receiver / transfer_block * values.size() * transfer_block + receiver % transfer_block;
  for (float& v : values) {
    if (precision == Precision::half) {
      uint16_t h;
      std::memcpy(&h, data + 2 * at, 2);
      v = half_to_float(h);
    } else {
      std::memcpy(&v, data + 4 * at, 4);
    }
    at += transfer_block;
  }
}

}  // namespace lambent

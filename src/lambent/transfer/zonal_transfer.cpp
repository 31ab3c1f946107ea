#include <lambent/basis/zonal.h>
#include <lambent/core/check.h>
#include <lambent/transfer/blocks.h>
#include <lambent/transfer/zonal_transfer.h>

namespace lambent {

WritableZonalTransfer make_zonal_transfer(int order, int lobes, int channels, size_t receivers, Precision precision,
                                          int rows) {
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order && lobes >= 1 && lobes <= max_stored_lobes &&
                (channels == 1 || channels == 3) && rows >= 1);
  WritableZonalTransfer w;
  w.transfer.order = order, w.transfer.lobes = lobes, w.transfer.channels = channels;
  w.transfer.receivers = receivers, w.transfer.precision = precision, w.transfer.rows = rows;
  auto memory = std::make_shared<AlignedVector<uint8_t>>(w.transfer.bytes());
  w.values = memory->data();
  w.transfer.data = *memory;
  w.transfer.storage = std::move(memory);
  return w;
}

void store_receiver(const WritableZonalTransfer& w, size_t receiver, std::span<const float> values) {
  LAMBENT_CHECK(receiver < w.transfer.receivers && values.size() == w.transfer.receiver_values());
  store_values(w.values, w.transfer.precision, receiver, values);
}

std::vector<float> load_receiver(const ZonalTransfer& t, size_t receiver) {
  LAMBENT_CHECK(receiver < t.receivers);
  std::vector<float> values(t.receiver_values());
  load_values(t.data.data(), t.precision, receiver, values);
  return values;
}

Vec3 lobe_axis(const ZonalTransfer& t, std::span<const float> values, int lobe) {
  const float* a = values.data() + t.exact_values() + size_t(lobe) * t.lobe_values();
  return normalize_or({a[0], a[1], a[2]}, {0, 0, 1});
}

std::vector<float> zonal_harmonics(const ZonalTransfer& t, std::span<const float> values, const Mat3& R) {
  LAMBENT_CHECK(values.size() == t.row_values());
  const size_t C = size_t(sh_count(t.order)), exact = size_t(t.exact_bands()), exact_count = exact * exact,
               bands = size_t(t.order) - exact;
  std::vector<float> sh(size_t(t.channels) * C, 0.0f);
  for (size_t c = 0; c < size_t(t.channels); ++c) {
    const float* from = values.data() + c * exact_count;
    float* to = sh.data() + c * C;
    to[0] = from[0];
    if (exact == 2) {
      const Vec3 v = R * Vec3(-from[3], -from[1], from[2]);
      to[1] = -v.y, to[2] = v.z, to[3] = -v.x;
    }
  }
  float y[sh_count(max_sh_order)];
  for (int i = 0; i < t.lobes; ++i) {
    evaluate_sh(t.order, normalize(R * lobe_axis(t, values, i)), y);
    const float* g = values.data() + t.exact_values() + size_t(i) * t.lobe_values() + 3;
    for (size_t c = 0; c < size_t(t.channels); ++c)
      for (size_t l = exact; l < size_t(t.order); ++l)
        for (size_t k = l * l; k < (l + 1) * (l + 1); ++k) sh[c * C + k] += g[c * bands + l - exact] * y[k];
  }
  return sh;
}

}  // namespace lambent

#include <lambent/core/parallel.h>
#include <lambent/relight/fix_light.h>

namespace lambent {

Transfer fix_light(const Transfer& transfer, std::span<const Vec3> light, const std::string& name) {
  Relit relit;
  relight(transfer, light, relit);
  WritableTransfer out = make_transfer({.groups = {name}}, transfer.rows, 3, transfer.receivers, transfer.precision);
  parallel_for(transfer.receivers, 1024, [&](size_t begin, size_t end) {
    std::vector<float> values(out.transfer.receiver_values());
    for (size_t r = begin; r < end; ++r) {
      for (int row = 0; row < transfer.rows; ++row)
        for (int c = 0; c < 3; ++c) values[size_t(3 * row + c)] = relit.at(r, row)[c];
      store_receiver(out, r, values);
    }
  });
  return out.transfer;
}

}  // namespace lambent

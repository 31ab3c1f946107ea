// Follows: local-deformable-prt, section 4.2.
#include <lambent/basis/zonal.h>
#include <lambent/compress/parametric.h>
#include <lambent/core/check.h>

namespace lambent {

ZonalTransfer membrane_transfer(int order, std::span<const Vec3> normals, std::span<const float> alphas,
                                Precision precision) {
  LAMBENT_CHECK(normals.size() == alphas.size());
  WritableZonalTransfer out = make_zonal_transfer(order, 1, 1, normals.size(), precision);
  std::vector<float> values(out.transfer.receiver_values());
  for (size_t r = 0; r < normals.size(); ++r) {
    const std::vector<double> lobe = membrane_lobe(order, alphas[r]);
    values[0] = float(lobe[0] * std::sqrt(band_energy(0)));  // y_00 is the same everywhere
    for (int k = 0; k < 3; ++k) values[size_t(1 + k)] = normals[r][k];
    for (size_t l = 1; l < lobe.size(); ++l) values[3 + l] = float(lobe[l]);
    store_receiver(out, r, values);
  }
  return std::move(out.transfer);
}

}  // namespace lambent

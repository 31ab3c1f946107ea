// Follows: triple-product-integrals; general-prt, "Triple product integrals".
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh_product.h>
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/factors.h>

namespace lambent {

void relight_factors(const Transfer& visibility, const Outgoing& outgoing, std::span<const Vec3> light, Relit& out) {
  const int m = outgoing.order, n = visibility.light.order - m + 1;
  LAMBENT_CHECK(outgoing.kind == OutgoingKind::map && visibility.channels == 1 && visibility.rows == 1 && n >= 1);
  LAMBENT_CHECK(visibility.columns() == size_t(sh_count(n + m - 1)) && light.size() >= size_t(sh_count(n)) &&
                outgoing.frames.size() == visibility.receivers);
  const size_t J = size_t(sh_count(m)), K = visibility.columns();
  const CosineBasis basis = make_cosine_basis(m);
  // product[c][j][k] = sum_i C_ijk L_i
  const TriplingTensor tensor = make_tripling_tensor(n, m, n + m - 1);
  std::vector<float> product(3 * J * K, 0.0f);
  for (size_t k = 0; k < K; ++k)
    for (uint32_t e = tensor.begin[k]; e < tensor.begin[k + 1]; ++e)
      for (size_t c = 0; c < 3; ++c)
        product[(c * J + tensor.j[e]) * K + k] += tensor.single[e] * light[tensor.i[e]][int(c)];

  out.rows = int(J);
  out.values.assign((visibility.receivers + transfer_block - 1) / transfer_block * J * 3 * transfer_block, 0.0f);
  parallel_for(visibility.receivers, transfer_block, [&](size_t begin, size_t end) {
    std::vector<Vec3> incident(J);
    for (size_t r = begin; r < end; ++r) {
      const std::vector<float> V = load_receiver(visibility, r);
      for (size_t j = 0; j < J; ++j)
        for (size_t c = 0; c < 3; ++c) {
          const float* p = product.data() + (c * J + j) * K;
          float sum = 0;
          for (size_t k = 0; k < K; ++k) sum += p[k] * V[k];
          incident[j][int(c)] = sum;
        }
      // Into the receiver's frame, and from harmonics to the incident basis.
      incident = rotate_sh(make_sh_rotation(m, transpose(outgoing.frames[r])), incident);
      for (size_t j = 0; j < J; ++j) {
        Vec3 sum(0.0f);
        for (size_t k = 0; k <= j; ++k) sum += float(basis.from_sh[j * J + k]) * incident[k];
        out.set(r, int(j), sum);
      }
    }
  });
}

}  // namespace lambent

// Follows: triple-product-integrals; general-prt, "Triple product integrals".
#include <lambent/basis/sh.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/factors.h>
#include <lambent/transfer/blocks.h>

namespace lambent {

void set_light(FactorLight& out, int light_order, int incident_order, std::span<const Vec3> light) {
  LAMBENT_CHECK(light.size() >= size_t(sh_count(light_order)));
  const int order = light_order + incident_order - 1;
  if (out.basis.order != incident_order || out.tensor.order_a != light_order) {
    out.basis = make_cosine_basis(incident_order);
    out.tensor = make_tripling_tensor(light_order, incident_order, order);
  }
  const TriplingTensor& t = out.tensor;
  const size_t J = size_t(sh_count(incident_order)), K = size_t(sh_count(order));
  out.product.assign(3 * J * K, 0.0f);
  for (size_t k = 0; k < K; ++k)
    for (uint32_t e = t.begin[k]; e < t.begin[k + 1]; ++e)
      for (size_t c = 0; c < 3; ++c) out.product[(c * J + t.j[e]) * K + k] += t.single[e] * light[t.i[e]][c];
}

void relight_factors(const Transfer& visibility, const Outgoing& outgoing, const FactorLight& light, Relit& out) {
  const int m = outgoing.order;
  LAMBENT_CHECK(outgoing.kind == OutgoingKind::map && visibility.channels == 1 && visibility.rows == 1);
  LAMBENT_CHECK(light.basis.order == m && light.tensor.order_c == visibility.light.order &&
                outgoing.frames.size() == visibility.receivers);
  const size_t J = size_t(sh_count(m)), K = visibility.columns();
  out.rows = int(J);
  out.values.resize(visibility.blocks() * J * 3 * transfer_block);
  parallel_for(visibility.receivers, transfer_block, [&](size_t begin, size_t end) {
    float V[sh_count(max_sh_order)];
    Vec3 incident[sh_count(max_incident_order)];
    for (size_t r = begin; r < end; ++r) {
      load_values(visibility.data.data(), visibility.precision, r, {V, K});
      for (size_t j = 0; j < J; ++j)
        for (size_t c = 0; c < 3; ++c) {
          const float* p = light.product.data() + (c * J + j) * K;
          float sum = 0;
          for (size_t k = 0; k < K; ++k) sum += p[k] * V[k];
          incident[j][c] = sum;
        }
      // Into the receiver's frame, and from harmonics to the incident basis.
      rotate_sh_zyz(transpose(outgoing.frames[r]), {incident, J}, {incident, J});
      for (size_t j = 0; j < J; ++j) {
        Vec3 sum(0.0f);
        for (size_t k = 0; k <= j; ++k) sum += float(light.basis.from_sh[j * J + k]) * incident[k];
        out.set(r, int(j), sum);
      }
    }
  });
}

void relight_factors(const Transfer& visibility, const Outgoing& outgoing, std::span<const Vec3> light, Relit& out) {
  FactorLight factors;
  set_light(factors, visibility.light.order - outgoing.order + 1, outgoing.order, light);
  relight_factors(visibility, outgoing, factors, out);
}

}  // namespace lambent

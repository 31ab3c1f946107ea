// evaluate_sh. Follows: P.-P. Sloan, "Stupid spherical harmonics tricks" (2008) and "Efficient spherical harmonic
// evaluation" (2013); normalised Legendre recurrences as in any text on geodesy, with sin^m(theta) cos/sin(m phi) taken
// from powers of (x + iy) so that no angle is computed. One direction is unrolled by the compiler for each order
// (sh_fixed.h); many are a lane each. Both do the same roundings in the same order as the recurrence written as a loop,
// so that all give the same bits: built without contraction to fused multiply-adds (CMakeLists.txt).
#include <lambent/basis/sh_fixed.h>
#include <lambent/core/check.h>

#include <array>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_evaluate.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using V = hn::Vec<F>;

// One vector of directions; harmonic k goes to out[k * stride].
template <int fixed>
HWY_INLINE void EvaluateLanes(int order, V x, V y, V z, size_t stride, float* HWY_RESTRICT out) {
  const F d;
  if (fixed) order = fixed;
  auto harmonic = [&](int l, int m) { return out + size_t(sh_index(l, m)) * stride; };
  V c = x, s = y;
  for (int m = 0; m < order; ++m) {
    V q1 = hn::Set(d, sh_tables_rounded<float>.diagonal[m]), q2 = hn::Zero(d);
    for (int l = m; l < order; ++l) {
      if (l > m) {
        const V q = hn::Add(hn::Mul(hn::Mul(z, hn::Set(d, sh_tables_rounded<float>.a[l][m])), q1),
                            hn::Mul(hn::Set(d, sh_tables_rounded<float>.b[l][m]), q2));
        q2 = q1, q1 = q;
      }
      if (m == 0) {
        hn::StoreU(q1, d, harmonic(l, 0));
      } else {
        hn::StoreU(hn::Mul(q1, c), d, harmonic(l, m));
        hn::StoreU(hn::Mul(q1, s), d, harmonic(l, -m));
      }
    }
    if (m == 0) continue;
    const V next = hn::Sub(hn::Mul(c, x), hn::Mul(s, y));
    s = hn::Add(hn::Mul(c, y), hn::Mul(s, x)), c = next;
  }
}

template <int fixed>
void EvaluateMany(int order, size_t count, const float* x, const float* y, const float* z, size_t stride, float* out) {
  const F d;
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    EvaluateLanes<fixed>(order, hn::LoadU(d, x + i), hn::LoadU(d, y + i), hn::LoadU(d, z + i), stride, out + i);
  if (i == count) return;
  const size_t rest = count - i;
  constexpr size_t most = HWY_MAX_BYTES / sizeof(float);
  HWY_ALIGN float in[3 * most] = {}, values[sh_count(max_sh_order) * most];
  for (size_t k = 0; k < rest; ++k) in[k] = x[i + k], in[lanes + k] = y[i + k], in[2 * lanes + k] = z[i + k];
  EvaluateLanes<fixed>(order, hn::LoadU(d, in), hn::LoadU(d, in + lanes), hn::LoadU(d, in + 2 * lanes), lanes, values);
  for (size_t k = 0; k < size_t(sh_count(fixed ? fixed : order)); ++k)
    std::copy(values + k * lanes, values + k * lanes + rest, out + k * stride + i);
}

void EvaluateSh(int order, size_t count, const float* x, const float* y, const float* z, size_t stride, float* out) {
  switch (order) {
    case 2: return EvaluateMany<2>(order, count, x, y, z, stride, out);
    case 3: return EvaluateMany<3>(order, count, x, y, z, stride, out);
    case 4: return EvaluateMany<4>(order, count, x, y, z, stride, out);
    case 5: return EvaluateMany<5>(order, count, x, y, z, stride, out);
    case 6: return EvaluateMany<6>(order, count, x, y, z, stride, out);
    default: return EvaluateMany<0>(order, count, x, y, z, stride, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(EvaluateSh);

template <class T, int order>
void evaluate_sh_of_order(T x, T y, T z, T* out) {
  sh_fixed::evaluate<order>(x, y, z, out);
}

template <class T>
using EvaluateOrder = void (*)(T x, T y, T z, T* out);
template <class T, int... orders>
constexpr auto all_orders(std::integer_sequence<int, orders...>) {
  return std::array<EvaluateOrder<T>, sizeof...(orders)>{evaluate_sh_of_order<T, orders>...};
}

template <class T>
void evaluate(int order, Vector<T, 3> d, std::span<T> out) {
  static constexpr auto kernels = all_orders<T>(std::make_integer_sequence<int, max_sh_order + 1>());
  LAMBENT_CHECK(size_t(order) < kernels.size() && out.size() >= size_t(sh_count(order)));
  return kernels[size_t(order)](d.x, d.y, d.z, out.data());
}

}  // namespace

void evaluate_sh(int order, Vec3 d, std::span<float> out) { evaluate<float>(order, d, out); }
void evaluate_sh(int order, Vec3d d, std::span<double> out) { evaluate<double>(order, d, out); }

void evaluate_sh(int order, std::span<const float> x, std::span<const float> y, std::span<const float> z, size_t stride,
                 std::span<float> out) {
  const size_t count = x.size();
  LAMBENT_CHECK(order >= 0 && order <= max_sh_order && y.size() == count && z.size() == count && stride >= count);
  if (order == 0 || count == 0) return;
  LAMBENT_CHECK(out.size() >= size_t(sh_count(order) - 1) * stride + count);
  HWY_DYNAMIC_DISPATCH(EvaluateSh)(order, count, x.data(), y.data(), z.data(), stride, out.data());
}

}  // namespace lambent
#endif

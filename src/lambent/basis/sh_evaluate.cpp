// evaluate_sh. Follows: P.-P. Sloan, "Stupid spherical harmonics tricks" (2008) and "Efficient spherical harmonic
// evaluation" (2013); normalised Legendre recurrences as in any text on geodesy, with sin^m(theta) cos/sin(m phi) taken
// from powers of (x + iy) so that no angle is computed. One direction is unrolled by the compiler for each order; many
// are a lane each. Both do the same roundings in the same order as the recurrence written as a loop, so that all give
// the same bits: built without contraction to fused multiply-adds (CMakeLists.txt).
#include <lambent/basis/sh_tables.h>
#include <lambent/core/check.h>

#include <array>
#include <cstring>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_evaluate.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef LAMBENT_SH_EVALUATE
#define LAMBENT_SH_EVALUATE
namespace lambent {
namespace {

template <class T>
constexpr ShTablesOf<T> rounded_tables() {
  ShTablesOf<T> t;
  for (int l = 0; l < max_sh_order; ++l) {
    t.diagonal[l] = T(sh_tables_exact.diagonal[l]);
    for (int m = 0; m < l; ++m) t.a[l][m] = T(sh_tables_exact.a[l][m]), t.b[l][m] = T(sh_tables_exact.b[l][m]);
  }
  return t;
}
template <class T>
inline constexpr ShTablesOf<T> tables = rounded_tables<T>();

}  // namespace
}  // namespace lambent
#endif

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
    V q1 = hn::Set(d, tables<float>.diagonal[m]), q2 = hn::Zero(d);
    for (int l = m; l < order; ++l) {
      if (l > m) {
        const V q = hn::Add(hn::Mul(hn::Mul(z, hn::Set(d, tables<float>.a[l][m])), q1),
                            hn::Mul(hn::Set(d, tables<float>.b[l][m]), q2));
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

// Harmonics of +-m and bands l and up.
template <int order, int m, int l, class T>
[[gnu::always_inline]] inline void bands(T z, T c, T s, T q1, T q2, T* __restrict out) {
  if constexpr (l < order) {
    T q;
    if constexpr (l == m) q = tables<T>.diagonal[m];
    else if constexpr (l == m + 1) q = z * tables<T>.a[l][m] * q1 + T(0);  // the loop's 0 q2, for the sign of a zero
    else q = z * tables<T>.a[l][m] * q1 + tables<T>.b[l][m] * q2;
    out[sh_index(l, m)] = m > 0 ? q * c : q;
    if constexpr (m > 0) out[sh_index(l, -m)] = q * s;
    bands<order, m, l + 1>(z, c, s, q, q1, out);
  }
}

// c + i s is (x + iy)^m.
template <int order, int m, class T>
[[gnu::always_inline]] inline void frequencies(T x, T y, T z, T c, T s, T* __restrict out) {
  if constexpr (m < order) {
    bands<order, m, m>(z, c, s, T(0), T(0), out);
    if constexpr (m == 0) frequencies<order, 1>(x, y, z, x, y, out);
    else frequencies<order, m + 1>(x, y, z, c * x - s * y, c * y + s * x, out);
  }
}

// Four floats, as every target has them: choosing a wider vector at run time would take as long as it saves.
typedef float Four __attribute__((vector_size(16)));
typedef int32_t FourBits __attribute__((vector_size(16)));
constexpr float factor(const float (&table)[max_sh_order][max_sh_order], int l, int m) {
  return m < l ? table[l][m] : 0;
}

// Bands l and up of frequencies 0 .. 3, side by side. Lanes of frequencies above l are +0 until their band comes. What
// band 2 stores beyond itself is overwritten by band 3 and by whoever calls.
template <int order, int l>
[[gnu::always_inline]] inline void four_frequencies(Four z, Four c, Four s, Four q1, Four q2, float* __restrict out) {
  if constexpr (l < order) {
    constexpr auto& t = tables<float>;
    constexpr Four a = {factor(t.a, l, 0), factor(t.a, l, 1), factor(t.a, l, 2), factor(t.a, l, 3)};
    constexpr Four b = {factor(t.b, l, 0), factor(t.b, l, 1), factor(t.b, l, 2), factor(t.b, l, 3)};
    Four q = z * a * q1 + b * q2;
    if constexpr (l < 4) {
      constexpr Four first = {0, l == 1 ? t.diagonal[1] : 0, l == 2 ? t.diagonal[2] : 0, l == 3 ? t.diagonal[3] : 0};
      q = (Four)((FourBits)q | (FourBits)first);
    }
    if constexpr (l == 1) {
      out[2] = q[0];
    } else {
      const Four cosines = q * c, sines = q * s, backwards = {sines[3], sines[2], sines[1], sines[0]};
      std::memcpy(out + sh_index(l, -3), &backwards, sizeof backwards);
      std::memcpy(out + sh_index(l, 0), &cosines, sizeof cosines);
    }
    four_frequencies<order, l + 1>(z, c, s, q, q1, out);
  }
}

template <class T, int order>
void evaluate_order(T x, T y, T z, T* out) {
  if constexpr (order < 4 || sizeof(T) > sizeof(float)) {
    frequencies<order, 0>(x, y, z, T(1), T(0), out);
  } else {
    const float c2 = x * x - y * y, s2 = x * y + y * x, c3 = c2 * x - s2 * y, s3 = c2 * y + s2 * x;
    const Four c = {1, x, c2, c3}, s = {0, y, s2, s3}, q0 = {tables<T>.diagonal[0]};
    four_frequencies<order, 1>(Four{z, z, z, z}, c, s, q0, Four{}, out);
    const float linear = tables<T>.diagonal[1];
    out[0] = tables<T>.diagonal[0], out[1] = linear * y, out[3] = linear * x;
    frequencies<order, 4>(x, y, z, c3 * x - s3 * y, c3 * y + s3 * x, out);
  }
}

template <class T>
using EvaluateOrder = void (*)(T x, T y, T z, T* out);
template <class T, int... orders>
constexpr auto all_orders(std::integer_sequence<int, orders...>) {
  return std::array<EvaluateOrder<T>, sizeof...(orders)>{evaluate_order<T, orders>...};
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

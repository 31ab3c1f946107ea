// Value i of an array in vectors of at most 8 lanes, in every lane; no detour through memory, whose stores are read
// back late. For files compiled once a SIMD target.
#if defined(LAMBENT_BASIS_EVERYWHERE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef LAMBENT_BASIS_EVERYWHERE_INL_H
#undef LAMBENT_BASIS_EVERYWHERE_INL_H
#else
#define LAMBENT_BASIS_EVERYWHERE_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <size_t i, class D>
HWY_INLINE hn::Vec<D> Everywhere(D d, const hn::Vec<D>* v) {
#if HWY_TARGET == HWY_SCALAR
  return (void)d, v[i];
#else
  if constexpr (hn::MaxLanes(D()) == 4) return hn::Broadcast<i % 4>(v[i / 4]);
  else if constexpr (i % 8 < 4) return hn::Broadcast<i % 4>(hn::ConcatLowerLower(d, v[i / 8], v[i / 8]));
  else return hn::Broadcast<i % 4>(hn::ConcatUpperUpper(d, v[i / 8], v[i / 8]));
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#endif

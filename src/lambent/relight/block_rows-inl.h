// Rows of twelve numbers in SIMD lanes, included once for each target (Highway's way).
#if defined(LAMBENT_BLOCK_ROWS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LAMBENT_BLOCK_ROWS_INL_H_
#undef LAMBENT_BLOCK_ROWS_INL_H_
#else
#define LAMBENT_BLOCK_ROWS_INL_H_
#endif

#include <lambent/relight/product_lobes-inl.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {

constexpr size_t lanes = hn::MaxLanes(F());
// A row of sums: one vector where there are 16 lanes, of which the last four are 0.
using R = hn::CappedTag<float, lanes == 16 ? 16 : 4>;
constexpr size_t row_lanes = hn::MaxLanes(R()), row_parts = (12 + row_lanes - 1) / row_lanes;

struct Row {
  hn::Vec<R> v[row_parts];
};
HWY_INLINE Row ZeroRow() {
  Row r;
  for (auto& v : r.v) v = hn::Zero(R());
  return r;
}
HWY_INLINE Row LoadRow(const float* p) {
  Row r;
  for (size_t i = 0; i < row_parts; ++i) r.v[i] = hn::LoadU(R(), p + i * row_lanes);
  return r;
}
HWY_INLINE void AddRow(Row& to, const Row& a) {
  for (size_t i = 0; i < row_parts; ++i) to.v[i] = hn::Add(to.v[i], a.v[i]);
}
HWY_INLINE void AddDifference(Row& to, const float* a, const float* b) {
  for (size_t i = 0; i < row_parts; ++i)
    to.v[i] = hn::Add(to.v[i], hn::Sub(hn::LoadU(R(), a + i * row_lanes), hn::LoadU(R(), b + i * row_lanes)));
}
HWY_INLINE void AddTimes(Row& to, float scale, const Row& a) {
  for (size_t i = 0; i < row_parts; ++i) to.v[i] = hn::MulAdd(hn::Set(R(), scale), a.v[i], to.v[i]);
}
HWY_INLINE Vec3 Contract(const Row& row, Vec3 n) {
  alignas(64) float m[row_parts * row_lanes];
  for (size_t i = 0; i < row_parts; ++i) hn::Store(row.v[i], R(), m + i * row_lanes);
  return n.x * Vec3(m[0], m[1], m[2]) + n.y * Vec3(m[4], m[5], m[6]) + n.z * Vec3(m[8], m[9], m[10]);
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();
#endif

// Lobes at the nodes of a block, how many of them it takes, and what lies between: included once for each target
// (Highway's way).
#if defined(LAMBENT_BLOCK_NODES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LAMBENT_BLOCK_NODES_INL_H_
#undef LAMBENT_BLOCK_NODES_INL_H_
#else
#define LAMBENT_BLOCK_NODES_INL_H_
#endif

#include <lambent/relight/block_kernels.h>
#include <lambent/relight/block_rows-inl.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {

// Of the tolerance, what values at 64 nodes may miss at the places that are looked at.
constexpr float fine_share = 0.5f;

// What follows is called and not inlined: a block takes hundreds of nanoseconds, and the copies of eight lobes, five
// targets and as many callers take the compiler minutes.

// s_k at `nodes` (16 or 64) nodes of a block, [k][nodes].
template <class Lobe>
HWY_NOINLINE void AtNodes(const Lobe& lobe, size_t nodes, const float* x, const float* y, const float* z, float* out) {
  const F d;
  for (size_t i = 0; i < nodes; i += lanes) {
    V s[Lobe::count];
    lobe(hn::LoadU(d, x + i), hn::LoadU(d, y + i), hn::LoadU(d, z + i), s);
    for (size_t k = 0; k < size_t(Lobe::count); ++k) hn::Store(s[k], d, out + nodes * k + i);
  }
}
template <class Lobe>
void AtNodes(const Lobe& lobe, size_t nodes, const DirectionArray& at, size_t b, float* out) {
  AtNodes(lobe, nodes, &at.x[nodes * b], &at.y[nodes * b], &at.z[nodes * b], out);
}

// The same of the 4 or 16 nodes of a block's class, those of 4 and others.
template <class Lobe>
void AtBlockNodes(const Lobe& lobe, const Cube& cube, int samples, size_t b, float* out) {
  const DirectionArray& nodes = cube.nodes[size_t(samples - 1)];
  if (samples == 3) return AtNodes(lobe, 16, nodes, b, out);
  alignas(64) float at[3][16];
  for (size_t i = 0; i < 16; ++i) {
    const size_t j = 4 * b + std::min<size_t>(i, 3);
    at[0][i] = nodes.x[j], at[1][i] = nodes.y[j], at[2][i] = nodes.z[j];
  }
  AtNodes(lobe, 16, at[0], at[1], at[2], out);
}

// Nodes of a block at which the lobe is known.
struct Known {
  bool nodes = false, fine = false;  // 16, 64
};

// The lobe at the nodes of a block's class, where that has any and they are not known.
template <class Lobe>
void AtKnownNodes(const Lobe& lobe, BlockScratch& s, const Cube& cube, int samples, size_t b, Known known) {
  if (samples == 4 && !known.fine) AtNodes(lobe, 64, cube.nodes[3], b, s.fine);
  if ((samples == 2 || samples == 3) && !(known.nodes && samples == 3)) AtBlockNodes(lobe, cube, samples, b, s.nodes);
}

// How many samples a lobe of which values alone are known wants of a block (1: one, 3: 16, 4: more), from those at 16
// nodes and at its middle: one where they are alike, 16 where those give the middle's value back.
template <int count>
HWY_NOINLINE int ClassByValues(const float* weights, const ProductMaterial& m, const BlockLight& light,
                               const float* nodes, const float* middle, size_t stride) {
  const F d;
  auto value_at = [&](size_t i) HWY_ATTR {
    V value = hn::Mul(Fill(weights[0]), hn::Load(d, nodes + i));
    for (int k = 1; k < count; ++k) value = hn::MulAdd(Fill(weights[k]), hn::Load(d, nodes + 16 * k + i), value);
    return value;
  };
  float centre = 0;
  for (int k = 0; k < count; ++k) centre += weights[k] * middle[size_t(k) * stride];
  V least = Fill(centre), most = least;
  for (size_t i = 0; i < 16; i += lanes) {
    const V value = value_at(i);
    least = hn::Min(least, value), most = hn::Max(most, value);
  }
  const float high = hn::GetLane(hn::MaxOfLanes(d, most));
  if (pi * high < m.tolerance) return 1;
  const float low = hn::GetLane(hn::MinOfLanes(d, least));
  if (pi * (high - low) < m.tolerance) return 1;
  if (high >= 2 * low) return 4;
  V back = hn::Zero(d);
  for (size_t i = 0; i < 16; i += lanes)
    back = hn::MulAdd(value_at(i), hn::LoadU(d, light.middle_weights.data() + i), back);
  return pi * std::abs(hn::GetLane(hn::SumOfLanes(d, back)) - centre) < 0.25f * m.tolerance ? 3 : 4;
}

// Whether values at 64 nodes give back those at the 16, which lie between them.
template <int count>
HWY_NOINLINE bool IsFineEnough(const float* weights, const ProductMaterial& m, const BlockLight& light,
                               const float* fine, const float* nodes) {
  const F d;
  V most = hn::Zero(d);
  for (size_t i = 0; i < 16; i += lanes) {
    V off = hn::Zero(d);
    for (size_t k = 0; k < size_t(count); ++k) {
      V first = hn::Neg(hn::Load(d, nodes + 16 * k + i)), second = hn::Zero(d), third = second, fourth = second;
      const float *value = fine + 64 * k, *weight = light.between.data() + i;
      for (const float* end = value + 64; value < end; value += 4, weight += 64) {
        first = hn::MulAdd(Fill(value[0]), hn::Load(d, weight), first);
        second = hn::MulAdd(Fill(value[1]), hn::Load(d, weight + 16), second);
        third = hn::MulAdd(Fill(value[2]), hn::Load(d, weight + 32), third);
        fourth = hn::MulAdd(Fill(value[3]), hn::Load(d, weight + 48), fourth);
      }
      off = hn::MulAdd(Fill(weights[k]), hn::Add(hn::Add(first, second), hn::Add(third, fourth)), off);
    }
    most = hn::Max(most, hn::Abs(off));
  }
  return pi * hn::GetLane(hn::MaxOfLanes(d, most)) < fine_share * m.tolerance;
}

// s_k of a block by interpolation between its nodes.
template <int count, int side>
struct Interpolated {
  const float *along, *cardinal;  // [k][node column][row], [node column][column]
  HWY_INLINE void operator()(size_t row, size_t column, V, V, V, V* s) const {
    const F d;
    for (int k = 0; k < count; ++k) {
      const float* a = along + 16 * side * k + row;
      s[k] = hn::Mul(Fill(a[0]), hn::LoadU(d, cardinal + column));
      for (int i = 1; i < side; ++i) s[k] = hn::MulAdd(Fill(a[16 * i]), hn::LoadU(d, cardinal + 16 * i + column), s[k]);
    }
  }
};
// Nodes of a term are `stride` apart.
template <int count, int side>
Interpolated<count, side> Interpolate(const float* nodes, int stride, const float* cardinal, float* along) {
  const F d;
  for (int k = 0; k < count; ++k)
    for (int i = 0; i < side; ++i)
      for (size_t row = 0; row < size_t(block_side); row += lanes) {
        V sum = hn::Zero(d);
        for (int j = 0; j < side; ++j)
          sum = hn::MulAdd(Fill(nodes[stride * k + j * side + i]), hn::LoadU(d, cardinal + 16 * size_t(j) + row), sum);
        hn::Store(sum, d, along + 16 * (side * k + i) + row);
      }
  return {along, cardinal};
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();
#endif

// Follows: general-prt, "Clustered PCA": light times the clusters' vectors once a frame, then `rank` products a row and
// receiver.
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/block_runs.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/relight_cpca.cpp"
#include <hwy/foreach_target.h>
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// lit is [cluster][1 + rank][padded]; receivers [first, first + count) of one block of the output, which is
// [value][transfer_block]. Values go in tiles, so that a block of them fits the stack.
void RelightBlock(const CpcaTransfer& t, const float* lit, size_t padded, size_t first, size_t count, float* out) {
  constexpr size_t tile = 256;
  alignas(64) float own[transfer_block * tile];
  const hn::CappedTag<float, 16> d;
  const size_t rank = size_t(t.rank), all = 3 * size_t(t.rows), N = hn::Lanes(d);
  std::fill(own + count * tile, own + transfer_block * tile, 0.0f);
  float weights[transfer_block][max_cpca_rank];
  for (size_t i = 0; i < count; ++i)
    for (size_t k = 0; k < rank; ++k) weights[i][k] = half_to_float(t.weights[(first + i) * rank + k]);
  for (size_t at = 0; at < padded; at += tile, out += tile * transfer_block) {
    const size_t width = std::min(tile, padded - at), each = std::min(tile, all - at);
    for (size_t i = 0; i < count; ++i) {
      const float* mean = lit + size_t(t.cluster_of[first + i]) * (1 + rank) * padded + at;
      size_t e = 0;  // four sums at a time hide the latency of adding
      for (; e + 4 * N <= width; e += 4 * N) {
        const float* L = mean + e;
        auto s0 = hn::Load(d, L), s1 = hn::Load(d, L + N), s2 = hn::Load(d, L + 2 * N), s3 = hn::Load(d, L + 3 * N);
        for (size_t k = 0; k < rank; ++k) {
          const auto w = hn::Set(d, weights[i][k]);
          L += padded;
          s0 = hn::MulAdd(w, hn::Load(d, L), s0), s1 = hn::MulAdd(w, hn::Load(d, L + N), s1);
          s2 = hn::MulAdd(w, hn::Load(d, L + 2 * N), s2), s3 = hn::MulAdd(w, hn::Load(d, L + 3 * N), s3);
        }
        float* o = own + i * tile + e;
        hn::Store(s0, d, o), hn::Store(s1, d, o + N), hn::Store(s2, d, o + 2 * N), hn::Store(s3, d, o + 3 * N);
      }
      for (; e < width; e += N) {
        const float* L = mean + e;
        auto sum = hn::Load(d, L);
        for (size_t k = 0; k < rank; ++k) sum = hn::MulAdd(hn::Set(d, weights[i][k]), hn::Load(d, L += padded), sum);
        hn::Store(sum, d, own + i * tile + e);
      }
    }
    // Receivers become lanes, by squares of four.
#if HWY_TARGET == HWY_SCALAR
    for (size_t e = 0; e < each; ++e)
      for (size_t i = 0; i < transfer_block; ++i) out[e * transfer_block + i] = own[i * tile + e];
#else
    const hn::FixedTag<float, 4> d4;
    for (size_t e = 0; e < each; e += 4)
      for (size_t i = 0; i < transfer_block; i += 4) {
        const float* p = own + i * tile + e;
        const auto a = hn::Load(d4, p), b = hn::Load(d4, p + tile), c = hn::Load(d4, p + 2 * tile),
                   f = hn::Load(d4, p + 3 * tile);
        const auto ac0 = hn::InterleaveLower(d4, a, c), bf0 = hn::InterleaveLower(d4, b, f),
                   ac1 = hn::InterleaveUpper(d4, a, c), bf1 = hn::InterleaveUpper(d4, b, f);
        float* q = out + e * transfer_block + i;
        hn::Stream(hn::InterleaveLower(d4, ac0, bf0), d4, q);
        if (e + 1 < each) hn::Stream(hn::InterleaveUpper(d4, ac0, bf0), d4, q + transfer_block);
        if (e + 2 < each) hn::Stream(hn::InterleaveLower(d4, ac1, bf1), d4, q + 2 * transfer_block);
        if (e + 3 < each) hn::Stream(hn::InterleaveUpper(d4, ac1, bf1), d4, q + 3 * transfer_block);
      }
#endif
  }
  hwy::FlushStream();
}

// Vector v, [row][channel][C], times light, [channel][C], into out[row][r, g, b].
void LightVector(const float* v, size_t rows, size_t channels, size_t C, const float* light, float* out) {
  const hn::CappedTag<float, 16> d;
  const size_t N = hn::Lanes(d);
  for (size_t row = 0; row < rows; ++row, v += channels * C) {
    auto r = hn::Zero(d), g = r, b = r;
    const float *vr = v, *vg = channels == 3 ? v + C : v, *vb = channels == 3 ? v + 2 * C : v;
    size_t k = 0;
    for (; k + N <= C; k += N) {
      r = hn::MulAdd(hn::LoadU(d, vr + k), hn::LoadU(d, light + k), r);
      g = hn::MulAdd(hn::LoadU(d, vg + k), hn::LoadU(d, light + C + k), g);
      b = hn::MulAdd(hn::LoadU(d, vb + k), hn::LoadU(d, light + 2 * C + k), b);
    }
    if (k < C) {
      const auto rest = hn::FirstN(d, C - k);
      r = hn::MulAdd(hn::MaskedLoad(rest, d, vr + k), hn::MaskedLoad(rest, d, light + k), r);
      g = hn::MulAdd(hn::MaskedLoad(rest, d, vg + k), hn::MaskedLoad(rest, d, light + C + k), g);
      b = hn::MulAdd(hn::MaskedLoad(rest, d, vb + k), hn::MaskedLoad(rest, d, light + 2 * C + k), b);
    }
    out[3 * row] = hn::GetLane(hn::SumOfLanes(d, r)), out[3 * row + 1] = hn::GetLane(hn::SumOfLanes(d, g)),
            out[3 * row + 2] = hn::GetLane(hn::SumOfLanes(d, b));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RelightBlock);
HWY_EXPORT(LightVector);

void relight(const CpcaTransfer& t, std::span<const Vec3> light, Relit& out) { relight(t, light, out, nullptr); }

void relight(const CpcaTransfer& t, std::span<const Vec3> light, Relit& out, const BlockRuns* only) {
  const size_t C = t.light.count(), rows = size_t(t.rows), rank = size_t(t.rank), channels = size_t(t.channels);
  LAMBENT_CHECK(light.size() >= C && C <= max_columns && t.cluster_of.size() == t.receivers &&
                t.weights.size() == t.receivers * rank);
  const size_t blocks = (t.receivers + transfer_block - 1) / transfer_block;
  out.rows = t.rows;
  out.values.resize(blocks * rows * 3 * transfer_block);
  // Once a frame: each cluster's vectors times the light, [cluster][1 + rank][row][r, g, b].
  const size_t padded = (3 * rows + 15) / 16 * 16;
  out.scratch.resize(size_t(t.clusters) * (1 + rank) * padded);
  float by_channel[3 * max_columns];
  for (size_t c = 0; c < 3; ++c)
    for (size_t k = 0; k < C; ++k) by_channel[c * C + k] = light[k][c];
  parallel_for(size_t(t.clusters) * (1 + rank), 64, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) HWY_DYNAMIC_DISPATCH(LightVector)
    (t.vectors.data() + v * rows * channels * C, rows, channels, C, by_channel, out.scratch.data() + v * padded);
  });
  parallel_blocks(blocks, 64, only, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) HWY_DYNAMIC_DISPATCH(RelightBlock)
    (t, out.scratch.data(), padded, b * transfer_block, std::min(transfer_block, t.receivers - b * transfer_block),
     out.values.data() + b * rows * 3 * transfer_block);
  });
}

}  // namespace lambent
#endif

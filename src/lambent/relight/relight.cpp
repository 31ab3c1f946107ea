#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/relight.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/relight.cpp"
#include <hwy/foreach_target.h>
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, 16>;

inline auto LoadValues(const F d, const float* p) { return hn::LoadU(d, p); }
inline auto LoadValues(const F d, const hwy::float16_t* p) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<hwy::float16_t, F>(), p));
}

// light is [channel][coefficient]. A block's three sums are kept in registers while its coefficients stream by.
template <class Value, int channels>
void RelightBlocks(const Value* t, size_t blocks, size_t coefficients, const float* light, float* out) {
  const F d;
  constexpr size_t B = 16;
  const size_t lanes = hn::Lanes(d);
  const size_t next_channel = channels == 3 ? coefficients * B : 0;
  for (size_t b = 0; b < blocks; ++b, t += size_t(channels) * coefficients * B, out += 3 * B) {
    for (size_t part = 0; part < B; part += lanes) {
      auto red = hn::Zero(d), green = red, blue = red;
      const Value* p = t + part;
      for (size_t k = 0; k < coefficients; ++k, p += B) {
        const auto r = LoadValues(d, p);
        const auto g = channels == 3 ? LoadValues(d, p + next_channel) : r;
        const auto bl = channels == 3 ? LoadValues(d, p + 2 * next_channel) : r;
        red = hn::MulAdd(r, hn::Set(d, light[k]), red);
        green = hn::MulAdd(g, hn::Set(d, light[coefficients + k]), green);
        blue = hn::MulAdd(bl, hn::Set(d, light[2 * coefficients + k]), blue);
      }
      hn::Stream(red, d, out + part);
      hn::Stream(green, d, out + B + part);
      hn::Stream(blue, d, out + 2 * B + part);
    }
  }
  hwy::FlushStream();
}

void RelightHalf(const uint8_t* t, size_t blocks, size_t coefficients, int channels, const float* light, float* out) {
  const auto* p = reinterpret_cast<const hwy::float16_t*>(t);
  channels == 3 ? RelightBlocks<hwy::float16_t, 3>(p, blocks, coefficients, light, out)
                : RelightBlocks<hwy::float16_t, 1>(p, blocks, coefficients, light, out);
}
void RelightSingle(const uint8_t* t, size_t blocks, size_t coefficients, int channels, const float* light, float* out) {
  const auto* p = reinterpret_cast<const float*>(t);
  channels == 3 ? RelightBlocks<float, 3>(p, blocks, coefficients, light, out)
                : RelightBlocks<float, 1>(p, blocks, coefficients, light, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RelightHalf);
HWY_EXPORT(RelightSingle);

void relight(const Transfer& t, std::span<const Vec3> light, Relit& out) {
  const size_t C = t.coefficients();
  LAMBENT_CHECK(light.size() >= C && C <= 256 && t.data.size() == t.bytes());
  float planar[3 * 256];
  for (size_t k = 0; k < C; ++k)
    for (int c = 0; c < 3; ++c) planar[size_t(c) * C + k] = light[k][c];
  out.values.resize(t.blocks() * 3 * transfer_block);
  const size_t block_bytes = t.block_values() * t.value_bytes();
  const size_t grain = std::max<size_t>(1, (size_t{1} << 20) / block_bytes);
  parallel_for(t.blocks(), grain, [&](size_t begin, size_t end) {
    const uint8_t* data = t.data.data() + begin * block_bytes;
    float* values = out.values.data() + begin * 3 * transfer_block;
    if (t.precision == Precision::half) HWY_DYNAMIC_DISPATCH(RelightHalf)(data, end - begin, C, t.channels, planar, values);
    else HWY_DYNAMIC_DISPATCH(RelightSingle)(data, end - begin, C, t.channels, planar, values);
  });
}

}  // namespace lambent
#endif

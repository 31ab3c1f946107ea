// Follows: local-deformable-prt, sections 3.2 and 5. A block's 16 receivers go side by side where their axes are
// concerned. Table look-ups go one receiver at a time, but a texel's 16 numbers (four bands of three colours) are one
// or a few vectors.
#include <lambent/basis/sh_tables.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/block_runs.h>

#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/zonal.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef LAMBENT_ZONAL_ONCE
#define LAMBENT_ZONAL_ONCE
namespace lambent {
namespace {
// The tables of sh_tables.h, and a light, as floats: one light for all, or one for each receiver of a block.
struct DirectLight {
  int order;
  float diagonal[max_sh_order], a[max_sh_order][max_sh_order], b[max_sh_order][max_sh_order];
  float light[sh_count(max_sh_order)][3];
  const float* field = nullptr;  // [block][coefficient][3][16]
  size_t field_coefficients = 0;
};
constexpr size_t block = transfer_block;
constexpr int row_length = ZonalLight::width + 1;
}  // namespace
}  // namespace lambent
#endif

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, block>;
using V = hn::Vec<F>;

struct Vec {
  V x, y, z;
};

// What one group of lanes of a block needs.
template <class Value>
struct Receivers {
  const Value* values;  // [value][16], from this group on
  const float* frame;   // [9][16], or null
  V load(size_t i) const {
    if constexpr (sizeof(Value) == 4) return hn::LoadU(F(), values + i * block);
    else return hn::PromoteTo(F(), hn::LoadU(hn::Rebind<hwy::float16_t, F>(), values + i * block));
  }
  Vec turn(Vec v) const {
    if (!frame) return v;
    auto row = [&](size_t r) {
      const F d;
      return hn::MulAdd(
          hn::LoadU(d, frame + r * block), v.x,
          hn::MulAdd(hn::LoadU(d, frame + (3 + r) * block), v.y, hn::Mul(hn::LoadU(d, frame + (6 + r) * block), v.z)));
    };
    return {row(0), row(1), row(2)};
  }
  // A lobe's axis where it points now, of unit length; something finite where it is zero.
  Vec axis(size_t at) const {
    const F d;
    const Vec v = turn({load(at), load(at + 1), load(at + 2)});
    const V length2 = hn::MulAdd(v.x, v.x, hn::MulAdd(v.y, v.y, hn::Mul(v.z, v.z)));
    const V scale = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(hn::Max(length2, hn::Set(d, 1e-12f))));
    return {hn::Mul(v.x, scale), hn::Mul(v.y, scale), hn::Mul(v.z, scale)};
  }
};

// One light's coefficients, or those of a group of lanes.
struct SharedLight {
  const float (*light)[3];
  V operator()(size_t k, size_t c) const { return hn::Set(F(), light[k][c]); }
};
struct OwnLight {
  const float* light;
  V operator()(size_t k, size_t c) const { return hn::LoadU(F(), light + (3 * k + c) * block); }
};

// The bands that are stored as they are, of channel c.
template <class Value, class Light>
V ExactBands(const Receivers<Value>& r, size_t channel, size_t exact_bands, const Light& light, size_t colour) {
  const size_t at = channel * exact_bands * exact_bands;
  V sum = hn::Mul(r.load(at), light(0, colour));
  if (exact_bands == 2) {
    // The linear band is the vector (-f_11, -f_1-1, f_10).
    const Vec v = r.turn({r.load(at + 3), r.load(at + 1), hn::Neg(r.load(at + 2))});
    sum = hn::MulAdd(v.x, light(3, colour), hn::MulAdd(v.y, light(1, colour), sum));
    sum = hn::NegMulAdd(v.z, light(2, colour), sum);
  }
  return sum;
}

template <class Value, class Light>
void Direct(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks, const DirectLight& light,
            float* out) {
  const F d;
  constexpr bool own = std::is_same_v<Light, OwnLight>;
  const size_t exact = size_t(t.exact_bands()), bands = size_t(t.order) - exact, channels = size_t(t.channels);
  const size_t rows = size_t(t.rows);
  for (size_t b = 0; b < blocks * rows; ++b)
    for (size_t part = 0; part < block; part += hn::Lanes(d)) {
      const Receivers<Value> r{reinterpret_cast<const Value*>(bytes) + b * t.row_values() * block + part,
                               frames ? frames + b / rows * 9 * block + part : nullptr};
      Light e;
      if constexpr (own) e.light = light.field + b / rows * light.field_coefficients * 3 * block + part;
      else e.light = light.light;
      V sum[3];
      for (size_t c = 0; c < 3; ++c) sum[c] = ExactBands(r, channels == 3 ? c : 0, exact, e, c);
      for (size_t i = 0; i < size_t(t.lobes); ++i) {
        const size_t at = t.exact_values() + i * t.lobe_values();
        const Vec s = r.axis(at);
        // Band by band of y_lm(s) e_lm, times g_l: q(l, m) (c_m e_lm + s_m e_l-m).
        V re = hn::Set(d, 1.0f), im = hn::Zero(d);
        for (int m = 0; m < t.order; ++m) {
          V q1 = hn::Set(d, light.diagonal[m]), q2 = hn::Zero(d);
          for (int l = m; l < t.order; ++l) {
            if (l > m) {
              const V q =
                  hn::MulAdd(hn::Mul(hn::Set(d, light.a[l][m]), s.z), q1, hn::Mul(hn::Set(d, light.b[l][m]), q2));
              q2 = q1, q1 = q;
            }
            if (l < int(exact)) continue;
            V weight = hn::Mul(q1, r.load(at + 3 + size_t(l) - exact));
            for (size_t c = 0; c < 3; ++c) {
              if (channels == 3 && c > 0) weight = hn::Mul(q1, r.load(at + 3 + c * bands + size_t(l) - exact));
              const V around = hn::MulAdd(re, e(size_t(sh_index(l, m)), c),
                                          m ? hn::Mul(im, e(size_t(sh_index(l, -m)), c)) : hn::Zero(d));
              sum[c] = hn::MulAdd(weight, around, sum[c]);
            }
          }
          const V next = hn::Sub(hn::Mul(re, s.x), hn::Mul(im, s.y));
          im = hn::MulAdd(re, s.y, hn::Mul(im, s.x)), re = next;
        }
      }
      for (size_t c = 0; c < 3; ++c) hn::StoreU(sum[c], d, out + (3 * b + c) * block + part);
    }
}

// Polar angle by Abramowitz and Stegun 4.4.45 and azimuth by a minimax polynomial of the arc tangent on [0, 1]: errors
// under 1e-4, a thousandth of a texel.
V PolarAngle(V z) {
  const F d;
  const V x = hn::Min(hn::Abs(z), hn::Set(d, 1.0f));
  V p = hn::MulAdd(x, hn::Set(d, -0.0187293f), hn::Set(d, 0.0742610f));
  p = hn::MulAdd(x, p, hn::Set(d, -0.2121144f));
  p = hn::Mul(hn::MulAdd(x, p, hn::Set(d, 1.5707288f)), hn::Sqrt(hn::Sub(hn::Set(d, 1.0f), x)));
  return hn::IfThenElse(hn::Lt(z, hn::Zero(d)), hn::Sub(hn::Set(d, pi), p), p);
}
V Azimuth(V y, V x) {  // in [0, 2 pi]
  const F d;
  const V ax = hn::Abs(x), ay = hn::Abs(y);
  const V t = hn::Div(hn::Min(ax, ay), hn::Max(hn::Max(ax, ay), hn::Set(d, 1e-20f))), t2 = hn::Mul(t, t);
  V p = hn::MulAdd(t2, hn::Set(d, 0.0208351f), hn::Set(d, -0.0851330f));
  p = hn::MulAdd(t2, p, hn::Set(d, 0.1801410f));
  p = hn::MulAdd(t2, p, hn::Set(d, -0.3302995f));
  p = hn::Mul(t, hn::MulAdd(t2, p, hn::Set(d, 0.9998660f)));
  p = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, pi / 2), p), p);
  p = hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(hn::Set(d, pi), p), p);
  return hn::IfThenElse(hn::Lt(y, hn::Zero(d)), hn::Sub(hn::Set(d, 2 * pi), p), p);
}

template <class Value>
void Specialised(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks, const float* texels,
                 const float (*exact_light)[3], float* out) {
  const F d;
  using R = hn::CappedTag<float, 16>;  // parts of a texel
  const R dr;
  const size_t exact = size_t(t.exact_bands()), bands = size_t(t.order) - exact, channels = size_t(t.channels);
  const size_t quads = (bands + 3) / 4, lobes = size_t(t.lobes), texel = quads * 16;
  constexpr size_t max_quads = 4;
  HWY_ALIGN int32_t place[block];
  HWY_ALIGN float across[block], down[block];
  HWY_ALIGN float g[max_quads][3][block][4];  // [quad][channel][receiver][band]
  HWY_ALIGN float acc[block][16];
  const size_t rows = size_t(t.rows);
  for (size_t b = 0; b < blocks * rows; ++b) {
    const Value* values = reinterpret_cast<const Value*>(bytes) + b * t.row_values() * block;
    const float* frame = frames ? frames + b / rows * 9 * block : nullptr;
    for (size_t i = 0; i < lobes; ++i) {
      const size_t at = t.exact_values() + i * t.lobe_values();
      for (size_t part = 0; part < block; part += hn::Lanes(d)) {
        const Receivers<Value> r{values + part, frame ? frame + part : nullptr};
        const Vec s = r.axis(at);
        const V u = hn::Mul(Azimuth(s.y, s.x), hn::Set(d, ZonalLight::width / (2 * pi)));
        const V v = hn::Mul(PolarAngle(s.z), hn::Set(d, (ZonalLight::height - 1) / pi));
        const V iu = hn::Max(hn::Min(hn::Floor(u), hn::Set(d, float(ZonalLight::width - 1))), hn::Zero(d));
        const V iv = hn::Max(hn::Min(hn::Floor(v), hn::Set(d, float(ZonalLight::height - 2))), hn::Zero(d));
        hn::Store(hn::Sub(u, iu), d, across + part), hn::Store(hn::Sub(v, iv), d, down + part);
        hn::Store(hn::ConvertTo(hn::RebindToSigned<F>(), hn::MulAdd(iv, hn::Set(d, float(row_length)), iu)),
                  hn::RebindToSigned<F>(), place + part);
        for (size_t q = 0; q < quads; ++q)
          for (size_t c = 0; c < channels; ++c) {
            auto band = [&](size_t k) {
              return 4 * q + k < bands ? r.load(at + 3 + c * bands + 4 * q + k) : hn::Zero(d);
            };
            hn::StoreInterleaved4(band(0), band(1), band(2), band(3), d, &g[q][c][part][0]);
          }
      }
      for (size_t j = 0; j < block; ++j) {
        const float* corner = texels + size_t(place[j]) * texel;
        const float* below = corner + row_length * texel;
        const auto fu = hn::Set(dr, across[j]), fv = hn::Set(dr, down[j]);
        for (size_t q = 0; q < quads; ++q, corner += 16, below += 16) {
          HWY_ALIGN float coloured[16];
          if (channels == 3)
            for (size_t c = 0; c < 4; ++c) std::memcpy(coloured + 4 * c, g[q][std::min<size_t>(c, 2)][j], 16);
          for (size_t k = 0; k < 16; k += hn::Lanes(dr)) {
            const auto a = hn::Load(dr, corner + k), e = hn::Load(dr, below + k);
            const auto top = hn::MulAdd(fu, hn::Sub(hn::Load(dr, corner + texel + k), a), a);
            const auto bottom = hn::MulAdd(fu, hn::Sub(hn::Load(dr, below + texel + k), e), e);
            const auto value = hn::MulAdd(fv, hn::Sub(bottom, top), top);
#if HWY_TARGET == HWY_SCALAR
            const auto weight = hn::Load(dr, channels == 3 ? coloured + k : g[q][0][j] + k % 4);
#else
            const auto weight = channels == 3 ? hn::Load(dr, coloured + k) : hn::LoadDup128(dr, g[q][0][j]);
#endif
            const auto before = i == 0 && q == 0 ? hn::Zero(dr) : hn::Load(dr, acc[j] + k);
            hn::Store(hn::MulAdd(value, weight, before), dr, acc[j] + k);
          }
        }
      }
    }
    for (size_t part = 0; part < block; part += hn::Lanes(d)) {
      const Receivers<Value> r{values + part, frame ? frame + part : nullptr};
      for (size_t c = 0; c < 3; ++c) {
        V sum = ExactBands(r, channels == 3 ? c : 0, exact, SharedLight{exact_light}, c);
        if (quads) {
          HWY_ALIGN float lobe_sum[16];
          for (size_t j = 0; j < hn::Lanes(d); ++j) {
            const float* a = acc[part + j] + 4 * c;
            lobe_sum[j] = (a[0] + a[1]) + (a[2] + a[3]);
          }
          sum = hn::Add(sum, hn::Load(d, lobe_sum));
        }
        hn::StoreU(sum, d, out + (3 * b + c) * block + part);
      }
    }
  }
}

void DirectHalf(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks,
                const DirectLight& light, float* out) {
  if (light.field) Direct<hwy::float16_t, OwnLight>(t, bytes, frames, blocks, light, out);
  else Direct<hwy::float16_t, SharedLight>(t, bytes, frames, blocks, light, out);
}
void DirectSingle(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks,
                  const DirectLight& light, float* out) {
  if (light.field) Direct<float, OwnLight>(t, bytes, frames, blocks, light, out);
  else Direct<float, SharedLight>(t, bytes, frames, blocks, light, out);
}
void SpecialisedHalf(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks,
                     const float* texels, const float (*exact)[3], float* out) {
  Specialised<hwy::float16_t>(t, bytes, frames, blocks, texels, exact, out);
}
void SpecialisedSingle(const ZonalTransfer& t, const uint8_t* bytes, const float* frames, size_t blocks,
                       const float* texels, const float (*exact)[3], float* out) {
  Specialised<float>(t, bytes, frames, blocks, texels, exact, out);
}

// A row of the table: of each azimuth, the sum over m of cos(m phi) A_m + sin(m phi) B_m; rows is [m][A, B][texel].
void TableRow(const float* rows, const float* turns, size_t order, size_t texel, float* out) {
  const hn::CappedTag<float, 16> d;
  for (size_t j = 0; j < size_t(row_length); ++j) {
    const float* cs = turns + j % size_t(ZonalLight::width) * 2 * order;  // [m][cos, sin]
    for (size_t k = 0; k < texel; k += hn::Lanes(d)) {
      auto even = hn::Load(d, rows + k), odd = hn::Zero(d);
      for (size_t m = 1; m < order; ++m) {
        even = hn::MulAdd(hn::Set(d, cs[2 * m]), hn::Load(d, rows + 2 * m * texel + k), even);
        odd = hn::MulAdd(hn::Set(d, cs[2 * m + 1]), hn::Load(d, rows + (2 * m + 1) * texel + k), odd);
      }
      hn::Store(hn::Add(even, odd), d, out + j * texel + k);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(DirectHalf);
HWY_EXPORT(DirectSingle);
HWY_EXPORT(SpecialisedHalf);
HWY_EXPORT(SpecialisedSingle);
HWY_EXPORT(TableRow);

// What does not change with the light: [row][l][m] the harmonics' part in the polar angle, [column][m][cos, sin].
struct Grid {
  std::vector<float> polar, turns;
};
Grid make_grid(int order) {
  Grid g;
  g.turns.resize(size_t(ZonalLight::width * order * 2));
  for (int j = 0; j < ZonalLight::width; ++j)
    for (int m = 0; m < order; ++m) {
      const double phi = 2 * std::numbers::pi * j * m / ZonalLight::width;
      g.turns[size_t((j * order + m) * 2)] = float(std::cos(phi)),
                                       g.turns[size_t((j * order + m) * 2 + 1)] = float(std::sin(phi));
    }
  double y[sh_count(max_sh_order)];
  for (int i = 0; i < ZonalLight::height; ++i) {
    const double theta = std::numbers::pi * i / (ZonalLight::height - 1);
    evaluate_sh(order, Vec3d(std::sin(theta), 0, std::cos(theta)), y);
    for (int l = 0; l < order; ++l)
      for (int m = 0; m < order; ++m) g.polar.push_back(m <= l ? float(y[sh_index(l, m)]) : 0.0f);
  }
  return g;
}
const Grid& grid(int order) {
  static const std::vector<Grid> grids = [] {
    std::vector<Grid> all(1);
    for (int n = 1; n <= max_sh_order; ++n) all.push_back(make_grid(n));
    return all;
  }();
  return grids[size_t(order)];
}

DirectLight direct_light(const ZonalTransfer& t) {
  const ShTables& tables = sh_tables();
  DirectLight direct;
  direct.order = t.order;
  for (int l = 0; l < t.order; ++l) {
    direct.diagonal[l] = float(tables.diagonal[l]);
    for (int m = 0; m < t.order; ++m) direct.a[l][m] = float(tables.a[l][m]), direct.b[l][m] = float(tables.b[l][m]);
  }
  return direct;
}

template <class Shade>
void for_blocks(const ZonalTransfer& t, const ReceiverFrames* frames, const BlockRuns* only, Relit& out,
                const Shade& shade) {
  LAMBENT_CHECK(t.data.size() == t.bytes() && (!frames || frames->receivers == t.receivers));
  const size_t rows = size_t(t.rows);
  out.rows = t.rows;
  out.values.resize(t.blocks() * rows * 3 * block);
  const size_t block_bytes = t.receiver_values() * block * t.value_bytes();
  const size_t grain = std::max<size_t>(1, (size_t{1} << 18) / block_bytes);
  parallel_blocks(t.blocks(), grain, only, [&](size_t begin, size_t end) {
    shade(begin, t.data.data() + begin * block_bytes, frames ? frames->values.data() + begin * 9 * block : nullptr,
          end - begin, out.values.data() + begin * rows * 3 * block);
  });
}

void shade_directly(const ZonalTransfer& t, const ReceiverFrames* frames, const DirectLight& light, Relit& out) {
  for_blocks(t, frames, nullptr, out,
             [&](size_t first, const uint8_t* data, const float* turned, size_t blocks, float* values) {
               DirectLight here = light;
               if (here.field) here.field += first * here.field_coefficients * 3 * block;
               if (t.precision == Precision::half)
                 HWY_DYNAMIC_DISPATCH(DirectHalf)(t, data, turned, blocks, here, values);
               else HWY_DYNAMIC_DISPATCH(DirectSingle)(t, data, turned, blocks, here, values);
             });
}

}  // namespace

void set_receiver_frames(ReceiverFrames& out, std::span<const Mat3> rotations) {
  out.receivers = rotations.size();
  out.values.resize((rotations.size() + block - 1) / block * 9 * block);
  for (size_t r = 0; r < rotations.size(); ++r)
    for (size_t k = 0; k < 9; ++k) out.values[(r / block * 9 + k) * block + r % block] = rotations[r][k / 3][k % 3];
}

ReceiverFrames make_receiver_frames(std::span<const Mat3> rotations) {
  ReceiverFrames frames;
  set_receiver_frames(frames, rotations);
  return frames;
}

void relight_zonal(const ZonalTransfer& t, const ReceiverFrames* frames, std::span<const Vec3> light, Relit& out) {
  LAMBENT_CHECK(light.size() >= size_t(sh_count(t.order)));
  DirectLight direct = direct_light(t);
  for (int k = 0; k < sh_count(t.order); ++k)
    for (int c = 0; c < 3; ++c) direct.light[k][c] = light[size_t(k)][c];
  shade_directly(t, frames, direct, out);
}

void relight_zonal(const ZonalTransfer& t, const ReceiverFrames* frames, const LightField& light, Relit& out) {
  LAMBENT_CHECK(light.order >= t.order && light.receivers == t.receivers);
  DirectLight direct = direct_light(t);
  direct.field = light.values.data(), direct.field_coefficients = size_t(sh_count(light.order));
  shade_directly(t, frames, direct, out);
}

void specialise_light(const ZonalTransfer& t, std::span<const Vec3> light, ZonalLight& out) {
  LAMBENT_CHECK(light.size() >= size_t(sh_count(t.order)));
  out.order = t.order, out.exact_bands = t.exact_bands();
  for (int k = 0; k < sh_count(out.exact_bands); ++k) out.exact[size_t(k)] = light[size_t(k)];
  const size_t order = size_t(t.order), texel = size_t(out.quads()) * 16;
  out.texels.resize(size_t(ZonalLight::height) * row_length * texel);
  if (texel == 0) return;
  out.rows.assign(2 * order * texel, 0.0f);
  const Grid& g = grid(t.order);
  for (size_t i = 0; i < size_t(ZonalLight::height); ++i) {
    for (size_t l = size_t(out.exact_bands); l < order; ++l)
      for (size_t m = 0; m <= l; ++m) {
        const float q = g.polar[(i * order + l) * order + m];
        const size_t band = l - size_t(out.exact_bands), slot = band / 4 * 16 + band % 4;
        for (int c = 0; c < 3; ++c) {
          out.rows[2 * m * texel + slot + 4 * size_t(c)] = q * light[l * l + l + m][c];
          if (m) out.rows[(2 * m + 1) * texel + slot + 4 * size_t(c)] = q * light[l * l + l - m][c];
        }
      }
    HWY_DYNAMIC_DISPATCH(TableRow)
    (out.rows.data(), g.turns.data(), order, texel, out.texels.data() + i * row_length * texel);
  }
}

void relight_zonal(const ZonalTransfer& t, const ReceiverFrames* frames, const ZonalLight& light, Relit& out) {
  relight_zonal(t, frames, light, out, nullptr);
}

void relight_zonal(const ZonalTransfer& t, const ReceiverFrames* frames, const ZonalLight& light, Relit& out,
                   const BlockRuns* only) {
  LAMBENT_CHECK(light.order == t.order && light.exact_bands == t.exact_bands());
  float exact[4][3];
  for (int k = 0; k < 4; ++k)
    for (int c = 0; c < 3; ++c) exact[k][c] = light.exact[size_t(k)][c];
  for_blocks(t, frames, only, out, [&](size_t, const uint8_t* data, const float* turned, size_t blocks, float* values) {
    if (t.precision == Precision::half)
      HWY_DYNAMIC_DISPATCH(SpecialisedHalf)(t, data, turned, blocks, light.texels.data(), exact, values);
    else HWY_DYNAMIC_DISPATCH(SpecialisedSingle)(t, data, turned, blocks, light.texels.data(), exact, values);
  });
}

Vec3 shade_zonal(const ZonalTransfer& t, std::span<const float> values, const Mat3& R, std::span<const Vec3> light) {
  LAMBENT_CHECK(values.size() == t.row_values() && light.size() >= size_t(sh_count(t.order)));
  const size_t exact = size_t(t.exact_bands()), exact_count = exact * exact, bands = size_t(t.order) - exact;
  Vec3 sum(0.0f);
  for (int c = 0; c < 3; ++c) {
    const float* f = values.data() + (t.channels == 3 ? size_t(c) * exact_count : 0);
    sum[c] = f[0] * light[0][c];
    if (exact == 2) sum[c] += dot(R * Vec3(-f[3], -f[1], f[2]), Vec3(-light[3][c], -light[1][c], light[2][c]));
  }
  float y[sh_count(max_sh_order)];
  for (int i = 0; i < t.lobes; ++i) {
    evaluate_sh(t.order, normalize_or(R * lobe_axis(t, values, i), {0, 0, 1}), y);
    const float* g = values.data() + t.exact_values() + size_t(i) * t.lobe_values() + 3;
    for (size_t l = exact; l < size_t(t.order); ++l) {
      Vec3 band(0.0f);
      for (size_t k = l * l; k < (l + 1) * (l + 1); ++k) band += y[k] * light[k];
      for (int c = 0; c < 3; ++c) sum[c] += g[(t.channels == 3 ? size_t(c) * bands : 0) + l - exact] * band[c];
    }
  }
  return sum;
}

}  // namespace lambent
#endif

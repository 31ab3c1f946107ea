// Follows: locally-adaptive-products, section 4 and appendix A.
#include <lambent/relight/product_kernels.h>

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/product_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;
using F4 = hn::CappedTag<float, 4>;

// x^n for x in [0, 1].
template <class V>
V Power(V x, float n) {
  const F d;
  return hn::IfThenZeroElse(hn::Le(x, hn::Set(d, 1e-30f)),
                            hn::Exp(d, hn::Mul(hn::Set(d, n), hn::Log(d, hn::Max(x, hn::Set(d, 1e-30f))))));
}

// s_k for `count` directions, padded to a multiple of 16 in all arrays; out[k] has `stride` floats.
void EvaluateTerms(const Terms& b, const float* x, const float* y, const float* z, size_t count, float* out,
                   size_t stride) {
  const F d;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  auto along = [&](Vec3 a, auto vx, auto vy, auto vz) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, a.x), vx, hn::MulAdd(hn::Set(d, a.y), vy, hn::Mul(hn::Set(d, a.z), vz)));
  };
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto vx = hn::LoadU(d, x + i), vy = hn::LoadU(d, y + i), vz = hn::LoadU(d, z + i);
    if (b.kind == Terms::Kind::phong) {
      const auto c = hn::Min(hn::Max(along(b.mirror, vx, vy, vz), zero), one);
      hn::StoreU(hn::Mul(hn::Set(d, (b.exponent + 2) / (2 * pi)), Power(c, b.exponent)), d, out + i);
      continue;
    }
    const auto wx = along(b.frame[0], vx, vy, vz), wy = along(b.frame[1], vx, vy, vz),
               wz = along(b.frame[2], vx, vy, vz);
    const auto above = hn::Gt(wz, hn::Set(d, least_cosine));
    auto hx = hn::Add(wx, hn::Set(d, b.wo.x)), hy = hn::Add(wy, hn::Set(d, b.wo.y)),
         hz = hn::Add(wz, hn::Set(d, b.wo.z));
    const auto length = hn::Sqrt(hn::Max(hn::MulAdd(hx, hx, hn::MulAdd(hy, hy, hn::Mul(hz, hz))), hn::Set(d, 1e-12f)));
    const auto inverse = hn::Div(one, length), cosine = hn::Mul(hn::Set(d, 0.5f), length);
    hx = hn::Mul(hx, inverse), hy = hn::Mul(hy, inverse), hz = hn::Max(hn::Mul(hz, inverse), hn::Set(d, 1e-6f));
    const auto ax = hn::Mul(hx, hn::Set(d, 1 / b.alpha.x)), ay = hn::Mul(hy, hn::Set(d, 1 / b.alpha.y));
    if (b.kind == Terms::Kind::ward) {
      const auto hz2 = hn::Mul(hz, hz), slopes = hn::Div(hn::MulAdd(ax, ax, hn::Mul(ay, ay)), hz2);
      const auto bell = hn::Exp(d, hn::Max(hn::Neg(slopes), hn::Set(d, -80.0f)));
      const auto below =
          hn::Mul(hn::Mul(hn::Set(d, 4 * pi * b.alpha.x * b.alpha.y), hn::Mul(cosine, cosine)), hn::Mul(hz2, hz2));
      hn::StoreU(hn::IfThenElseZero(above, hn::Div(bell, below)), d, out + i);
      continue;
    }
    // As ggx_lobe() of brdf/microfacet.cpp.
    auto half_root = [&](auto px, auto py, auto pz) HWY_ATTR {
      const auto sx = hn::Mul(px, hn::Set(d, b.alpha.x)), sy = hn::Mul(py, hn::Set(d, b.alpha.y));
      return hn::Mul(hn::Set(d, 0.5f), hn::Sqrt(hn::MulAdd(sx, sx, hn::MulAdd(sy, sy, hn::Mul(pz, pz)))));
    };
    const auto s = hn::MulAdd(ax, ax, hn::MulAdd(ay, ay, hn::Mul(hz, hz)));
    const auto root_i = half_root(wx, wy, wz),
               root_o = half_root(hn::Set(d, b.wo.x), hn::Set(d, b.wo.y), hn::Set(d, b.wo.z));
    const auto masking = hn::MulAdd(hn::Set(d, b.wo.z), root_i, hn::Mul(wz, root_o));
    const auto lobe = hn::IfThenElseZero(
        above, hn::Div(hn::Set(d, 1 / (4 * pi * b.alpha.x * b.alpha.y)), hn::Mul(hn::Mul(s, s), masking)));
    const auto q = hn::Max(hn::Sub(one, cosine), zero), q2 = hn::Mul(q, q), schlick = hn::Mul(hn::Mul(q2, q2), q);
    hn::StoreU(hn::Mul(lobe, hn::Sub(one, schlick)), d, out + i);
    hn::StoreU(hn::Mul(lobe, schlick), d, out + stride + i);
    if (b.layered) hn::StoreU(hn::IfThenElseZero(above, hn::Sub(one, schlick)), d, out + 2 * stride + i);
  }
}

// For one block, [direction x, y, z, energy r, g, b][256]: adds the irradiance weighted by `weight` to sums[0] if
// `plain`, and that times s_k to sums[1 + k]. terms is [k][256]. Only texels of `rows` are looked at.
template <int count, bool plain, bool weighted>
void IntegrateRows(const float* light, const float* weight, Vec3 n, const float* terms, uint32_t rows, Vec3* sums) {
  const F d;
  // The plain sum comes last, so that no accumulator is unused without it.
  constexpr int kinds = count + plain;
  if constexpr (kinds > 0) {
    decltype(hn::Zero(d)) acc[kinds][3];
    for (auto& row : acc)
      for (auto& a : row) a = hn::Zero(d);
    const auto nx = hn::Set(d, n.x), ny = hn::Set(d, n.y), nz = hn::Set(d, n.z);
    for (; rows; rows &= rows - 1) {
      const size_t begin = size_t(std::countr_zero(rows)) * block_side;
      for (size_t i = begin; i < begin + block_side; i += hn::Lanes(d)) {
        const float* l = light + i;
        auto cosine =
            hn::MulAdd(nx, hn::Load(d, l), hn::MulAdd(ny, hn::Load(d, l + 256), hn::Mul(nz, hn::Load(d, l + 512))));
        if constexpr (weighted) cosine = hn::Mul(cosine, hn::Load(d, weight + i));
        const auto r = hn::Load(d, l + 768), g = hn::Load(d, l + 1024), b = hn::Load(d, l + 1280);
        for (int k = 0; k < kinds; ++k) {
          const auto f = k < count ? hn::Mul(cosine, hn::Load(d, terms + 256 * k + i)) : cosine;
          acc[k][0] = hn::MulAdd(f, r, acc[k][0]), acc[k][1] = hn::MulAdd(f, g, acc[k][1]),
          acc[k][2] = hn::MulAdd(f, b, acc[k][2]);
        }
      }
    }
    for (int k = 0; k < kinds; ++k)
      for (int c = 0; c < 3; ++c) sums[k < count ? k + 1 : 0][c] += hn::GetLane(hn::SumOfLanes(d, acc[k][c]));
  }
}

template <int count>
void IntegrateCount(const float* light, const float* weight, Vec3 n, const float* terms, bool plain, uint32_t rows,
                    Vec3* sums) {
  if (plain && weight) IntegrateRows<count, true, true>(light, weight, n, terms, rows, sums);
  else if (plain) IntegrateRows<count, true, false>(light, weight, n, terms, rows, sums);
  else if (weight) IntegrateRows<count, false, true>(light, weight, n, terms, rows, sums);
  else IntegrateRows<count, false, false>(light, weight, n, terms, rows, sums);
}

// `weight` null: 1.
void IntegrateTexels(const float* light, const float* weight, Vec3 n, const float* terms, int count, bool plain,
                     uint32_t rows, Vec3* sums) {
  if (count == 0) IntegrateCount<0>(light, weight, n, terms, plain, rows, sums);
  else if (count == 1) IntegrateCount<1>(light, weight, n, terms, plain, rows, sums);
  else if (count == 2) IntegrateCount<2>(light, weight, n, terms, plain, rows, sums);
  else IntegrateCount<3>(light, weight, n, terms, plain, rows, sums);
}

// s_k at the texels of `rows` from its values at side x side nodes, [k][16]; out is [k][256].
void InterpolateTerms(const float* nodes, const float* cardinal, int side, int count, uint32_t rows, float* out) {
  const F d;
  for (; rows; rows &= rows - 1) {
    const int row = std::countr_zero(rows);
    for (int k = 0; k < count; ++k) {
      float along[4] = {};
      for (int j = 0; j < side; ++j)
        for (int i = 0; i < side; ++i) along[i] += nodes[16 * k + j * side + i] * cardinal[j * block_side + row];
      for (int x = 0; x < block_side; x += int(hn::Lanes(d))) {
        auto value = hn::Mul(hn::Set(d, along[0]), hn::LoadU(d, cardinal + x));
        for (int i = 1; i < side; ++i)
          value = hn::MulAdd(hn::Set(d, along[i]), hn::LoadU(d, cardinal + i * block_side + x), value);
        hn::Store(value, d, out + 256 * k + block_side * row + x);
      }
    }
  }
}

// eq. 6 and line 9: light summed over what is seen of a block, 12 numbers.
void SumSeen(const float* sums, const BlockChanges& c, float scale, float* out) {
  const F4 d;
  constexpr size_t lanes = hn::MaxLanes(F4()), parts = sum_width / lanes;
  decltype(hn::Zero(d)) acc[parts];
  for (auto& a : acc) a = hn::Zero(d);
  int before = 0;
  for (int i = 0; i < c.count; ++i) {
    const int after = c.level_after(i);
    const auto step = hn::Set(d, float(after - before) * scale);
    const float* s = sums + sum_width * c.where[i];
    for (size_t p = 0; p < parts; ++p) acc[p] = hn::MulAdd(step, hn::Load(d, s + p * lanes), acc[p]);
    before = after;
  }
  for (size_t p = 0; p < parts; ++p) hn::Store(acc[p], d, out + p * lanes);
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(EvaluateTerms);
HWY_EXPORT(IntegrateTexels);
HWY_EXPORT(InterpolateTerms);
HWY_EXPORT(SumSeen);
}  // namespace

Terms make_terms(const Brdf& brdf, const Mat3& frame, Vec3 wo_world) {
  Terms t;
  t.frame = frame, t.brdf = &brdf;
  t.wo = Vec3(dot(frame[0], wo_world), dot(frame[1], wo_world), dot(frame[2], wo_world));
  t.mirror = 2 * t.wo.z * frame[2] - wo_world;
  if (const auto* b = std::get_if<Lambert>(&brdf)) {
    t.lambert = b->albedo / pi;
  } else if (const auto* b = std::get_if<Phong>(&brdf)) {
    t.lambert = b->diffuse / pi, t.colour[0] = b->specular, t.exponent = b->exponent;
    if (b->specular != Vec3(0)) t.kind = Terms::Kind::phong, t.count = 1;
  } else if (const auto* b = std::get_if<Ward>(&brdf)) {
    t.lambert = b->diffuse / pi, t.colour[0] = b->specular, t.alpha = widths(b->alpha);
    t.kind = Terms::Kind::ward, t.count = 1;
  } else if (const auto* b = std::get_if<Ggx>(&brdf)) {
    // Schlick's F = f0 (1 - q) + q: two terms.
    t.colour[0] = b->f0, t.colour[1] = Vec3(1), t.alpha = widths(b->alpha);
    t.kind = Terms::Kind::ggx, t.count = 2;
  } else if (const auto* b = std::get_if<MetallicRoughness>(&brdf)) {
    // F = f0 (1 - q) + f90 q, and 1 - F = (1 - f90) + (f90 - f0) (1 - q).
    const Vec3 f0 = mix(b->dielectric_f0, b->base_color, b->metallic),
               diffuse = b->base_color * ((1 - b->metallic) / pi);
    const float f90 = std::lerp(b->dielectric_f90, 1.0f, b->metallic);
    t.lambert = diffuse * (1 - f90);
    t.colour[0] = f0, t.colour[1] = Vec3(f90), t.colour[2] = diffuse * (Vec3(f90) - f0);
    t.alpha = widths(Vec2(b->roughness * b->roughness)), t.layered = true;
    t.kind = Terms::Kind::ggx, t.count = 3;
  } else {
    // A number a channel.
    for (int k = 0; k < 3; ++k) t.colour[k][k] = 1;
    t.kind = Terms::Kind::other, t.count = 3;
  }
  return t;
}

void evaluate_terms(const Terms& t, const float* x, const float* y, const float* z, size_t count, float* out,
                    size_t stride) {
  if (t.kind == Terms::Kind::none) return;
  if (t.kind != Terms::Kind::other) return HWY_DYNAMIC_DISPATCH(EvaluateTerms)(t, x, y, z, count, out, stride);
  for (size_t i = 0; i < count; ++i) {
    const Vec3 w(x[i], y[i], z[i]),
        f = evaluate(*t.brdf, Vec3(dot(t.frame[0], w), dot(t.frame[1], w), dot(t.frame[2], w)), t.wo);
    for (size_t k = 0; k < 3; ++k) out[k * stride + i] = f[int(k)];
  }
}

void integrate_texels(const float* light, const float* weight, Vec3 n, const float* terms, int count, bool plain,
                      uint32_t rows, Vec3* sums) {
  HWY_DYNAMIC_DISPATCH(IntegrateTexels)(light, weight, n, terms, count, plain, rows, sums);
}

void interpolate_terms(const float* nodes, const float* cardinal, int side, int count, uint32_t rows, float* out) {
  HWY_DYNAMIC_DISPATCH(InterpolateTerms)(nodes, cardinal, side, count, rows, out);
}

void sum_seen(const float* sums, const BlockChanges& changes, float scale, float* out) {
  HWY_DYNAMIC_DISPATCH(SumSeen)(sums, changes, scale, out);
}

}  // namespace lambent
#endif

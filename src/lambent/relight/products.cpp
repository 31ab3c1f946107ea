// Follows: locally-adaptive-products, section 4 and appendix A; Ng, Ramamoorthi and Hanrahan 2004 (Haar wavelets).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>
#include <lambent/relight/products.h>

#include <bit>
#include <mutex>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/products.cpp"
#include <hwy/foreach_target.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#ifndef LAMBENT_PRODUCTS_ONCE
#define LAMBENT_PRODUCTS_ONCE
namespace lambent {

// A BRDF for one view: lambert + sum of colour[k] s_k(wi), s_k numbers, `count` of them.
struct Terms {
  enum class Kind { none, phong, ward, ggx, other } kind = Kind::none;
  int count = 0;
  Vec3 lambert{0}, colour[3];
  Mat3 frame;
  Vec3 wo, mirror;  // in the frame; in the world
  float exponent = 0;
  Vec2 alpha{1};
  bool layered = false;  // ggx: with a base below it, the third term
  const Brdf* brdf = nullptr;
};

inline constexpr size_t sum_width = 12, nodes_each[3] = {1, 4, 16}, coarse_each = 21;

}  // namespace lambent
#endif

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;
using F4 = hn::CappedTag<float, 4>;

// x^n for x in [0, 1].
template <class V>
V Power(V x, float n) {
  const F d;
  return hn::IfThenZeroElse(hn::Le(x, hn::Set(d, 1e-30f)), hn::Exp(d, hn::Mul(hn::Set(d, n), hn::Log(d, hn::Max(x, hn::Set(d, 1e-30f))))));
}

// s_k for `count` directions, padded to a multiple of 16 in all arrays; out[k] has `stride` floats.
void EvaluateTerms(const Terms& b, const float* x, const float* y, const float* z, size_t count, float* out, size_t stride) {
  const F d;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  auto along = [&](Vec3 a, auto vx, auto vy, auto vz) HWY_ATTR { return hn::MulAdd(hn::Set(d, a.x), vx, hn::MulAdd(hn::Set(d, a.y), vy, hn::Mul(hn::Set(d, a.z), vz))); };
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto vx = hn::LoadU(d, x + i), vy = hn::LoadU(d, y + i), vz = hn::LoadU(d, z + i);
    if (b.kind == Terms::Kind::phong) {
      const auto c = hn::Min(hn::Max(along(b.mirror, vx, vy, vz), zero), one);
      hn::StoreU(hn::Mul(hn::Set(d, (b.exponent + 2) / (2 * pi)), Power(c, b.exponent)), d, out + i);
      continue;
    }
    const auto wx = along(b.frame[0], vx, vy, vz), wy = along(b.frame[1], vx, vy, vz), wz = along(b.frame[2], vx, vy, vz);
    const auto above = hn::Gt(wz, hn::Set(d, least_cosine));
    auto hx = hn::Add(wx, hn::Set(d, b.wo.x)), hy = hn::Add(wy, hn::Set(d, b.wo.y)), hz = hn::Add(wz, hn::Set(d, b.wo.z));
    const auto length = hn::Sqrt(hn::Max(hn::MulAdd(hx, hx, hn::MulAdd(hy, hy, hn::Mul(hz, hz))), hn::Set(d, 1e-12f)));
    const auto inverse = hn::Div(one, length), cosine = hn::Mul(hn::Set(d, 0.5f), length);
    hx = hn::Mul(hx, inverse), hy = hn::Mul(hy, inverse), hz = hn::Max(hn::Mul(hz, inverse), hn::Set(d, 1e-6f));
    const auto ax = hn::Mul(hx, hn::Set(d, 1 / b.alpha.x)), ay = hn::Mul(hy, hn::Set(d, 1 / b.alpha.y));
    if (b.kind == Terms::Kind::ward) {
      const auto hz2 = hn::Mul(hz, hz), slopes = hn::Div(hn::MulAdd(ax, ax, hn::Mul(ay, ay)), hz2);
      const auto bell = hn::Exp(d, hn::Max(hn::Neg(slopes), hn::Set(d, -80.0f)));
      const auto below = hn::Mul(hn::Mul(hn::Set(d, 4 * pi * b.alpha.x * b.alpha.y), hn::Mul(cosine, cosine)), hn::Mul(hz2, hz2));
      hn::StoreU(hn::IfThenElseZero(above, hn::Div(bell, below)), d, out + i);
      continue;
    }
    // As ggx_lobe() of brdf/microfacet.cpp.
    auto half_root = [&](auto px, auto py, auto pz) HWY_ATTR {
      const auto sx = hn::Mul(px, hn::Set(d, b.alpha.x)), sy = hn::Mul(py, hn::Set(d, b.alpha.y));
      return hn::Mul(hn::Set(d, 0.5f), hn::Sqrt(hn::MulAdd(sx, sx, hn::MulAdd(sy, sy, hn::Mul(pz, pz)))));
    };
    const auto s = hn::MulAdd(ax, ax, hn::MulAdd(ay, ay, hn::Mul(hz, hz)));
    const auto root_i = half_root(wx, wy, wz), root_o = half_root(hn::Set(d, b.wo.x), hn::Set(d, b.wo.y), hn::Set(d, b.wo.z));
    const auto masking = hn::MulAdd(hn::Set(d, b.wo.z), root_i, hn::Mul(wz, root_o));
    const auto lobe = hn::IfThenElseZero(above, hn::Div(hn::Set(d, 1 / (4 * pi * b.alpha.x * b.alpha.y)), hn::Mul(hn::Mul(s, s), masking)));
    const auto q = hn::Max(hn::Sub(one, cosine), zero), q2 = hn::Mul(q, q), schlick = hn::Mul(hn::Mul(q2, q2), q);
    hn::StoreU(hn::Mul(lobe, hn::Sub(one, schlick)), d, out + i);
    hn::StoreU(hn::Mul(lobe, schlick), d, out + stride + i);
    if (b.layered) hn::StoreU(hn::IfThenElseZero(above, hn::Sub(one, schlick)), d, out + 2 * stride + i);
  }
}

// For one block, [direction x, y, z, energy r, g, b][256]: adds the irradiance weighted by `weight` to sums[0] if `plain`, and that
// times s_k to sums[1 + k]. terms is [k][256]. Only texels of `rows` are looked at.
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
        auto cosine = hn::MulAdd(nx, hn::Load(d, l), hn::MulAdd(ny, hn::Load(d, l + 256), hn::Mul(nz, hn::Load(d, l + 512))));
        if constexpr (weighted) cosine = hn::Mul(cosine, hn::Load(d, weight + i));
        const auto r = hn::Load(d, l + 768), g = hn::Load(d, l + 1024), b = hn::Load(d, l + 1280);
        for (int k = 0; k < kinds; ++k) {
          const auto f = k < count ? hn::Mul(cosine, hn::Load(d, terms + 256 * k + i)) : cosine;
          acc[k][0] = hn::MulAdd(f, r, acc[k][0]), acc[k][1] = hn::MulAdd(f, g, acc[k][1]), acc[k][2] = hn::MulAdd(f, b, acc[k][2]);
        }
      }
    }
    for (int k = 0; k < kinds; ++k)
      for (int c = 0; c < 3; ++c) sums[k < count ? k + 1 : 0][c] += hn::GetLane(hn::SumOfLanes(d, acc[k][c]));
  }
}

template <int count>
void IntegrateCount(const float* light, const float* weight, Vec3 n, const float* terms, bool plain, uint32_t rows, Vec3* sums) {
  if (plain && weight) IntegrateRows<count, true, true>(light, weight, n, terms, rows, sums);
  else if (plain) IntegrateRows<count, true, false>(light, weight, n, terms, rows, sums);
  else if (weight) IntegrateRows<count, false, true>(light, weight, n, terms, rows, sums);
  else IntegrateRows<count, false, false>(light, weight, n, terms, rows, sums);
}

// `weight` null: 1.
void IntegrateTexels(const float* light, const float* weight, Vec3 n, const float* terms, int count, bool plain, uint32_t rows, Vec3* sums) {
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
        for (int i = 1; i < side; ++i) value = hn::MulAdd(hn::Set(d, along[i]), hn::LoadU(d, cardinal + i * block_side + x), value);
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
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(EvaluateTerms);
HWY_EXPORT(IntegrateTexels);
HWY_EXPORT(InterpolateTerms);
HWY_EXPORT(SumSeen);

namespace {

Vec2 widths(Vec2 alpha) { return glm::max(alpha, Vec2(min_alpha)); }

Terms make_terms(const Brdf& brdf, const Mat3& frame, Vec3 wo_world) {
  Terms t;
  t.frame = frame, t.brdf = &brdf;
  t.wo = Vec3(glm::dot(frame[0], wo_world), glm::dot(frame[1], wo_world), glm::dot(frame[2], wo_world));
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
    const Vec3 f0 = glm::mix(Vec3(0.04f), b->base_color, b->metallic);
    t.colour[0] = f0, t.colour[1] = Vec3(1), t.colour[2] = b->base_color * ((1 - b->metallic) / pi) * (Vec3(1) - f0);
    t.alpha = widths(Vec2(b->roughness * b->roughness)), t.layered = true;
    t.kind = Terms::Kind::ggx, t.count = 3;
  } else {
    // A number a channel.
    for (int k = 0; k < 3; ++k) t.colour[k][k] = 1;
    t.kind = Terms::Kind::other, t.count = 3;
  }
  return t;
}

void evaluate_terms(const Terms& t, const float* x, const float* y, const float* z, size_t count, float* out, size_t stride) {
  if (t.kind == Terms::Kind::none) return;
  if (t.kind != Terms::Kind::other) return HWY_DYNAMIC_DISPATCH(EvaluateTerms)(t, x, y, z, count, out, stride);
  for (size_t i = 0; i < count; ++i) {
    const Vec3 w(x[i], y[i], z[i]), f = evaluate(*t.brdf, Vec3(glm::dot(t.frame[0], w), glm::dot(t.frame[1], w), glm::dot(t.frame[2], w)), t.wo);
    for (size_t k = 0; k < 3; ++k) out[k * stride + i] = f[int(k)];
  }
}

Vec3 contract(const float* m, Vec3 n) { return n.x * Vec3(m[0], m[1], m[2]) + n.y * Vec3(m[4], m[5], m[6]) + n.z * Vec3(m[8], m[9], m[10]); }

// Exponent of a Phong lobe as wide as the model's: half-vector slopes of width alpha turn the mirror image by twice the angle.
float equivalent_exponent(const Brdf& brdf) {
  auto of_alpha = [](float alpha) { return 1 / (2 * alpha * alpha); };
  if (const auto* b = std::get_if<Phong>(&brdf)) return b->exponent;
  if (const auto* b = std::get_if<Ward>(&brdf)) return of_alpha(std::min(widths(b->alpha).x, widths(b->alpha).y));
  if (const auto* b = std::get_if<Ggx>(&brdf)) return of_alpha(std::min(widths(b->alpha).x, widths(b->alpha).y));
  if (const auto* b = std::get_if<CookTorrance>(&brdf)) return of_alpha(widths(Vec2(b->m)).x);
  if (const auto* b = std::get_if<MetallicRoughness>(&brdf)) return of_alpha(widths(Vec2(b->roughness * b->roughness)).x);
  return 0;
}

// Largest error over a block, whose middle is `angle` from a Phong lobe's axis, of no sample, 1, 4 and 16: numerically, on a flat block.
std::array<float, 4> phong_errors(float exponent, float angle, float half_width, const Cube& cube) {
  std::array<float, 4> errors{};
  for (float turn : {0.0f, pi / 4}) {
    auto lobe = [&](float x, float y) {
      const float u = x * std::cos(turn) - y * std::sin(turn) + angle, v = x * std::sin(turn) + y * std::cos(turn), theta = std::sqrt(u * u + v * v);
      return theta < pi / 2 ? std::pow(std::cos(theta), exponent) * (exponent + 2) / (2 * pi) : 0.0f;
    };
    auto place = [&](float texel) { return (texel / 8 - 1) * half_width; };
    float nodes[3][16];
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < node_sides[k] * node_sides[k]; ++i) {
        const float step = 16.0f / float(node_sides[k]);
        nodes[k][i] = lobe(place((float(i % node_sides[k]) + 0.5f) * step), place((float(i / node_sides[k]) + 0.5f) * step));
      }
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) {
        const float truth = lobe(place(float(x) + 0.5f), place(float(y) + 0.5f));
        errors[0] = std::max(errors[0], truth);
        for (int k = 0; k < 3; ++k) {
          float sum = 0;
          const int n = node_sides[k];
          for (int i = 0; i < n * n; ++i) sum += nodes[k][i] * cube.cardinal[size_t(k)][size_t(i % n * 16 + x)] * cube.cardinal[size_t(k)][size_t(i / n * 16 + y)];
          errors[size_t(k + 1)] = std::max(errors[size_t(k + 1)], std::abs(sum - truth));
        }
      }
  }
  return errors;
}

struct Scratch {
  alignas(64) float terms[3 * block_texels], weights[block_texels], nodes[3 * 16], sum[sum_width];
  AlignedVector<float> middles;
};

constexpr uint32_t all_rows = (1u << block_side) - 1;

// Rows of a block, a bit each, of which anything is seen.
uint32_t rows_seen(const BlockChanges& c) {
  uint32_t rows = 0;
  for (int i = 0; i < c.count; ++i) {
    if (c.level_after(i) == 0) continue;
    const int first = c.where[i] / block_side, last = ((i + 1 < c.count ? c.where[i + 1] : block_texels) - 1) / block_side;
    rows |= (2u << last) - (1u << first);
  }
  return rows;
}

// s_k at a block's own directions of light, in `rows`.
void evaluate_block(const Terms& t, const float* light, uint32_t rows, float* out) {
  while (rows) {
    const int first = std::countr_zero(rows), count = std::countr_one(rows >> first);
    const float* l = light + first * block_side;
    evaluate_terms(t, l, l + 256, l + 512, size_t(count) * block_side, out + first * block_side, block_texels);
    rows &= ~(((1u << count) - 1) << first);
  }
}

void expand(const BlockChanges& c, float scale, float* weights) {
  int t = 0;
  float now = 0;
  for (int i = 0; i < c.count; ++i) {
    for (; t < c.where[i]; ++t) weights[t] = now;
    now = float(c.level_after(i)) * scale;
  }
  for (; t < block_texels; ++t) weights[t] = now;
}

Vec3 total(const Terms& t, const Vec3* sums) {
  Vec3 out = t.lambert * sums[0];
  for (int k = 0; k < t.count; ++k) out += t.colour[k] * sums[k + 1];
  return out;
}

// 0 for none, 1 to 4 for 1, 4, 16, 256 samples, for a block whose middle is at this cosine from the mirror image of the view.
int sample_class(const ProductMaterial& m, float cosine) {
  int k = 0;
  while (k < 4 && cosine > m.cosines[size_t(k)]) ++k;
  return k;
}

// The same from values at 16 nodes and the middle: 1 sample where they are alike, 16 where those give the middle's value back, else 256.
int class_by_values(const Terms& t, const ProductMaterial& m, const Cube& cube, const float* nodes, const float* middle, size_t stride) {
  float least = INFINITY, most = 0, centre = 0, back = 0;
  const std::vector<float>& c = cube.cardinal[2];
  for (int i = 0; i < 16; ++i) {
    float value = 0;
    for (int k = 0; k < t.count; ++k) value += largest(t.colour[k]) * nodes[16 * k + i];
    least = std::min(least, value), most = std::max(most, value);
    // Halfway between texels 7 and 8, along both sides.
    back += value * 0.5f * (c[size_t(i % 4 * 16 + 7)] + c[size_t(i % 4 * 16 + 8)]) * 0.5f * (c[size_t(i / 4 * 16 + 7)] + c[size_t(i / 4 * 16 + 8)]);
  }
  for (int k = 0; k < t.count; ++k) centre += largest(t.colour[k]) * middle[size_t(k) * stride];
  least = std::min(least, centre), most = std::max(most, centre);
  if (pi * (most - least) < m.tolerance) return 1;
  return pi * std::abs(back - centre) < 0.25f * m.tolerance && most < 2 * least ? 3 : 4;
}

Vec3 shade_blocks_with(Scratch& s, const BlockLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame,
                       Vec3 wo, Breakdown& tally) {
  const Terms t = make_terms(material.brdf, frame, wo);
  if (!(t.wo.z > least_cosine)) return Vec3(0);
  const Cube& cube = *light.cube;
  const size_t blocks = size_t(cube.blocks()), stride = cube.nodes[0].x.size();
  const Vec3 n = frame[2];
  const float scale = 1 / float(visibility.top());
  if (t.count > 0) {
    s.middles.resize(3 * stride);
    evaluate_terms(t, cube.nodes[0].x.data(), cube.nodes[0].y.data(), cube.nodes[0].z.data(), stride, s.middles.data(), stride);
  }
  Vec3 sums[4] = {};
  VisibilityReader reader(visibility, receiver);
  for (size_t b = 0; b < blocks; ++b) {
    const BlockSight sight = reader.sight(int(b));
    if (sight == BlockSight::blocked) {
      ++tally.blocked;
      continue;
    }
    const bool clear = sight == BlockSight::clear;
    const BlockChanges changes = clear ? BlockChanges{} : reader.next();
    const float* coarse = light.coarse.data() + b * coarse_each * sum_width;
    if (!clear) HWY_DYNAMIC_DISPATCH(SumSeen)(light.sums.data() + b * block_texels * sum_width, changes, scale, s.sum);
    const Vec3 seen = contract(clear ? coarse : s.sum, n);
    sums[0] += seen;
    const float* texels = light.texels.data() + b * 6 * block_texels;
    auto integrate = [&](uint32_t rows) {
      if (!clear) expand(changes, scale, s.weights);
      HWY_DYNAMIC_DISPATCH(IntegrateTexels)(texels, clear ? nullptr : s.weights, n, s.terms, t.count, false, rows, sums);
    };
    int samples = 0;
    if (t.count > 0) {
      samples = sample_class(material, glm::dot(t.mirror, cube.nodes[0].at(b)));
      if (material.by_values && samples < 4) {
        evaluate_terms(t, &cube.nodes[2].x[16 * b], &cube.nodes[2].y[16 * b], &cube.nodes[2].z[16 * b], 16, s.nodes, 16);
        samples = class_by_values(t, material, cube, s.nodes, &s.middles[b], stride);
      }
      // Samples below the horizon say nothing about the block's part above it.
      if (!clear && t.kind != Terms::Kind::phong && samples == 1 && glm::dot(n, cube.nodes[0].at(b)) <= 0) samples = 4;
      // Nor do nodes below it, where the model's values break off.
      if (!clear && t.kind != Terms::Kind::phong && samples > 1 && glm::dot(n, cube.nodes[0].at(b)) < std::sin(cube.reach[b])) samples = 4;
    }
    if (samples == 1) {
      for (int k = 0; k < t.count; ++k) sums[k + 1] += s.middles[size_t(k) * stride + b] * seen;
    } else if (samples == 2 || samples == 3) {
      const DirectionArray& nodes = cube.nodes[size_t(samples - 1)];
      const size_t each = nodes_each[samples - 1];
      const float* cardinal = coarse + (samples == 2 ? 1 : 5) * sum_width;
      alignas(64) float x[16], y[16], z[16];
      for (size_t i = 0; i < 16; ++i) {
        const size_t j = each * b + std::min(i, each - 1);
        x[i] = nodes.x[j], y[i] = nodes.y[j], z[i] = nodes.z[j];
      }
      evaluate_terms(t, x, y, z, 16, s.nodes, 16);
      if (clear) {
        for (int k = 0; k < t.count; ++k) {
          float m[sum_width] = {};
          for (size_t i = 0; i < each; ++i)
            for (size_t l = 0; l < sum_width; ++l) m[l] += s.nodes[16 * size_t(k) + i] * cardinal[i * sum_width + l];
          sums[k + 1] += contract(m, n);
        }
      } else {
        const uint32_t rows = rows_seen(changes);
        const size_t grid = size_t(samples - 1);
        HWY_DYNAMIC_DISPATCH(InterpolateTerms)(s.nodes, cube.cardinal[grid].data(), node_sides[grid], t.count, rows, s.terms);
        integrate(rows);
      }
    } else if (samples == 4) {
      const uint32_t rows = clear ? all_rows : rows_seen(changes);
      evaluate_block(t, texels, rows, s.terms);
      integrate(rows);
    }
    ++tally.samples[size_t(std::max(samples, 1) - 1)];
    ++(clear ? tally.light_brdf : samples <= 1 ? tally.light_visibility : tally.triple);
  }
  return total(t, sums);
}

Vec3 shade_standard_with(Scratch& s, const BlockLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame,
                         Vec3 wo) {
  const Terms t = make_terms(material.brdf, frame, wo);
  if (!(t.wo.z > least_cosine)) return Vec3(0);
  const float scale = 1 / float(visibility.top());
  Vec3 sums[4] = {};
  VisibilityReader reader(visibility, receiver);
  for (int b = 0; b < light.cube->blocks(); ++b) {
    const BlockSight sight = reader.sight(b);
    if (sight == BlockSight::blocked) continue;
    if (sight == BlockSight::mixed) expand(reader.next(), scale, s.weights);
    const float* texels = light.texels.data() + size_t(b) * 6 * block_texels;
    evaluate_block(t, texels, all_rows, s.terms);
    const float* weights = sight == BlockSight::clear ? nullptr : s.weights;
    HWY_DYNAMIC_DISPATCH(IntegrateTexels)(texels, weights, frame[2], s.terms, t.count, true, all_rows, sums);
  }
  return total(t, sums);
}

}  // namespace

void set_light(BlockLight& out, const CubeLight& light) {
  if (!out.cube || out.cube->size != light.size) out.cube = std::make_shared<const Cube>(make_cube(light.size));
  const Cube& cube = *out.cube;
  const size_t blocks = size_t(cube.blocks());
  out.texels.resize(blocks * 6 * block_texels), out.sums.resize(blocks * block_texels * sum_width), out.coarse.resize(blocks * coarse_each * sum_width);
  parallel_for(blocks, 8, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      float* texels = out.texels.data() + b * 6 * block_texels;
      float* coarse = out.coarse.data() + b * coarse_each * sum_width;
      std::fill(coarse, coarse + coarse_each * sum_width, 0.0f);
      double sum[sum_width] = {};
      for (size_t t = block_texels; t-- > 0;) {
        const Vec3 d = light.direction[b * block_texels + t], e = light.energy[b * block_texels + t];
        float m[sum_width] = {};
        for (size_t k = 0; k < 3; ++k) {
          texels[k * block_texels + t] = d[int(k)], texels[(3 + k) * block_texels + t] = e[int(k)];
          for (size_t c = 0; c < 3; ++c) m[4 * k + c] = d[int(k)] * e[int(c)];
        }
        float* sums = out.sums.data() + (b * block_texels + t) * sum_width;
        for (size_t i = 0; i < sum_width; ++i) sum[i] += double(m[i]), sums[i] = float(sum[i]), coarse[i] = sums[i];
        const size_t x = t % block_side, y = t / block_side;
        float* at = coarse + sum_width;
        for (size_t k = 1; k < 3; ++k) {
          const size_t side = size_t(node_sides[k]);
          for (size_t j = 0; j < side; ++j)
            for (size_t i = 0; i < side; ++i, at += sum_width) {
              const float w = cube.cardinal[k][i * block_side + x] * cube.cardinal[k][j * block_side + y];
              for (size_t l = 0; l < sum_width; ++l) at[l] += w * m[l];
            }
        }
      }
    }
  });
}

ProductMaterial make_product_material(const Brdf& brdf, const Cube& cube, const Sampling& sampling) {
  ProductMaterial m;
  m.brdf = brdf, m.tolerance = sampling.tolerance;
  const float exponent = equivalent_exponent(brdf);
  const auto* phong = std::get_if<Phong>(&brdf);
  if (sampling.rule == SamplingRule::full) {
    m.cosines = {-2, -2, -2, -2};
  } else if (sampling.rule == SamplingRule::appendix_a) {
    const float wide = std::cos(pi / 4), narrow = std::cos(pi / 8);
    if (exponent < 30) m.cosines = {-2, exponent > 0 ? wide : 2, 2, 2};
    else m.cosines = {-2, wide, narrow, exponent > 250 ? narrow : 2};
  } else if (phong) {
    // From the far side on, the first angle at which the error is too large; twice the tolerance, since this is the worst of the block.
    constexpr int steps = 90;
    m.cosines = {2, 2, 2, 2};
    const float half_width = cube.widest / std::sqrt(2.0f), weight = pi * largest(phong->specular);
    for (int i = steps; i >= 0; --i) {
      const float angle = float(i) * pi / steps;
      const std::array<float, 4> errors = phong_errors(phong->exponent, angle, half_width, cube);
      for (size_t k = 0; k < 4; ++k)
        if (m.cosines[k] > 1 && weight * errors[k] > 2 * sampling.tolerance) m.cosines[k] = std::cos(std::min(pi, angle + pi / steps)) - 1e-6f;
    }
    // More samples are never wrong: the classes are nested.
    for (size_t k = 3; k > 0; --k) m.cosines[k - 1] = std::min(m.cosines[k - 1], m.cosines[k]);
  } else {
    // Near a lobe narrower than the nodes' spacing, values at nodes say nothing.
    m.by_values = true;
    const float deviation = exponent > 0 ? 1 / std::sqrt(exponent) : 1;
    m.cosines = {-2, 2, 2, deviation < cube.widest ? std::cos(std::min(pi, cube.widest + 3 * deviation)) : 2};
  }
  return m;
}

Vec3 diffuse_albedo(const Brdf& brdf) {
  if (const auto* b = std::get_if<Lambert>(&brdf)) return b->albedo;
  if (const auto* b = std::get_if<Phong>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<Ward>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<CookTorrance>(&brdf)) return b->diffuse;
  if (const auto* b = std::get_if<MetallicRoughness>(&brdf)) return b->base_color * (1 - b->metallic);
  return Vec3(0);
}

void Breakdown::add(const Breakdown& b) {
  blocked += b.blocked, light_brdf += b.light_brdf, light_visibility += b.light_visibility, triple += b.triple;
  for (size_t k = 0; k < 4; ++k) samples[k] += b.samples[k];
}

Vec3 shade_blocks(const BlockLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame, Vec3 wo,
                  Breakdown* breakdown) {
  Scratch s;
  Breakdown tally;
  const Vec3 out = shade_blocks_with(s, light, visibility, receiver, material, frame, wo, tally);
  if (breakdown) breakdown->add(tally);
  return out;
}

Vec3 shade_standard(const BlockLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame, Vec3 wo) {
  Scratch s;
  return shade_standard_with(s, light, visibility, receiver, material, frame, wo);
}

Vec3 shade_standard_scalar(const BlockLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame, Vec3 wo) {
  const size_t count = light.cube->count();
  std::vector<uint8_t> levels(count);
  decode_visibility(visibility, receiver, levels);
  auto local = [&](Vec3 w) { return Vec3(glm::dot(frame[0], w), glm::dot(frame[1], w), glm::dot(frame[2], w)); };
  const Vec3 view = local(wo);
  glm::dvec3 sum(0);
  for (size_t t = 0; t < count; ++t) {
    const float* p = light.texels.data() + t / block_texels * 6 * block_texels + t % block_texels;
    const Vec3 wi = local(Vec3(p[0], p[256], p[512]));
    sum += glm::dvec3(evaluate(material.brdf, wi, view) * Vec3(p[768], p[1024], p[1280]) * (wi.z * float(levels[t]) / float(visibility.top())));
  }
  return Vec3(sum);
}

HaarLight make_haar_light(const CubeLight& light, double fraction, int visibility_bits) {
  HaarLight out{std::make_shared<const Cube>(make_cube(light.size)), fraction, visibility_bits, {}, light.direction};
  const int size = light.size, levels = std::countr_zero(unsigned(size));
  LAMBENT_CHECK(std::has_single_bit(unsigned(size)));
  std::vector<float> face(size_t(size) * size_t(size));
  for (int c = 0; c < 3; ++c) {
    out.trees[size_t(c)].resize(6);
    for (int f = 0; f < 6; ++f) {
      // Of area 1: the integral is the sum of energies.
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) face[size_t(y * size + x)] = light.energy[cube_texel(size, f, x, y)][c] * float(size) * float(size);
      haar_transform(levels, face, out.trees[size_t(c)][size_t(f)]);
    }
    keep_largest(out.trees[size_t(c)], fraction);
  }
  return out;
}

void project_haar(const HaarLight& light, const Visibility& visibility, size_t receiver, const ProductMaterial& material, const Mat3& frame, Vec3 wo, HaarScratch& s) {
  const int size = light.cube->size, levels = std::countr_zero(unsigned(size));
  const size_t count = light.cube->count(), area = size_t(size) * size_t(size);
  s.levels.resize(count), s.faces.resize(4 * count);
  decode_visibility(visibility, receiver, s.levels);
  auto local = [&](Vec3 w) { return Vec3(glm::dot(frame[0], w), glm::dot(frame[1], w), glm::dot(frame[2], w)); };
  const Vec3 view = local(wo);
  for (int f = 0; f < 6; ++f)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        const size_t t = cube_texel(size, f, x, y), at = size_t(f) * area + size_t(y * size + x);
        const Vec3 wi = local(light.direction[t]), value = evaluate(material.brdf, wi, view) * wi.z;
        for (size_t c = 0; c < 3; ++c) s.faces[c * count + at] = value[int(c)];
        s.faces[3 * count + at] = float(s.levels[t]) / float(visibility.top());
      }
  for (size_t c = 0; c < 4; ++c) {
    std::vector<HaarTree>& trees = c < 3 ? s.brdf[c] : s.visibility;
    trees.resize(6);
    for (size_t f = 0; f < 6; ++f) haar_transform(levels, std::span<const float>(s.faces).subspan(c * count + f * area, area), trees[f]);
    if (c < 3) keep_largest(trees, light.fraction);
    else if (light.visibility_bits > 0)
      for (HaarTree& tree : trees) quantise_haar(tree, light.visibility_bits);
  }
}

Vec3 multiply_haar(const HaarLight& light, const HaarScratch& s, size_t* visited) {
  glm::dvec3 sum(0);
  for (size_t c = 0; c < 3; ++c)
    for (size_t f = 0; f < 6; ++f) sum[int(c)] += haar_triple_product(light.trees[c][f], s.brdf[c][f], s.visibility[f], visited);
  return Vec3(sum);
}

void shade_receivers(Product product, const BlockLight& light, const HaarLight* haar, const Visibility& visibility, const ProductReceivers& receivers,
                     std::span<const uint32_t> seen, Vec3 eye, Relit& out, Breakdown* breakdown) {
  LAMBENT_CHECK(light.cube && light.cube->size == visibility.size && (product != Product::haar || haar) && receivers.positions.size() == visibility.receivers);
  out.rows = 1;
  out.values.assign((visibility.receivers + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  std::mutex mutex;
  Pool<Scratch> pool([] { return std::make_unique<Scratch>(); });
  Pool<HaarScratch> haar_pool([] { return std::make_unique<HaarScratch>(); });
  parallel_for(seen.size(), 64, [&](size_t begin, size_t end) {
    const auto s = pool.borrow();
    Breakdown tally;
    for (size_t i = begin; i < end; ++i) {
      const size_t r = seen[i];
      const ProductMaterial& material = receivers.materials[receivers.material_of[r]];
      const Mat3& frame = receivers.frames[r];
      const Vec3 wo = normalize_or(eye - receivers.positions[r], frame[2]);
      Vec3 value(0);
      if (product == Product::blocks) {
        value = shade_blocks_with(*s, light, visibility, r, material, frame, wo, tally);
      } else if (product == Product::standard) {
        value = shade_standard_with(*s, light, visibility, r, material, frame, wo);
      } else {
        const auto h = haar_pool.borrow();
        project_haar(*haar, visibility, r, material, frame, wo, *h);
        value = multiply_haar(*haar, *h);
      }
      out.set(r, 0, value);
    }
    if (breakdown) {
      std::lock_guard lock(mutex);
      breakdown->add(tally);
    }
  });
}

}  // namespace lambent
#endif

// Follows: locally-adaptive-products, section 4 and appendix A.
#include <lambent/relight/product_kernels.h>

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/product_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <lambent/relight/product_lobes-inl.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
// s_k for `count` directions, padded to a multiple of 16 in all arrays; out[k] has `stride` floats.
void EvaluateTerms(const Terms& t, const float* x, const float* y, const float* z, size_t count, float* out,
                   size_t stride) {
  const F d;
  WithLobe(t, [&](auto lobe) HWY_ATTR {
    for (size_t i = 0; i < count; i += hn::Lanes(d)) {
      V s[decltype(lobe)::count];
      lobe(hn::LoadU(d, x + i), hn::LoadU(d, y + i), hn::LoadU(d, z + i), s);
      for (size_t k = 0; k < size_t(lobe.count); ++k) hn::StoreU(s[k], d, out + k * stride + i);
    }
  });
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

// Along rows first.
void FoldMoments(const float* const* cardinal, const float* moments, float* coarse) {
  const F d;
  for (size_t k = 1; k < 4; ++k) {
    const auto side = size_t(node_sides[k]);
    const float* c = cardinal[k];
    for (size_t l = 0; l < sum_width; l += hn::Lanes(d))
      for (size_t i = 0; i < side; ++i) {
        V along[block_side];
        for (size_t row = 0; row < size_t(block_side); ++row) {
          const float* m = moments + row * block_side * sum_width + l;
          V even = hn::Zero(d), odd = even;
          for (size_t x = 0; x < size_t(block_side); x += 2) {
            even = hn::MulAdd(Fill(c[i * block_side + x]), hn::Load(d, m + x * sum_width), even);
            odd = hn::MulAdd(Fill(c[i * block_side + x + 1]), hn::Load(d, m + (x + 1) * sum_width), odd);
          }
          along[row] = hn::Add(even, odd);
        }
        for (size_t j = 0; j < side; ++j) {
          V sum = hn::Zero(d);
          for (size_t row = 0; row < size_t(block_side); ++row)
            sum = hn::MulAdd(Fill(c[j * block_side + row]), along[row], sum);
          hn::StoreU(sum, d, coarse + (coarse_begin[k] + j * side + i) * sum_width + l);
        }
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

HWY_EXPORT(EvaluateTerms);
HWY_EXPORT(IntegrateTexels);
HWY_EXPORT(FoldMoments);
}  // namespace

Terms make_terms(const Brdf& brdf, const Mat3& frame, Vec3 wo_world) {
  Terms t;
  t.frame = frame;
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
    t.alpha = widths(Vec2(b->roughness * b->roughness)), t.kind = Terms::Kind::ggx, t.count = 3;
  } else if (const auto* b = std::get_if<CookTorrance>(&brdf)) {
    t.lambert = b->diffuse / pi, t.alpha = widths(Vec2(b->m)), t.kind = Terms::Kind::cook_torrance;
    for (int c = 0; c < 3; ++c) {
      const float root = std::sqrt(b->f0[c]);
      t.index[c] = root > 0.9999f ? 0 : (1 + root) / (1 - root);
    }
    if (t.index == Vec3(t.index.x)) t.count = 1, t.colour[0] = b->specular;
    else
      for (t.count = 0; t.count < 3; ++t.count) t.colour[t.count][t.count] = b->specular[t.count];
  } else if (const auto* b = std::get_if<Measured>(&brdf)) {
    // A number a channel.
    for (int k = 0; k < 3; ++k) t.colour[k][k] = 1;
    t.kind = Terms::Kind::measured, t.count = 3, t.table = b->table.get();
  }
  return t;
}

void evaluate_terms(const Terms& t, const float* x, const float* y, const float* z, size_t count, float* out,
                    size_t stride) {
  HWY_DYNAMIC_DISPATCH(EvaluateTerms)(t, x, y, z, count, out, stride);
}

void integrate_texels(const float* light, const float* weight, Vec3 n, const float* terms, int count, bool plain,
                      uint32_t rows, Vec3* sums) {
  HWY_DYNAMIC_DISPATCH(IntegrateTexels)(light, weight, n, terms, count, plain, rows, sums);
}

void fold_moments(const Cube& cube, const float* moments, float* coarse) {
  const float* cardinal[4];
  for (size_t k = 0; k < 4; ++k) cardinal[k] = cube.cardinal[k].data();
  HWY_DYNAMIC_DISPATCH(FoldMoments)(cardinal, moments, coarse);
}

}  // namespace lambent
#endif

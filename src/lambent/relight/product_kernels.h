#pragma once
// What products do to a block of texels, in SIMD lanes chosen at run time. Source: locally-adaptive-products,
// section 4.
#include <lambent/relight/products.h>

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

// Roughness as it is evaluated.
inline Vec2 widths(Vec2 alpha) { return max(alpha, Vec2(min_alpha)); }

Terms make_terms(const Brdf& brdf, const Mat3& frame, Vec3 wo_world);

// s_k for `count` directions, padded to a multiple of 16 in all arrays; out[k] has `stride` floats.
void evaluate_terms(const Terms& t, const float* x, const float* y, const float* z, size_t count, float* out,
                    size_t stride);

// Sums over the texels of `rows` of light times `weight` (null: 1) times each of `count` terms, and times the cosine
// with n; or, `plain`, as they are.
void integrate_texels(const float* light, const float* weight, Vec3 n, const float* terms, int count, bool plain,
                      uint32_t rows, Vec3* sums);

// s_k at the texels of `rows` from its values at side x side nodes, [k][16]; out is [k][256].
void interpolate_terms(const float* nodes, const float* cardinal, int side, int count, uint32_t rows, float* out);

// eq. 6 and line 9: light summed over what is seen of a block, 12 numbers.
void sum_seen(const float* sums, const BlockChanges& changes, float scale, float* out);

}  // namespace lambent

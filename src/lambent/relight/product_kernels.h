#pragma once
// What products do to a block of texels, in SIMD lanes chosen at run time. Source: locally-adaptive-products,
// section 4.
#include <lambent/relight/products.h>

namespace lambent {

// A BRDF for one view: lambert + sum of colour[k] s_k(wi), s_k numbers, `count` of them.
struct Terms {
  enum class Kind { none, phong, ward, ggx, cook_torrance, measured } kind = Kind::none;
  int count = 0;  // ggx: 3 with a base below it; cook_torrance: 1 where all channels reflect alike
  Vec3 lambert{0}, colour[3];
  Mat3 frame;
  Vec3 wo, mirror;  // in the frame; in the world
  float exponent = 0;
  Vec2 alpha{1};
  Vec3 index{0};  // of refraction, of f0; 0: of an f0 of 1
  const MeasuredTable* table = nullptr;
};

// A row of the light's sums has twelve numbers, and begins on a cache line.
inline constexpr size_t sum_width = 16;
// Of 4, 16 and 64 samples the coarse light's rows begin at 0, 4 and 20.
inline constexpr size_t nodes_each[4] = {1, 4, 16, 64}, coarse_begin[4] = {0, 0, 4, 20}, coarse_each = 84;
inline constexpr int all_classes = 5;  // of so many samples, and of all

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

// Rows of M, [texel][16], of a block, to those times the cardinal functions of 4, 16 and 64 nodes, [84][16].
void fold_moments(const Cube& cube, const float* moments, float* coarse);

}  // namespace lambent

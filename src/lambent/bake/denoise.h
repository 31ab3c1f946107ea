#pragma once
// Noise of rows that neighbours do not share: each receiver's rays are its own, so errors of neighbours are almost
// independent, and where rows vary smoothly over a surface, neighbours hold what one receiver lacks. docs/sampling.md
// has what was tried.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace lambent {

// Where rows were received, and how noisy they are.
struct NoisyPlaces {
  std::span<const Vec3> places, normals;  // normals empty: in free space
  std::span<const uint8_t> left_out;      // 1: tells nothing (buried) and is left as it is; empty: none
  std::span<const uint32_t> measured;     // some of the places, ascending,
  std::span<const float> variance;        // and the squared error expected of their rows there
  // Where a rank (core/ranks.h) has rows of its own alone, those of Shares(places, denoise_grain): brings those that
  // `asked` says; called by all ranks. Of `out` each then has its own, and there are no more rows.
  std::function<void(const std::vector<uint8_t>& asked)> ask{};
};
inline constexpr size_t denoise_grain = 64;

// Working memory a place, beside rows.
inline constexpr size_t denoise_bytes = 128;

// Local linear regression over neighbours on the same surface, weighed by distance and by what their rows differ beyond
// the noise, at two strengths; which of them, or the row as it is, is chosen by its unbiased risk (Stein's) among
// neighbours. rows is [place][width], width a multiple of lane_multiple (kernels.h); so is out, another array. `more`
// are other rows of the same shape: changed in place by the same weights, so that rows that sum to `rows` sum to `out`.
// The result does not depend on threads. Errors: cancelled.
Result<void> denoise(const NoisyPlaces& noisy, const float* rows, size_t width, float* out,
                     std::span<float* const> more = {}, Progress* progress = nullptr);

}  // namespace lambent

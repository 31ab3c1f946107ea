#pragma once
// What objects hide from a tile of receivers, in SIMD lanes chosen at run time.
#include <lambent/relight/moving.h>

namespace lambent {

// What a point's value is mixed of, by receiver: mix_shells() in lanes.
struct TileMix {
  alignas(64) float u[sh_tile], v[sh_tile], near[sh_tile], far[sh_tile];
  alignas(64) int32_t low[sh_tile], high[sh_tile];  // the first of four points on either shell
};

// x, y, z: from the object's middle, in its own axes and in its own size.
void mix_tile(const Shells& shells, const float* log_radii, const float* x, const float* y, const float* z,
              TileMix& mix);

// rows[i * stride + k]: what is hidden from receiver i, for those of `wanted`; values are of points, `stride` apart, a
// multiple of 16, on cache lines.
void hidden_of_tile(const TileMix& mix, const uint8_t* wanted, size_t side, const float* values, size_t stride,
                    float* rows);

// Both for an object where it stands: values mixed at as many places as `positions`, 0 where they are not wanted.
void rows_of_tile(const Shells& shells, const std::vector<float>& log_radii, const RigidPlace& place,
                  std::span<const float> values, size_t stride, std::span<const Vec3> positions, const uint8_t* wanted,
                  TileMix& mix, AlignedVector<float>& rows);

// factor[k * sh_tile + i] = (k = 0 ? all : 0) - rows[i * stride + k].
void factor_of_tile(const float* rows, size_t stride, size_t coefficients, float all, float* factor);

// rows[i * stride + k] = tile[k * sh_tile + i]; 0 from k = coefficients to stride, a multiple of 16.
void rows_from_tile(const float* tile, size_t coefficients, size_t stride, float* rows);

// open[i] *= sum over k < count of lobe[k * sh_tile + i] factor[k * sh_tile + i], within [0, 1].
void open_of_tile(const float* lobe, const float* factor, size_t count, float* open);

}  // namespace lambent

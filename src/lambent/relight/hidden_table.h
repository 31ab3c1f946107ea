#pragma once
// What an object hides of one light that is the same all over a scene, at the points of its shells: harmonics of H L,
// once a frame. Mixed at a receiver and met with its transfer T they are what the object takes from it, T . (H L), as
// the product (T H) . L is, to rounding; so where no other object is near there is no product left in the loop.
#include <lambent/relight/moving_kernels.h>

namespace lambent {

// Of 16 bits, scaled to the greatest of each group; a point lies beside the next one in its row of the square.
struct HiddenTable {
  int first_shell = 0, shells = 0;  // that it has; none where there is no table
  size_t stride = 0;                // coefficients of a group, padded to a multiple of 16
  size_t groups = 0;                // of red, green, blue by light; then, where `open`, of a light of 1
  bool open = false;
  int side = 0;              // of the square
  std::vector<float> scale;  // [group]: of values
  std::vector<float> outer;  // [shell of the object]: 1 within the object's sphere, else (sphere's radius / radius)^2
  AlignedVector<int32_t> values;  // [shell][row][column][group][coefficient]: this point, above it the next
  AlignedVector<float> plain;     // kept between frames, to make them
  size_t bytes() const { return values.size() * sizeof(int32_t) + plain.size() * sizeof(float); }
};
// Harmonics of `order` bands of the lights' products; `product` has the orders (order, object's, light's).
void make_hidden_table(const PlacedObject& object, const ShTileProduct& product, std::span<const MovingLight> lights,
                       bool open, int first_shell, int shells, HiddenTable& table);

// Of the receivers of a tile that `wanted` has: which points are mixed for each, how (pairs of 16 bits, whose sum is
// 32,767), and what their sum is times.
struct TableMix {
  alignas(64) int32_t low[sh_tile], high[sh_tile];  // where the first of four points on either shell begins
  alignas(64) int32_t weights[4][sh_tile];          // low and high by row of the square: [low 0, low 1, high 0, high 1]
  alignas(64) float factor[sh_tile];
};
void mix_table(const PlacedObject& object, const HiddenTable& table, const float* lanes, uint64_t wanted,
               TableMix& mix);

// The receivers of a tile that an object may hide something from: less than sqrt(reach) away, and not below the
// horizon.
uint64_t near_of_tile(const float* lanes, size_t count, Vec3 position, float radius, float reach);

// Rows of a tile's receivers, of either kind, `stride` apart and their channels `channel_stride`, on cache lines.
struct TableRows {
  const uint16_t* halves = nullptr;
  const float* floats = nullptr;
  size_t stride = 0, channel_stride = 0;
};
// A light as groups are: [r, g, b][coefficient, padded].
struct TableLight {
  const float* light = nullptr;
  const float* share = nullptr;  // [receiver]
};
// out[4 i + c] = row of channel c . (share light - what is hidden), for receivers that `asked` has; without a light
// less what is hidden alone.
void dot_table(const HiddenTable& table, size_t first_group, const TableMix& mix, uint64_t asked, const TableRows& rows,
               const TableLight& light, float* out);
// values = values * open + sums, of `count` receivers and the rest of their block; values are [block][r, g,
// b][receiver], sums those of dot_table().
void add_sums(const float* sums, const float* open, size_t count, float* values);
// out[i] = row . (a light of 1 that is hidden), of 9 coefficients; rows are 16 apart.
void dot_table_open(const HiddenTable& table, const TableMix& mix, uint64_t asked, const uint16_t* rows, float* out);

}  // namespace lambent

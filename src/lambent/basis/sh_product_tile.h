#pragma once
// Products of many functions on the sphere at once, a SIMD lane each: the sum over the tripling tensor (sh_product.h),
// which is sparse, with no search and no branch within a tile.
#include <lambent/basis/sh_product.h>

#include <map>
#include <memory>
#include <tuple>

namespace lambent {

// Functions in a tile; coefficient k of function i is at [k * sh_tile + i].
inline constexpr size_t sh_tile = 64;

// The tensor, put so that it is read once from end to end.
struct ShTileProduct {
  int order_a = 0, order_b = 0, order_c = 0;
  // Entries of one coefficient of a.
  struct Row {
    uint16_t i;      // of a
    uint16_t count;  // of entries
  };
  std::vector<uint16_t> rows_of;  // by coefficient of the product: how many rows
  std::vector<Row> rows;
  std::vector<uint16_t> j;  // of b, by entry
  std::vector<float> value;
};
// Orders 1 .. max_sh_order. Entries grow as the fifth power of the orders: from about order 9 on multiply_sh() is
// faster.
ShTileProduct make_sh_tile_product(int order_a, int order_b, int order_c);

// Tensors by their three orders, each made once.
class ShTileProducts {
 public:
  const ShTileProduct& make(int order_a, int order_b, int order_c);
  // Made before; any number of threads may ask.
  const ShTileProduct& at(int order_a, int order_b, int order_c) const {
    return *made_.at({order_a, order_b, order_c});
  }

 private:
  std::map<std::tuple<int, int, int>, std::unique_ptr<const ShTileProduct>> made_;
};

// The products' first order_c bands. All begin on a cache line; out may not overlap the others.
void multiply_sh_tile(const ShTileProduct& product, const float* a, const float* b, float* out);

// out[c * sh_tile + i] = sum over k < count of a[k * sh_tile + i] times light[k][c].
void dot_sh_tile(const float* a, std::span<const Vec3> light, float* out);

}  // namespace lambent

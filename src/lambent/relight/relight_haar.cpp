#include <lambent/relight/relight_haar.h>

#include <lambent/basis/haar.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/relight_haar.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef LAMBENT_RELIGHT_HAAR_COLUMNS
#define LAMBENT_RELIGHT_HAAR_COLUMNS
namespace lambent {
namespace {

// A column on its way through a chunk.
struct ColumnCursor {
  const uint8_t* at;
  uint64_t tiles;
  Vec3 color;
};
// So many go through a chunk together: each tile's sums are in the first cache for all of them, and that many streams
// are still fetched ahead.
constexpr size_t columns_together = 16;

}  // namespace
}  // namespace lambent
#endif

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A column's next tile, where it has one there, times its colour, onto [r, g, b][receiver in tile].
HWY_INLINE void AddTile(ColumnCursor& column, float* HWY_RESTRICT sums) {
  const hn::CappedTag<float, 16> d;
  const float r = column.color.x, g = column.color.y, b = column.color.z;
  const uint8_t* p = column.at;
  const size_t count = *p++;
  if (count == 0) {
    const auto vr = hn::Set(d, r), vg = hn::Set(d, g), vb = hn::Set(d, b);
    for (size_t i = 0; i < haar_tile; i += hn::Lanes(d), sums += hn::Lanes(d)) {
      const auto levels = hn::LoadU(hn::Rebind<int8_t, decltype(d)>(), reinterpret_cast<const int8_t*>(p) + i);
      const auto q = hn::ConvertTo(d, hn::PromoteTo(hn::Rebind<int32_t, decltype(d)>(), levels));
      hn::StoreU(hn::MulAdd(q, vr, hn::LoadU(d, sums)), d, sums);
      hn::StoreU(hn::MulAdd(q, vg, hn::LoadU(d, sums + haar_tile)), d, sums + haar_tile);
      hn::StoreU(hn::MulAdd(q, vb, hn::LoadU(d, sums + 2 * haar_tile)), d, sums + 2 * haar_tile);
    }
    column.at = p + haar_tile;
    return;
  }
  for (size_t i = 0; i < count; ++i, p += 2) {
    float* at = sums + p[0];
    const float q = float(int8_t(p[1]));
    at[0] += q * r, at[haar_tile] += q * g, at[2 * haar_tile] += q * b;
  }
  column.at = p;
}

// Adds columns, in their order, to the sums of a chunk: [tile][r, g, b][receiver].
void AddColumns(ColumnCursor* columns, size_t count, float* sums) {
  uint64_t tiles = 0;
  for (size_t i = 0; i < count; ++i) tiles |= columns[i].tiles;
  for (; tiles; tiles &= tiles - 1) {
    const int tile = std::countr_zero(tiles);
    for (size_t i = 0; i < count; ++i)
      if (columns[i].tiles >> tile & 1) AddTile(columns[i], sums + 3 * haar_tile * size_t(tile));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {
HWY_EXPORT(AddColumns);
}  // namespace

HaarTerms haar_terms(const HaarTransfer& t, std::span<const float> norms, const CubeLight& light, size_t count) {
  LAMBENT_CHECK(light.size == t.size && norms.size() == t.columns());
  const size_t channels = size_t(t.channels), width = t.light_columns();
  const size_t area = size_t(t.size) * size_t(t.size);
  std::vector<Vec3> all(6 * area);
  std::vector<float> face(area);
  HaarTree tree;
  // A square of side 1: the transform's coefficients are mean-like, and products of two sum to 1 / area of the texels'.
  for (int f = 0; f < 6; ++f)
    for (int c = 0; c < 3; ++c) {
      for (int row = 0; row < t.size; ++row)
        for (int column = 0; column < t.size; ++column)
          face[size_t(row) * size_t(t.size) + size_t(column)] = light.energy[cube_texel(t.size, f, column, row)][c];
      haar_transform(std::countr_zero(unsigned(t.size)), face, tree);
      for (size_t k = 0; k < area; ++k) all[size_t(f) * area + k][c] = tree.coefficients[k] * float(area);
    }
  std::vector<uint32_t> order;
  std::vector<float> weight(all.size());
  for (uint32_t k = 0; k < all.size(); ++k) {
    Vec3 change(0.0f);
    for (size_t c = 0; c < 3; ++c) change[int(c)] = all[k][int(c)] * norms[std::min(c, channels - 1) * width + k];
    weight[k] = length(change);
    if (weight[k] > 0) order.push_back(k);
  }
  if (count > 0 && count < order.size()) {
    std::nth_element(order.begin(), order.begin() + ptrdiff_t(count), order.end(),
                     [&](uint32_t a, uint32_t b) { return weight[a] != weight[b] ? weight[a] > weight[b] : a < b; });
    order.resize(count);
    std::sort(order.begin(), order.end());
  }
  HaarTerms out{std::move(order), {}};
  if (channels == 1) {
    for (uint32_t k : out.columns) out.values.push_back(all[k] * t.steps[k]);
    return out;
  }
  const std::vector<uint32_t> of_light = std::move(out.columns);
  out.columns.clear();
  for (size_t c = 0; c < channels; ++c)
    for (uint32_t k : of_light) {
      const size_t column = c * width + k;
      Vec3 value(0.0f);
      value[int(c)] = all[k][int(c)] * t.steps[column];
      out.columns.push_back(uint32_t(column)), out.values.push_back(value);
    }
  return out;
}

void relight(const HaarTransfer& t, const HaarTerms& light, Relit& out, HaarReading* reading) {
  out.rows = 1;
  out.values.resize((t.receivers + transfer_block - 1) / transfer_block * 3 * transfer_block);
  parallel_for(t.chunks(), 1, [&](size_t begin, size_t end) {
    thread_local std::vector<float> sums(3 * haar_chunk);
    const auto add_columns = HWY_DYNAMIC_DISPATCH(AddColumns);
    for (size_t chunk = begin; chunk < end; ++chunk) {
      const size_t first = chunk * haar_chunk, count = std::min(haar_chunk, t.receivers - first);
      std::fill(sums.begin(), sums.end(), 0.0f);
      ColumnCursor together[columns_together];
      size_t waiting = 0;
      for (size_t i = 0; i < light.columns.size(); ++i) {
        const auto column = t.column(chunk, light.columns[i]);
        if (column.empty()) continue;
        ColumnCursor& c = together[waiting++];
        c = {column.data() + sizeof c.tiles, 0, light.values[i]};
        std::memcpy(&c.tiles, column.data(), sizeof c.tiles);
        if (waiting == columns_together) add_columns(together, std::exchange(waiting, 0), sums.data());
      }
      add_columns(together, waiting, sums.data());
      for (size_t r = 0; r < (count + transfer_block - 1) / transfer_block * transfer_block; ++r) {
        const float* at = sums.data() + r / haar_tile * 3 * haar_tile + r % haar_tile;
        out.set(first + r, 0, r < count ? Vec3(at[0], at[haar_tile], at[2 * haar_tile]) : Vec3(0.0f));
      }
    }
  });
  if (!reading) return;
  *reading = {light.columns.size() / size_t(t.channels), 0};
  for (size_t chunk = 0; chunk < t.chunks(); ++chunk)
    for (uint32_t c : light.columns) reading->bytes += t.column(chunk, c).size();
}

}  // namespace lambent
#endif  // HWY_ONCE

#include <lambent/relight/relight_haar.h>

#include <lambent/basis/haar.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <numeric>

namespace lambent {
namespace {

struct alignas(16) HaarSum {
  float value[4];
};

// Adds a column, scaled, to the sums of a chunk.
void add_column(std::span<const uint8_t> bytes, Vec3 scale, HaarSum* sums) {
  const float by[4] = {scale.x, scale.y, scale.z, 0};
  HaarSum* at = sums - 1;
  const uint8_t* const end = bytes.data() + bytes.size();
  for (const uint8_t* p = bytes.data(); p != end; p += 2) {
    at += p[0];
    const float q = float(int8_t(p[1]));
    for (int k = 0; k < 4; ++k) at->value[k] += q * by[k];
  }
}

}  // namespace

HaarTerms haar_terms(const HaarTransfer& t, std::span<const float> norms, const CubeLight& light, size_t count) {
  LAMBENT_CHECK(light.size == t.size && norms.size() == t.columns());
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
    weight[k] = length(all[k]) * norms[k];
    if (weight[k] > 0) order.push_back(k);
  }
  if (count > 0 && count < order.size()) {
    std::nth_element(order.begin(), order.begin() + ptrdiff_t(count), order.end(),
                     [&](uint32_t a, uint32_t b) { return weight[a] != weight[b] ? weight[a] > weight[b] : a < b; });
    order.resize(count);
    std::sort(order.begin(), order.end());
  }
  HaarTerms out{std::move(order), {}};
  for (uint32_t k : out.columns) out.values.push_back(all[k] * t.steps[k]);
  return out;
}

void relight(const HaarTransfer& t, const HaarTerms& light, Relit& out, size_t* read) {
  out.rows = 1;
  out.values.resize((t.receivers + transfer_block - 1) / transfer_block * 3 * transfer_block);
  std::atomic<size_t> bytes{0};
  parallel_for(t.chunks(), 1, [&](size_t begin, size_t end) {
    thread_local std::vector<HaarSum> sums(haar_chunk);
    for (size_t chunk = begin; chunk < end; ++chunk) {
      const size_t first = chunk * haar_chunk, count = std::min(haar_chunk, t.receivers - first);
      std::fill_n(sums.begin(), count, HaarSum{});
      size_t here = 0;
      for (size_t i = 0; i < light.columns.size(); ++i) {
        const std::span<const uint8_t> column = t.column(chunk, light.columns[i]);
        add_column(column, light.values[i], sums.data()), here += column.size();
      }
      bytes += here;
      for (size_t r = 0; r < (count + transfer_block - 1) / transfer_block * transfer_block; ++r)
        out.set(first + r, 0, r < count ? Vec3(sums[r].value[0], sums[r].value[1], sums[r].value[2]) : Vec3(0.0f));
    }
  });
  if (read) *read += bytes;
}

}  // namespace lambent

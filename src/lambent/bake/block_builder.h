#pragma once
// Rows of a sparse matrix while rays meet their entries (gather.cpp, rooms.cpp).
#include <lambent/bake/gather.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/shared_exponent.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

namespace lambent {

// A block's entries as its rays meet them, merged by row and column. A table of the columns that the block has met
// finds an entry without searching, and stays in cache however many receivers there are; what an earlier row or block
// left in it is told by its number.
class BlockBuilder {
 public:
  explicit BlockBuilder(size_t column_limit) : column_bits_(std::bit_width(column_limit)), places_(size_t{1} << 12) {}

  void begin_block() {
    if (++block_ == most_blocks) std::fill(places_.begin(), places_.end(), Place{}), block_ = 1;
    row_ = 0;
    entries_.clear(), row_ends_.clear(), columns_.clear(), counts_.clear();
  }
  void begin_row() { stamp_ = block_ * uint32_t(gather_block) + row_++; }
  void prefetch(uint32_t column) const { __builtin_prefetch(&places_[start(column)]); }
  void end_row() { row_ends_.push_back(uint32_t(entries_.size())); }

  void add(uint32_t column, Vec3 weight) {
    Place* place = find(column);
    if (place->stamp == stamp_ && place->column == column) {
      entries_[place->entry].weight += weight;
      return;
    }
    if (place->stamp / gather_block != block_) {
      if (2 * columns_.size() >= places_.size()) grow(), place = find(column);
      place->column = column, place->local = uint32_t(columns_.size());
      columns_.push_back(column), counts_.push_back(0);
    }
    ++counts_[place->local];
    place->stamp = stamp_, place->entry = uint32_t(entries_.size());
    entries_.push_back({place->local, weight});
  }

  // Regroups the rows by columns, which rise: a counting sort, which keeps the rows of a column in order.
  void finish(int channels, float unit, SparseBlock& out) {
    sort_columns();
    out.row_count = row_ends_.size();
    out.columns.resize(columns_.size()), out.ends.resize(columns_.size());
    uint32_t start = 0;
    for (size_t k = 0; k < keys_.size(); ++k) {
      const auto local = uint32_t(keys_[k]);
      out.columns[k] = columns_[local];
      out.ends[k] = start, start += counts_[local];
      counts_[local] = uint32_t(k);  // from here on, its place among the columns
    }
    out.rows.resize(entries_.size());
    floats_.resize(entries_.size() * size_t(channels));
    for (size_t row = 0, i = 0; row < row_ends_.size(); ++row)
      for (; i < row_ends_[row]; ++i) {
        const size_t at = out.ends[counts_[entries_[i].local]]++;  // the end once all are placed
        out.rows[at] = uint8_t(row);
        const Vec3 weight = entries_[i].weight * unit;
        if (channels == 1) floats_[at] = weight.x;
        else
          round_shared(&weight.x, dither(out.columns[counts_[entries_[i].local]], uint32_t(row)).data(),
                       &floats_[3 * at]);
      }
    out.weights.resize(floats_.size());
    floats_to_halves(floats_.data(), floats_.size(), out.weights.data());
  }

 private:
  // Sixteen bytes, so that looking one up touches one cache line.
  struct alignas(16) Place {
    uint32_t column = 0;
    uint32_t stamp = 0;  // block and row that last met it; 0: none
    uint32_t local = 0;  // its number among that block's columns
    uint32_t entry = 0;
  };
  struct Entry {
    uint32_t local;
    Vec3 weight;
  };
  static constexpr uint32_t most_blocks = UINT32_MAX / uint32_t(gather_block);

  // Even over rows and columns; by no more than these, so that the work's order makes no difference.
  static std::array<float, 3> dither(uint32_t column, uint32_t row) {
    const uint64_t h = hash64(column, row);
    return {float(h & 0xffff) * 0x1p-16f, float(h >> 16 & 0xffff) * 0x1p-16f, float(h >> 32 & 0xffff) * 0x1p-16f};
  }

  size_t start(uint32_t column) const {
    return size_t(column * 0x9e3779b1u) >> (32 - std::countr_zero(places_.size()));  // Knuth, TAOCP 3, section 6.4
  }
  // Where the block has the column, or a place for it.
  Place* find(uint32_t column) {
    for (size_t at = start(column);; at = (at + 1) & (places_.size() - 1)) {
      Place& place = places_[at];
      if (place.stamp / gather_block != block_ || place.column == column) return &place;
    }
  }
  void grow() {
    std::vector<Place> old(2 * places_.size());
    old.swap(places_);
    for (const Place& place : old)
      if (place.stamp / gather_block == block_) *find(place.column) = place;
  }

  // keys_: column and local number of each column of the block, by column. By their digits, from the last one on.
  void sort_columns() {
    constexpr size_t digit = 11, values = size_t{1} << digit;
    keys_.resize(columns_.size());
    for (uint32_t k = 0; k < columns_.size(); ++k) keys_[k] = uint64_t(columns_[k]) << 32 | k;
    if (keys_.size() < 256) return std::sort(keys_.begin(), keys_.end());
    other_.resize(keys_.size());
    for (size_t shift = 32; shift < 32 + column_bits_; shift += digit) {
      uint32_t at[values] = {};
      for (uint64_t key : keys_) ++at[key >> shift & (values - 1)];
      for (uint32_t sum = 0; uint32_t & a : at) {
        const uint32_t count = a;
        a = sum, sum += count;
      }
      for (uint64_t key : keys_) other_[at[key >> shift & (values - 1)]++] = key;
      keys_.swap(other_);
    }
  }

  size_t column_bits_;
  uint32_t row_ = 0, block_ = 0, stamp_ = 0;
  std::vector<Place> places_;
  std::vector<Entry> entries_;
  std::vector<uint32_t> row_ends_, columns_, counts_;
  std::vector<uint64_t> keys_, other_;
  std::vector<float> floats_;
};

}  // namespace lambent

#pragma once
// What each receiver sees of the sky, at the texels of a cubemap, as run ends inside each block: lossless. Light, view
// and materials stay free. Source: locally-adaptive-products, section 4.2.
//
// Levels go from 0, blocked, to the highest, clear: 1 for binary visibility, 2^bits - 1 for shares. Texels whose centre
// lies on or below the receiver's horizon (n . w <= 0) are blocked.
#include <lambent/basis/cubemap.h>
#include <lambent/core/result.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace lambent {

// Of a level.
inline constexpr int max_visibility_bits = 8;

// What all receivers see.
struct Visibility {
  int size = 0;  // of the cube, texels a side of a face
  int bits = 1;  // 1, or 2 to 8
  size_t receivers = 0;
  // By receiver, one after another: two bits a block (BlockSight), block 0 in the lowest of the first byte, padded to a
  // byte; then each mixed block's changes: their number as a base-128 varint, then where, a byte each, rising; then,
  // with more than one bit, the new level at each, a byte. Before its first texel a block's level is 0.
  std::span<const uint8_t> data;
  std::vector<uint64_t> begin;          // by receiver, and the end: places in `data`
  std::shared_ptr<const void> storage;  // keeps `data` alive

  int top() const { return (1 << bits) - 1; }
  int blocks() const { return cube_blocks(size); }
  size_t flag_bytes() const { return size_t(blocks() + 3) / 4; }
  size_t bytes() const { return data.size() + begin.size() * sizeof(uint64_t); }
};

// Of a block of texels: nothing is seen, or all, or part.
enum class BlockSight : uint8_t { blocked, clear, mixed };

// Base-128: seven bits a byte, lowest first, the top bit set on all but the last.
void append_varint(std::vector<uint8_t>& out, uint64_t value);
// Advances `at`. False where the bytes end too soon or the number has more than 64 bits.
bool read_varint(std::span<const uint8_t> bytes, size_t& at, uint64_t& value);

// Appends one receiver's record; levels has cube_texels() values up to top().
void encode_visibility(int size, int bits, std::span<const uint8_t> levels, std::vector<uint8_t>& out);

// Changes of a mixed block: where[i] the first texel of level[i]; level is null for binary ones, whose levels are 1, 0,
// 1, ...
struct BlockChanges {
  const uint8_t* where = nullptr;
  const uint8_t* level = nullptr;
  int count = 0;
  int level_after(int i) const { return level ? level[i] : 1 - (i & 1); }
};

// Reads one receiver's blocks in order.
class VisibilityReader {
 public:
  VisibilityReader(const Visibility& v, size_t receiver)
      : flags_(v.data.data() + v.begin[receiver]), at_(flags_ + v.flag_bytes()), binary_(v.bits == 1) {}
  BlockSight sight(int block) const { return BlockSight(flags_[block >> 2] >> (block & 3) * 2 & 3); }
  // Of the next mixed block.
  BlockChanges next() {
    int count = *at_ & 127;
    if (*at_++ & 128) count |= int(*at_++) << 7;
    BlockChanges c{at_, binary_ ? nullptr : at_ + count, count};
    at_ += binary_ ? count : 2 * count;
    return c;
  }

 private:
  const uint8_t* flags_;
  const uint8_t* at_;
  bool binary_;
};

// All levels of one receiver.
void decode_visibility(const Visibility& v, size_t receiver, std::span<uint8_t> levels);

// Whether data holds what its begins promise, so that the reader may trust it: the first thing done with a stranger's
// file.
Result<void> check_visibility(const Visibility& v, const std::string& where);

// One owner of pieces that were encoded apart, in the order of receivers; `lengths` are of their records.
Visibility make_visibility(int size, int bits, std::vector<std::vector<uint8_t>> pieces,
                           std::span<const uint32_t> lengths);

// Numbers for tables: shares of blocks by sight, and mean changes a mixed block.
struct VisibilityStatistics {
  double blocked = 0, clear = 0, mixed = 0, changes = 0;
};
VisibilityStatistics visibility_statistics(const Visibility& v);

}  // namespace lambent

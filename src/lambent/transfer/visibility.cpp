// Follows: locally-adaptive-products, section 4.2 (changes of visibility in each block, base-128 numbers).
#include <lambent/core/check.h>
#include <lambent/transfer/visibility.h>

#include <algorithm>

namespace lambent {

void append_varint(std::vector<uint8_t>& out, uint64_t value) {
  for (; value >= 128; value >>= 7) out.push_back(uint8_t(value | 128));
  out.push_back(uint8_t(value));
}

bool read_varint(std::span<const uint8_t> bytes, size_t& at, uint64_t& value) {
  value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    if (at >= bytes.size()) return false;
    const uint64_t byte = bytes[at++];
    if (shift == 63 && byte > 1) return false;
    value |= (byte & 127) << shift;
    if (byte < 128) return true;
  }
  return false;
}

void encode_visibility(int size, int bits, std::span<const uint8_t> levels, std::vector<uint8_t>& out) {
  const int blocks = cube_blocks(size), top = (1 << bits) - 1;
  LAMBENT_CHECK(levels.size() == cube_texels(size));
  const size_t flags = out.size();
  out.resize(flags + size_t(blocks + 3) / 4, 0);
  for (int b = 0; b < blocks; ++b) {
    const uint8_t* level = levels.data() + size_t(b) * block_texels;
    uint8_t where[block_texels], after[block_texels];
    int count = 0, last = 0;
    for (int t = 0; t < block_texels; ++t)
      if (level[t] != last) where[count] = uint8_t(t), after[count] = level[t], last = level[t], ++count;
    const BlockSight sight = count == 0                                     ? BlockSight::blocked
                           : count == 1 && where[0] == 0 && after[0] == top ? BlockSight::clear
                                                                            : BlockSight::mixed;
    out[flags + size_t(b / 4)] |= uint8_t(int(sight) << b % 4 * 2);
    if (sight != BlockSight::mixed) continue;
    append_varint(out, uint64_t(count));
    out.insert(out.end(), where, where + count);
    if (bits > 1) out.insert(out.end(), after, after + count);
  }
}

void decode_visibility(const Visibility& v, size_t receiver, std::span<uint8_t> levels) {
  LAMBENT_CHECK(levels.size() == cube_texels(v.size));
  VisibilityReader reader(v, receiver);
  for (int b = 0; b < v.blocks(); ++b) {
    uint8_t* level = levels.data() + size_t(b) * block_texels;
    const BlockSight sight = reader.sight(b);
    if (sight != BlockSight::mixed) {
      std::fill(level, level + block_texels, uint8_t(sight == BlockSight::clear ? v.top() : 0));
      continue;
    }
    const BlockChanges c = reader.next();
    int t = 0, now = 0;
    for (int i = 0; i < c.count; ++i) {
      for (; t < c.where[i]; ++t) level[t] = uint8_t(now);
      now = c.level_after(i);
    }
    for (; t < block_texels; ++t) level[t] = uint8_t(now);
  }
}

Result<void> check_visibility(const Visibility& v, const std::string& where) {
  LAMBENT_CHECK(is_cube_size(v.size) && v.bits >= 1 && v.bits <= max_visibility_bits &&
                v.begin.size() == v.receivers + 1);
  if (v.begin[0] != 0 || v.begin[v.receivers] != v.data.size())
    return Error{where, "visibility holds more or fewer bytes than its receivers have"};
  for (size_t r = 0; r < v.receivers; ++r) {
    const Error bad{where, "the visibility of receiver " + std::to_string(r) + " is broken"};
    if (v.begin[r] > v.begin[r + 1] || v.begin[r + 1] > v.data.size()) return bad;
    const std::span<const uint8_t> record = v.data.subspan(v.begin[r], v.begin[r + 1] - v.begin[r]);
    if (record.size() < v.flag_bytes()) return bad;
    size_t at = v.flag_bytes();
    for (int b = 0; b < v.blocks(); ++b) {
      const int sight = record[size_t(b / 4)] >> b % 4 * 2 & 3;
      if (sight > int(BlockSight::mixed)) return bad;
      if (sight != int(BlockSight::mixed)) continue;
      uint64_t count = 0;
      const size_t before = at;
      if (!read_varint(record, at, count) || count < 1 || count > uint64_t(block_texels) ||
          at - before != (count < 128 ? 1u : 2u))
        return bad;
      if (record.size() - at < count * (v.bits > 1 ? 2 : 1)) return bad;
      for (size_t i = 0; i < count; ++i) {
        if (i > 0 && record[at + i] <= record[at + i - 1]) return bad;
        if (v.bits > 1 && record[at + count + i] > v.top()) return bad;
      }
      at += count * (v.bits > 1 ? 2 : 1);
    }
    if (at != record.size()) return bad;
  }
  return {};
}

Visibility make_visibility(int size, int bits, std::vector<std::vector<uint8_t>> pieces,
                           std::span<const uint32_t> lengths) {
  Visibility v;
  v.size = size, v.bits = bits, v.receivers = lengths.size();
  v.begin.reserve(lengths.size() + 1), v.begin.push_back(0);
  for (uint32_t length : lengths) v.begin.push_back(v.begin.back() + length);
  auto bytes = std::make_shared<std::vector<uint8_t>>();
  bytes->reserve(v.begin.back());
  for (std::vector<uint8_t>& piece : pieces) {
    bytes->insert(bytes->end(), piece.begin(), piece.end());
    std::vector<uint8_t>().swap(piece);
  }
  LAMBENT_CHECK(bytes->size() == v.begin.back());
  v.data = *bytes, v.storage = std::move(bytes);
  return v;
}

VisibilityStatistics visibility_statistics(const Visibility& v) {
  double by_sight[3] = {0, 0, 0}, changes = 0;
  for (size_t r = 0; r < v.receivers; ++r) {
    VisibilityReader reader(v, r);
    for (int b = 0; b < v.blocks(); ++b) {
      const BlockSight sight = reader.sight(b);
      ++by_sight[int(sight)];
      if (sight == BlockSight::mixed) changes += reader.next().count;
    }
  }
  const double all = std::max(1.0, double(v.receivers) * v.blocks());
  return {by_sight[0] / all, by_sight[1] / all, by_sight[2] / all, by_sight[2] > 0 ? changes / by_sight[2] : 0};
}

}  // namespace lambent

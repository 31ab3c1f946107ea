#include <lambent/core/huffman.h>

#include <algorithm>
#include <array>
#include <queue>

namespace lambent {
namespace {

constexpr int longest = 15;
constexpr size_t header = 128;
using Lengths = std::array<uint8_t, 256>;

// Of a Huffman tree; beyond `longest` frequencies are made more alike and it is tried again.
Lengths code_lengths(std::array<uint64_t, 256> often) {
  struct Node {
    uint64_t often;
    int index;
    bool operator>(const Node& o) const { return often != o.often ? often > o.often : index > o.index; }
  };
  for (;;) {
    std::priority_queue<Node, std::vector<Node>, std::greater<>> least;
    for (int b = 0; b < 256; ++b)
      if (often[size_t(b)]) least.push({often[size_t(b)], b});
    Lengths lengths{};
    if (least.size() == 1) lengths[size_t(least.top().index)] = 1;
    std::array<int, 512> parent;
    parent.fill(-1);
    int next = 256;
    while (least.size() > 1) {
      const Node a = least.top();
      least.pop();
      const Node b = least.top();
      least.pop();
      parent[size_t(a.index)] = parent[size_t(b.index)] = next;
      least.push({a.often + b.often, next++});
    }
    int most = 0;
    for (size_t b = 0; b < 256; ++b) {
      int depth = 0;
      for (int at = parent[b]; at >= 0; at = parent[size_t(at)]) ++depth;
      most = std::max(most, depth);
      if (depth > 0) lengths[b] = uint8_t(std::min(depth, 255));
    }
    if (most <= longest) return lengths;
    for (uint64_t& n : often)
      if (n) n = n / 2 + 1;
  }
}

// The first code of each length and where its bytes begin among all, by length and then by value.
struct Canonical {
  std::array<uint32_t, longest + 2> first{}, count{}, begin{};
  std::vector<uint8_t> bytes;
  bool whole = true;  // no code is left over, and none is there twice
  explicit Canonical(const Lengths& lengths) {
    for (uint8_t l : lengths) ++count[l];
    count[0] = 0;
    uint32_t code = 0, at = 0;
    for (size_t l = 1; l <= longest; ++l) {
      code = (code + count[l - 1]) << 1, first[l] = code, begin[l] = at, at += count[l];
      if (code + count[l] > (1u << l)) whole = false;
      for (size_t b = 0; b < 256; ++b)
        if (lengths[b] == l) bytes.push_back(uint8_t(b));
    }
  }
};

}  // namespace

std::vector<uint8_t> huffman_encode(std::span<const uint8_t> bytes) {
  std::array<uint64_t, 256> often{};
  for (uint8_t b : bytes) ++often[b];
  const Lengths lengths = code_lengths(often);
  Canonical canonical(lengths);
  std::array<uint32_t, 256> codes{};
  for (uint8_t b : canonical.bytes) codes[b] = canonical.first[lengths[b]]++;
  std::vector<uint8_t> out(header);
  for (size_t b = 0; b < 256; ++b) out[b / 2] |= uint8_t(lengths[b] << (b % 2 * 4));
  uint32_t bits = 0;
  int count = 0;
  for (uint8_t b : bytes) {
    bits = bits << lengths[b] | codes[b], count += lengths[b];
    for (; count >= 8; count -= 8) out.push_back(uint8_t(bits >> (count - 8)));
  }
  if (count > 0) out.push_back(uint8_t(bits << (8 - count)));
  return out;
}

std::optional<std::vector<uint8_t>> huffman_decode(std::span<const uint8_t> coded, size_t count) {
  if (coded.size() < header || count > (coded.size() - header) * 8) return std::nullopt;
  Lengths lengths;
  for (size_t b = 0; b < 256; ++b) lengths[b] = coded[b / 2] >> (b % 2 * 4) & 15;
  const Canonical canonical(lengths);
  if (!canonical.whole) return std::nullopt;
  std::vector<uint8_t> out;
  out.reserve(count);
  size_t at = header;
  uint32_t left = 0;  // bits of the byte before `at`
  while (out.size() < count) {
    uint32_t code = 0;
    for (size_t l = 1;; ++l) {
      if (l > longest) return std::nullopt;
      if (left == 0) {
        if (at == coded.size()) return std::nullopt;
        ++at, left = 8;
      }
      code = code << 1 | (coded[at - 1] >> --left & 1u);
      if (code - canonical.first[l] < canonical.count[l] && code >= canonical.first[l]) {
        out.push_back(canonical.bytes[canonical.begin[l] + code - canonical.first[l]]);
        break;
      }
    }
  }
  const bool zeros = left == 0 || (coded[at - 1] & ((1u << left) - 1)) == 0;
  if (at != coded.size() || !zeros) return std::nullopt;
  return out;
}

}  // namespace lambent

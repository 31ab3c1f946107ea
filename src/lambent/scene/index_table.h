#pragma once
#include <lambent/core/random.h>
#include <lambent/scene/scene.h>

#include <bit>

namespace lambent {

// Open-addressing hash table of indices of items that live elsewhere: the caller hashes and compares the items.
class IndexTable {
 public:
  // `expected`: as many items as will ever be inserted.
  explicit IndexTable(size_t expected) : slots_(std::bit_ceil(std::max<size_t>(2 * expected, 16)), none) {}

  // The index of the item that `equal(index)` accepts, or `none`.
  template <class Equal>
  uint32_t find(uint64_t hash, Equal equal) const {
    return slots_[place(hash, equal)];
  }

  // As find; where there is none, inserts `index` and returns it.
  template <class Equal>
  uint32_t find_or_insert(uint64_t hash, uint32_t index, Equal equal) {
    uint32_t& slot = slots_[place(hash, equal)];
    if (slot == none) slot = index;
    return slot;
  }

 private:
  template <class Equal>
  size_t place(uint64_t hash, Equal equal) const {
    size_t mask = slots_.size() - 1, i = size_t(hash) & mask;
    while (slots_[i] != none && !equal(slots_[i])) i = (i + 1) & mask;
    return i;
  }
  std::vector<uint32_t> slots_;
};

}  // namespace lambent

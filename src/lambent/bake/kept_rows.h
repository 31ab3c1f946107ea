#pragma once
// Hit rows kept for the bounces, as far as a budget goes. Which blocks are kept depends on the scheduling, the result
// does not: the others are traced again, alike.
#include <lambent/bake/gather.h>

#include <atomic>

namespace lambent {

// What the rows of a block may take at most, of receivers that send so many rays into a scene of so many receivers.
size_t most_bytes(size_t rays, size_t receivers, int channels);

// Whether a block can be multiplied: its entries in order, and of receivers that there are.
bool is_sound(const SparseBlock& block, size_t receivers);

class KeptRows {
 public:
  struct Block {
    SparseRows rows, half_rows;
  };

  // At most `budget` bytes of rows, of so many blocks. Address space is reserved at once and memory taken as rows come,
  // in large pages where the system has them: with pages of 4 KiB a tenth of a bake's time goes into the first touch of
  // each.
  KeptRows(size_t blocks, size_t budget, size_t most_bytes_a_block);
  ~KeptRows();
  KeptRows(const KeptRows&) = delete;
  KeptRows& operator=(const KeptRows&) = delete;

  // Copies the rows, unless they would exceed the budget. From any thread, once a block.
  bool keep(size_t block, const GatherBlock& rows);
  // Null where not kept.
  const Block* find(size_t block) const { return is_kept_[block] ? &blocks_[block] : nullptr; }
  size_t bytes() const { return used_; }
  size_t count() const;  // of blocks kept

 private:
  std::vector<Block> blocks_;
  std::vector<uint8_t> is_kept_;
  size_t reserved_ = 0;
  std::byte* memory_ = nullptr;
  std::atomic<size_t> used_{0};
};

}  // namespace lambent

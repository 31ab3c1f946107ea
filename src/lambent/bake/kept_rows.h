#pragma once
// Hit rows kept for the bounces: in memory as far as a budget goes, beyond it in a file. Which blocks are kept, and
// where, depends on the scheduling, the result does not: the others are traced again, alike.
#include <lambent/bake/gather.h>

#include <atomic>
#include <string>

namespace lambent {

// What the rows of a block may take at most, of receivers that send so many rays into a scene of so many receivers.
size_t most_bytes(size_t rays, size_t receivers, int channels);

// A block's rows as they are kept, in about half of what a SparseBlock takes: steps from column to column (seven bits a
// byte, lowest first), a byte an entry with its row and whether it is its column's last, and the weights.
void pack(const SparseBlock& block, std::vector<uint8_t>& out);
// False where the bytes are no block of receivers that there are, with weights for so many channels.
bool unpack(std::span<const uint8_t> bytes, size_t receivers, int channels, SparseBlock& out);

struct PackedBlock {
  std::vector<uint8_t> rows, half_rows;
};

class KeptRows {
 public:
  // At most `budget` bytes of rows in memory, of so many blocks; address space is reserved at once and memory taken as
  // rows come, in large pages where the system has them: with pages of 4 KiB a tenth of a bake's time goes into the
  // first touch of each. What does not fit goes into a file without a name in the folder `scratch`; "": nowhere.
  KeptRows(size_t blocks, size_t budget, size_t most_bytes_a_block, const std::string& scratch);
  ~KeptRows();
  KeptRows(const KeptRows&) = delete;
  KeptRows& operator=(const KeptRows&) = delete;

  // Copies the rows, unless there is room nowhere. From any thread, once a block.
  bool keep(size_t block, const PackedBlock& rows);
  // The rows of a block, `buffer` for those that come from the file. False where it is not kept.
  struct Block {
    std::span<const uint8_t> rows, half_rows;
  };
  bool find(size_t block, std::vector<uint8_t>& buffer, Block& out) const;
  size_t bytes() const { return used_; }        // in memory
  size_t file_bytes() const { return filed_; }  // beyond
  size_t count() const;                         // of blocks kept
  double fraction() const;                      // of all

 private:
  struct Place {
    size_t at = 0;
    uint32_t rows = 0, half_rows = 0;  // bytes
    enum class Where : uint8_t { nowhere, memory, file } where = Where::nowhere;
  };
  std::vector<Place> places_;
  size_t reserved_ = 0;
  std::byte* memory_ = nullptr;
  int file_ = -1;
  std::atomic<size_t> used_{0}, filed_{0};
  std::atomic<bool> file_full_{false};
};

}  // namespace lambent

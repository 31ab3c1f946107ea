#include <lambent/bake/kept_rows.h>

#include <sys/mman.h>

#include <algorithm>
#include <cstring>

namespace lambent {
namespace {

constexpr size_t large_page = size_t{1} << 21;

size_t padded(size_t bytes) { return (bytes + 7) / 8 * 8; }

size_t padded_bytes(const SparseBlock& s) {
  return padded(s.columns.size() * 4) + padded(s.ends.size() * 4) + padded(s.rows.size()) +
         padded(s.weights.size() * 2);
}

template <class T>
const T* copied(const std::vector<T>& from, std::byte*& to) {
  std::byte* const begin = to;
  if (!from.empty()) std::memcpy(begin, from.data(), from.size() * sizeof(T));
  to += padded(from.size() * sizeof(T));
  return reinterpret_cast<const T*>(begin);
}

SparseRows copied(const SparseBlock& s, std::byte*& to) {
  const auto *columns = copied(s.columns, to), *ends = copied(s.ends, to);
  const uint8_t* rows = copied(s.rows, to);
  return {s.row_count, {columns, ends, s.columns.size(), rows, copied(s.weights, to)}};
}

}  // namespace

size_t most_bytes(size_t rays, size_t receivers, int channels) {
  const size_t entries = gather_block * std::min(3 * rays, receivers);
  // An entry, a column of its own at worst, and half as much again by the half-sample rows.
  return 3 * entries / 2 * (9 + 2 * size_t(channels)) + 128;
}

bool is_sound(const SparseBlock& b, size_t receivers) {
  const size_t entries = b.rows.size();
  if (b.row_count > gather_block || b.ends.size() != b.columns.size() ||
      (b.ends.empty() ? entries != 0 : b.ends.back() != entries) || !std::is_sorted(b.ends.begin(), b.ends.end()))
    return false;
  if (b.weights.size() != entries && b.weights.size() != 3 * entries) return false;
  return std::all_of(b.columns.begin(), b.columns.end(), [&](uint32_t c) { return c < receivers; }) &&
         std::all_of(b.rows.begin(), b.rows.end(), [&](uint8_t r) { return r < b.row_count; });
}

KeptRows::KeptRows(size_t blocks, size_t budget, size_t most_bytes_a_block) : blocks_(blocks), is_kept_(blocks, 0) {
  const size_t most = blocks > 0 && most_bytes_a_block > SIZE_MAX / 2 / blocks ? SIZE_MAX / 2
                                                                               : blocks * most_bytes_a_block;
  reserved_ = std::min({budget, most, size_t{1} << 46}) / large_page * large_page;
  if (reserved_ == 0) reserved_ = std::min(budget, most) / 4096 * 4096;
  if (reserved_ == 0) return;
  void* p = ::mmap(nullptr, reserved_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (p == MAP_FAILED) {
    reserved_ = 0;  // no rows are kept; they are traced again each time
    return;
  }
  memory_ = static_cast<std::byte*>(p);
  ::madvise(p, reserved_, MADV_HUGEPAGE);
}

KeptRows::~KeptRows() {
  if (memory_) ::munmap(memory_, reserved_);
}

bool KeptRows::keep(size_t block, const GatherBlock& rows) {
  const size_t bytes = padded_bytes(rows.rows) + padded_bytes(rows.half_rows);
  size_t at = used_.load();
  do {
    if (bytes > reserved_ - at) return false;
  } while (!used_.compare_exchange_weak(at, at + bytes));
  std::byte* to = memory_ + at;
  blocks_[block] = {copied(rows.rows, to), copied(rows.half_rows, to)};
  is_kept_[block] = 1;
  return true;
}

size_t KeptRows::count() const { return size_t(std::count(is_kept_.begin(), is_kept_.end(), uint8_t(1))); }

}  // namespace lambent

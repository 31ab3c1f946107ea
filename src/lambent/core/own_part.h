#pragma once
// What no rank (ranks.h) has whole: each has room for all of it and has set a part of its own; what it has not set
// takes no memory. Of a file that is written together each writes its part.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <vector>

namespace lambent {

// Floats that are 0 until they are written to, and take memory from then on: other ranks' rows take none.
class ZeroPages {
 public:
  ZeroPages() = default;
  explicit ZeroPages(size_t count) : data_(static_cast<float*>(std::calloc(count + 64, sizeof(float)))), count_(count) {
    if (!data_) throw std::bad_alloc();
  }
  float* data() { return aligned(); }  // to a cache line
  const float* data() const { return aligned(); }
  size_t size() const { return data_ ? count_ : 0; }
  bool empty() const { return size() == 0; }
  // Floats [begin, end) are asked for no more: what they take is given back, by whole pages, and they are undefined.
  void forget(size_t begin, size_t end);

 private:
  struct Free {
    void operator()(float* p) const { std::free(p); }
  };
  float* aligned() const {
    return data_ ? reinterpret_cast<float*>((reinterpret_cast<uintptr_t>(data_.get()) + 63) / 64 * 64) : nullptr;
  }
  std::unique_ptr<float, Free> data_;
  size_t count_ = 0;
};

// While one lives, files that this thread writes take of `all` what each rank has: stretch i, bytes
// [ends[i - 1], ends[i]), is of rank i % ranks. Made by all ranks, with the same ends. Where not all of them see the
// file, the first one is handed the others' parts as it writes.
class OwnPart {
 public:
  OwnPart(std::span<const uint8_t> all, std::vector<size_t> ends, size_t ranks);
  ~OwnPart();
  OwnPart(const OwnPart&) = delete;
  OwnPart& operator=(const OwnPart&) = delete;

  const std::span<const uint8_t> all;
  const std::vector<size_t> ends;
  const size_t ranks;
};

}  // namespace lambent

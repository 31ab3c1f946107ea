#pragma once
// Bytes of a file that no rank (ranks.h) has whole: each has memory for all of them and has set a part of its own,
// which it writes where files are written together (WriteTogether); what it has not set takes no memory.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lambent {

// While one lives, files that this thread writes take of `all` what each rank has: rank k bytes [ends[k - 1], ends[k]).
// Made by all ranks, with the same ends. Where not all of them see the file, the first one is handed the others' parts
// as it writes.
class OwnPart {
 public:
  OwnPart(std::span<const uint8_t> all, std::vector<size_t> ends);
  ~OwnPart();
  OwnPart(const OwnPart&) = delete;
  OwnPart& operator=(const OwnPart&) = delete;

  const std::span<const uint8_t> all;
  const std::vector<size_t> ends;
};

}  // namespace lambent

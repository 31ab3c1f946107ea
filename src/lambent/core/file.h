#pragma once
#include <lambent/core/result.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lambent {

// A whole file mapped read-only; the bytes live as long as the object (copies share the mapping).
class MappedFile {
 public:
  // Errors: missing, a folder or no plain file, the system's.
  static Result<MappedFile> open(const std::string& path);
  // A copy of bytes that came from elsewhere, on a 64-byte boundary.
  static MappedFile copy_of(std::span<const uint8_t> bytes);
  std::span<const uint8_t> bytes() const { return {data_.get(), size_}; }

 private:
  std::shared_ptr<const uint8_t> data_;
  size_t size_ = 0;
};

// Whole file as bytes. Errors: missing, a folder, unreadable.
Result<std::vector<uint8_t>> read_file(const std::string& path);

// Writes all pieces to a temporary name beside `path`, flushes, and renames: the file is there whole or not at all.
// The temporary is removed on failure, and by remove_unfinished_files().
Result<void> write_file_atomically(const std::string& path, std::span<const std::span<const uint8_t>> pieces);
Result<void> write_file_atomically(const std::string& path, std::string_view text);

// Removes temporaries of writes in flight; safe to call from a signal handler.
void remove_unfinished_files();

// Lower-case extension without the dot: "A/B.GLB" -> "glb".
std::string file_extension(const std::string& path);

// XXH3-128 of the bytes, 32 hexadecimal digits: names an input in a baked file's provenance.
std::string content_hash(std::span<const uint8_t> bytes);

}  // namespace lambent

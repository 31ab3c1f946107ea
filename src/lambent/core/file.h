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
  // Part of a file.
  struct Part {
    std::string path;
    size_t offset = 0, bytes = 0;
  };
  // Parts one after another: mapped side by side where each begins at a page and each but the last ends at one, else
  // copied. Errors: as open(); a file that is shorter than its part.
  static Result<MappedFile> open_parts(std::span<const Part> parts);
  std::span<const uint8_t> bytes() const { return {data_.get(), size_}; }

 private:
  std::shared_ptr<const uint8_t> data_;
  size_t size_ = 0;
};

// While one lives, files are read into memory where they would be mapped: who shows one for hours is not ended by
// another program that cuts it short.
class FilesInMemory {
 public:
  FilesInMemory();
  ~FilesInMemory();
  FilesInMemory(const FilesInMemory&) = delete;
  FilesInMemory& operator=(const FilesInMemory&) = delete;
};

// Whole file as bytes. Errors: missing, a folder, unreadable.
Result<std::vector<uint8_t>> read_file(const std::string& path);

// Writes all pieces to a temporary name beside `path`, flushes, and renames: the file is there whole or not at all.
// What it replaces hands on its mode, and of a link it is the file that is replaced. The temporary is removed on
// failure, and by remove_unfinished_files(); those of processes that were killed are, by the next write of the same
// name. Errors: the system's; a folder, something that is no plain file; a file that is being read (ReadLog).
Result<void> write_file_atomically(const std::string& path, std::span<const std::span<const uint8_t>> pieces);
Result<void> write_file_atomically(const std::string& path, std::string_view text);

// While one lives, what this thread writes waits under temporary names; commit() makes all of it appear together, even
// where the process is killed meanwhile. The last file written is the one that the others belong to: it is never there
// beside others than its own. Without commit() nothing appears. One that is made while another lives hands its files to
// that.
struct WrittenFile;
class FileSet {
 public:
  FileSet();
  ~FileSet();
  FileSet(const FileSet&) = delete;
  FileSet& operator=(const FileSet&) = delete;
  // A file that goes when the others appear.
  void remove(const std::string& path) { removed_.push_back(path); }
  Result<void> commit();

 private:
  friend Result<void> write_file_atomically(const std::string&, std::span<const std::span<const uint8_t>>);
  FileSet* outer_;
  std::vector<std::unique_ptr<WrittenFile>> files_;
  std::vector<std::string> removed_;
};

// Removes temporaries of writes in flight; safe to call from a signal handler.
void remove_unfinished_files();
// Temporaries in a folder whose writers are gone, of the file `name` or of all. Writers hold a lock on theirs.
std::vector<std::string> stale_temporaries(const std::string& folder, const std::string& name = {});
void remove_stale_temporaries(const std::string& path);

// A file that was read, as the system knows it.
struct ReadFile {
  std::string path;
  uint64_t device, inode;
};
// Knows what the process opened for reading since it was made, and, while it lives, keeps that from being written over.
class ReadLog {
 public:
  ReadLog();
  ~ReadLog();
  ReadLog(const ReadLog&) = delete;
  ReadLog& operator=(const ReadLog&) = delete;
  std::vector<ReadFile> files() const;
  static void note(const std::string& path, uint64_t device, uint64_t inode);  // one file, in all logs

 private:
  friend bool is_being_read(const std::string&);
  friend void allow_replacing(const std::string&);
  std::vector<ReadFile> files_;
};
bool is_being_read(const std::string& path);
// An error where it is.
Result<void> check_replaces_no_input(const std::string& path);
// Of a file that is to take its own place.
void allow_replacing(const std::string& path);

// The folder that a file is in; "." where its path says none.
std::string folder_of(const std::string& path);
// Lower-case extension without the dot: "A/B.GLB" -> "glb".
std::string file_extension(const std::string& path);

// XXH3-128 of the bytes, 32 hexadecimal digits: names an input in a baked file's provenance.
std::string content_hash(std::span<const uint8_t> bytes);

}  // namespace lambent

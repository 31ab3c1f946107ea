#include <lambent/core/aligned.h>
#include <lambent/core/file.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <mutex>

namespace lambent {
namespace {

std::atomic<int> in_memory = 0;

std::mutex logs_mutex;
std::vector<ReadLog*> logs;

std::string system_message() { return std::strerror(errno); }

// Opens for reading; refuses folders and other things that are not plain files (a FIFO would hang the reader).
Result<int> open_plain_file(const std::string& path, size_t& size) {
  int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return Error{path, errno == ENOENT ? "no such file" : system_message()};
  struct stat info;
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    std::string why = S_ISDIR(info.st_mode) ? "is a folder" : "is not a plain file";
    ::close(fd);
    return Error{path, why};
  }
  size = size_t(info.st_size);
  ReadLog::note(path, info.st_dev, info.st_ino);
  return fd;
}

}  // namespace

void ReadLog::note(const std::string& path, uint64_t device, uint64_t inode) {
  std::lock_guard lock(logs_mutex);
  for (ReadLog* log : logs) log->files_.push_back({path, device, inode});
}

FilesInMemory::FilesInMemory() { ++in_memory; }
FilesInMemory::~FilesInMemory() { --in_memory; }

Result<MappedFile> MappedFile::open(const std::string& path) {
  MappedFile file;
  if (in_memory > 0) {
    auto bytes = read_file(path);
    return bytes ? Result<MappedFile>(copy_of(*bytes)) : bytes.error();
  }
  auto fd = open_plain_file(path, file.size_);
  if (!fd) return fd.error();
  if (file.size_ > 0) {
    size_t size = file.size_;
    void* p = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, *fd, 0);
    if (p == MAP_FAILED) {
      Error error{path, system_message()};
      ::close(*fd);
      return error;
    }
    file.data_ = std::shared_ptr<const uint8_t>(static_cast<const uint8_t*>(p),
                                                [size](const uint8_t* q) { ::munmap(const_cast<uint8_t*>(q), size); });
  }
  ::close(*fd);
  return file;
}

MappedFile MappedFile::copy_of(std::span<const uint8_t> bytes) {
  MappedFile file;
  file.size_ = bytes.size();
  if (bytes.empty()) return file;
  auto storage = std::make_shared<AlignedVector<uint8_t>>(bytes.begin(), bytes.end());
  file.data_ = std::shared_ptr<const uint8_t>(storage, storage->data());
  return file;
}

namespace {

bool is_mappable(std::span<const MappedFile::Part> parts) {
#ifdef __EMSCRIPTEN__  // where a mapping is a copy
  return false;
#else
  if (in_memory > 0) return false;
  const size_t page = size_t(::sysconf(_SC_PAGESIZE));
  return std::all_of(parts.begin(), parts.end(), [&](const MappedFile::Part& part) {
    return part.offset % page == 0 && (part.bytes % page == 0 || &part == &parts.back());
  });
#endif
}

bool read_whole(int fd, uint8_t* to, size_t bytes, size_t offset) {
  for (size_t done = 0; done < bytes;) {
    const ssize_t got = ::pread(fd, to + done, bytes - done, off_t(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    done += size_t(got);
  }
  return true;
}

}  // namespace

Result<MappedFile> MappedFile::open_parts(std::span<const MappedFile::Part> parts) {
  MappedFile file;
  for (const MappedFile::Part& part : parts) {
    if (part.bytes > SIZE_MAX / 2 - file.size_) return Error{part.path, "is too large"};
    file.size_ += part.bytes;
  }
  if (file.size_ == 0) return file;
  const bool mapped = is_mappable(parts);
  const size_t size = file.size_;
  if (mapped) {  // the addresses first, then a file over each part of them
    void* p = ::mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (p == MAP_FAILED) return Error{parts[0].path, system_message()};
    file.data_ = std::shared_ptr<const uint8_t>(static_cast<const uint8_t*>(p),
                                                [size](const uint8_t* q) { ::munmap(const_cast<uint8_t*>(q), size); });
  } else {
    auto storage = std::make_shared<AlignedVector<uint8_t>>(size);
    file.data_ = std::shared_ptr<const uint8_t>(storage, storage->data());
  }
  auto* to = const_cast<uint8_t*>(file.data_.get());
  for (const MappedFile::Part& part : parts) {
    size_t there = 0;
    auto fd = open_plain_file(part.path, there);
    if (!fd) return fd.error();
    std::string why;
    if (part.offset > there || part.bytes > there - part.offset) {
      why = "is truncated: has " + std::to_string(there) + " of " + std::to_string(part.offset + part.bytes) + " bytes";
    } else if (mapped) {
      if (part.bytes > 0 &&
          ::mmap(to, part.bytes, PROT_READ, MAP_PRIVATE | MAP_FIXED, *fd, off_t(part.offset)) == MAP_FAILED)
        why = system_message();
    } else if (!read_whole(*fd, to, part.bytes, part.offset)) {
      why = "could not be read whole";
    }
    ::close(*fd);
    if (!why.empty()) return Error{part.path, why};
    to += part.bytes;
  }
  return file;
}

Result<std::vector<uint8_t>> read_file(const std::string& path) {
  size_t size = 0;
  auto fd = open_plain_file(path, size);
  if (!fd) return fd.error();
  std::vector<uint8_t> bytes(size);
  const bool whole = read_whole(*fd, bytes.data(), size, 0);
  ::close(*fd);
  if (!whole) return Error{path, "could not be read whole"};
  return bytes;
}

ReadLog::ReadLog() {
  std::lock_guard lock(logs_mutex);
  logs.push_back(this);
}
ReadLog::~ReadLog() {
  std::lock_guard lock(logs_mutex);
  std::erase(logs, this);
}

std::vector<ReadFile> ReadLog::files() const {
  std::lock_guard lock(logs_mutex);
  return files_;
}

bool is_being_read(const std::string& path) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0) return false;
  std::lock_guard lock(logs_mutex);
  for (const ReadLog* log : logs)
    for (const ReadFile& file : log->files_)
      if (file.device == info.st_dev && file.inode == info.st_ino) return true;
  return false;
}

Result<void> check_replaces_no_input(const std::string& path) {
  if (!is_being_read(path)) return {};
  return Error{path, "cannot be written: this command reads it, and no output takes the place of an input"};
}

void allow_replacing(const std::string& path) {
  struct stat info;
  if (::stat(path.c_str(), &info) != 0) return;
  std::lock_guard lock(logs_mutex);
  for (ReadLog* log : logs)
    std::erase_if(log->files_,
                  [&](const ReadFile& file) { return file.device == info.st_dev && file.inode == info.st_ino; });
}

std::string folder_of(const std::string& path) {
  const size_t slash = path.find_last_of('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

std::string file_extension(const std::string& path) {
  size_t slash = path.find_last_of('/'), dot = path.find_last_of('.');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return {};
  std::string ext = path.substr(dot + 1);
  std::transform(ext.begin(), ext.end(), ext.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return ext;
}

}  // namespace lambent

#include <lambent/core/aligned.h>
#include <lambent/core/file.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <mutex>

namespace lambent {
namespace {

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

Result<MappedFile> MappedFile::open(const std::string& path) {
  MappedFile file;
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

Result<std::vector<uint8_t>> read_file(const std::string& path) {
  size_t size = 0;
  auto fd = open_plain_file(path, size);
  if (!fd) return fd.error();
  std::vector<uint8_t> bytes(size);
  size_t done = 0;
  while (done < size) {
    ssize_t got = ::read(*fd, bytes.data() + done, size - done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    done += size_t(got);
  }
  ::close(*fd);
  if (done != size) return Error{path, "could not be read whole"};
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

std::string file_extension(const std::string& path) {
  size_t slash = path.find_last_of('/'), dot = path.find_last_of('.');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return {};
  std::string ext = path.substr(dot + 1);
  std::transform(ext.begin(), ext.end(), ext.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return ext;
}

}  // namespace lambent

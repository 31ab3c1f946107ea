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
#include <cstdio>
#include <cstring>

namespace lambent {
namespace {

// The temporary of the write in flight, kept where a signal handler can reach it without allocating.
constexpr size_t max_path = 4096;
char unfinished_path[max_path];
std::atomic<bool> unfinished{false};

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
  return fd;
}

}  // namespace

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

Result<void> write_file_atomically(const std::string& path, std::span<const std::span<const uint8_t>> pieces) {
  std::string temporary = path + ".part" + std::to_string(::getpid());
  if (temporary.size() >= max_path) return Error{path, "path too long"};
  struct stat info;
  if (::stat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode)) return Error{path, "is a folder"};
  std::strcpy(unfinished_path, temporary.c_str());
  int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) return Error{path, "cannot be written: " + system_message()};
  unfinished = true;
  auto fail = [&](const std::string& why) {
    ::close(fd);
    ::unlink(temporary.c_str());
    unfinished = false;
    return Error{path, "cannot be written: " + why};
  };
  for (auto piece : pieces) {
    size_t done = 0;
    while (done < piece.size()) {
      ssize_t put = ::write(fd, piece.data() + done, std::min<size_t>(piece.size() - done, size_t{1} << 26));
      if (put < 0 && errno == EINTR) continue;
      if (put <= 0) return fail(system_message());
      done += size_t(put);
    }
  }
  if (::fsync(fd) != 0 && errno != EINVAL) return fail(system_message());
  if (::close(fd) != 0) {
    ::unlink(temporary.c_str());
    unfinished = false;
    return Error{path, "cannot be written: " + system_message()};
  }
  if (::rename(temporary.c_str(), path.c_str()) != 0) {
    std::string why = system_message();
    ::unlink(temporary.c_str());
    unfinished = false;
    return Error{path, "cannot be written: " + why};
  }
  unfinished = false;
  return {};
}

Result<void> write_file_atomically(const std::string& path, std::string_view text) {
  std::span<const uint8_t> piece(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  return write_file_atomically(path, {&piece, 1});
}

void remove_unfinished_files() {
  if (unfinished) ::unlink(unfinished_path);
}

std::string file_extension(const std::string& path) {
  size_t slash = path.find_last_of('/'), dot = path.find_last_of('.');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return {};
  std::string ext = path.substr(dot + 1);
  std::transform(ext.begin(), ext.end(), ext.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return ext;
}

}  // namespace lambent

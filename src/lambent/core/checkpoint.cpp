#include <lambent/core/checkpoint.h>
#include <lambent/core/clock.h>
#include <lambent/core/file.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <filesystem>
#include <map>
#include <unordered_map>

namespace lambent {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t record_magic = 0x4b50434c;  // "LCPK"
constexpr size_t buffered = size_t{1} << 20;
constexpr size_t small_piece = size_t{1} << 16;  // larger ones are written from where they are
constexpr double seconds_buffered = 0.25, seconds_unsynced = 30;
constexpr const char *lock_file = "lock", *pieces_ending = ".pieces";

std::string system_message() { return std::strerror(errno); }

// Before each piece; both are padded to eight bytes.
struct RecordHeader {
  uint32_t magic = record_magic, format = 1;
  uint64_t piece = 0, bytes = 0;
  uint64_t low = 0, high = 0;  // XXH3-128 of the bytes
  uint64_t own = 0;            // XXH3-64 of what stands before
  uint64_t hash() const { return XXH3_64bits(this, offsetof(RecordHeader, own)); }
};

size_t padded(size_t bytes) { return (bytes + 7) / 8 * 8; }

// What a piece of some parts is in a file: its header, then each part's length, bytes and padding.
struct Record {
  RecordHeader header;
  std::vector<uint64_t> lengths;
  std::vector<iovec> runs;
  size_t bytes = 0;  // of all runs

  Record(uint64_t piece, std::span<const std::span<const uint8_t>> parts) {
    static const uint8_t zeros[8] = {};
    lengths.reserve(parts.size());
    add(&header, sizeof header);
    for (std::span<const uint8_t> part : parts) {
      add(&lengths.emplace_back(part.size()), sizeof(uint64_t));
      add(part.data(), part.size());
      add(zeros, padded(part.size()) - part.size());
    }
    const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), XXH3_freeState);
    XXH3_128bits_reset(state.get());
    for (size_t i = 1; i < runs.size(); ++i) XXH3_128bits_update(state.get(), runs[i].iov_base, runs[i].iov_len);
    const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
    header.piece = piece, header.bytes = bytes - sizeof header, header.low = hash.low64, header.high = hash.high64;
    header.own = header.hash();
  }
  Record(const Record&) = delete;

 private:
  void add(const void* from, size_t size) {
    if (size == 0) return;
    runs.push_back({const_cast<void*>(from), size});
    bytes += size;
  }
};

// False: not all could be written, and the system says why. Changes the runs.
bool write_runs(int fd, std::span<iovec> runs) {
  constexpr size_t most = 64;  // of a call; the least that a system may set is 16, Linux's is 1024
  while (!runs.empty()) {
    ssize_t put = ::writev(fd, runs.data(), int(std::min(runs.size(), most)));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return false;
    for (; !runs.empty() && size_t(put) >= runs[0].iov_len; runs = runs.subspan(1)) put -= ssize_t(runs[0].iov_len);
    if (put > 0) runs[0].iov_base = static_cast<char*>(runs[0].iov_base) + put, runs[0].iov_len -= size_t(put);
  }
  return true;
}

bool read_at(int fd, void* to, size_t bytes, size_t at) {
  for (size_t done = 0; done < bytes;) {
    const ssize_t got = ::pread(fd, static_cast<char*>(to) + done, bytes - done, off_t(at + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    done += size_t(got);
  }
  return true;
}

// A descriptor of a locked file; below 0: the system's error, or EWOULDBLOCK.
int open_locked(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (fd < 0 || ::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

// Files of a stage: STAGE.pieces of the first rank, STAGE.rK.pieces of others.
std::string name_of_rank(const std::string& stage, int rank) {
  return stage + (rank > 0 ? ".r" + std::to_string(rank) : "") + pieces_ending;
}
bool is_of_stage(const std::string& file, const std::string& stage) {
  if (!file.starts_with(stage) || !file.ends_with(pieces_ending)) return false;
  const std::string middle = file.substr(stage.size(), file.size() - stage.size() - std::strlen(pieces_ending));
  return middle.empty() || (middle.starts_with(".r") && middle.find_first_not_of("0123456789", 2) == std::string::npos);
}

bool is_ours(const fs::path& file) {
  return file.filename() == checkpoint_identity_file || file.filename() == lock_file ||
         file.extension() == pieces_ending || file.filename().string().starts_with("checkpoint.json.");
}

Error in_use(const std::string& folder) { return {folder, "is in use by another process"}; }

Result<void> remove_files(const std::string& folder) {
  std::error_code status;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder, status))
    if (is_ours(entry.path())) files.push_back(entry.path());
  if (status) return Error{folder, "cannot be removed: " + status.message()};
  // The identity first: pieces without one are nothing.
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return (a.filename() == checkpoint_identity_file) > (b.filename() == checkpoint_identity_file);
  });
  for (const fs::path& file : files)
    if (::unlink(file.c_str()) != 0 && errno != ENOENT) return Error{folder, "cannot be removed: " + system_message()};
  ::rmdir(folder.c_str());  // where others have put something into it, it stays
  return {};
}

}  // namespace

struct Checkpoint::Stage {
  std::string name, path;
  size_t pieces = 0;
  Clock::time_point since = Clock::now();
  int fd = -1;  // this rank's
  std::vector<int> others;
  struct Place {
    int fd;
    size_t at;  // of the bytes
    RecordHeader header;
  };
  std::unordered_map<uint64_t, Place> index;
  std::atomic<size_t> made{0}, damaged{0};
  std::mutex buffer_mutex, write_mutex;
  std::vector<uint8_t> buffer, writing;
  Clock::time_point written = Clock::now(), synced = Clock::now();

  ~Stage() {
    if (fd >= 0) ::close(fd);
    for (int other : others) ::close(other);
  }

  // Finds the records; after one that is not whole the next is looked for.
  void scan(int from) {
    struct stat info;
    if (::fstat(from, &info) != 0) return;
    const size_t size = size_t(info.st_size);
    RecordHeader h;
    bool lost = false;
    size_t end = 0;  // of the last record
    for (size_t at = 0; at + sizeof h <= size;) {
      const bool sound = read_at(from, &h, sizeof h, at) && h.magic == record_magic && h.format == 1 &&
                         h.own == h.hash() && h.bytes <= size - at - sizeof h;
      if (sound) index[h.piece] = {from, at + sizeof h, h};
      else if (!lost) ++damaged;
      lost = !sound;
      at += sound ? sizeof h + padded(h.bytes) : 8;
      if (sound) end = at;
    }
    // What a killed writer left in part goes: its header would take the records to come for its own bytes.
    if (end == size) return;
    if (from == fd) (void)!::ftruncate(fd, off_t(end));
    else if (lost && damaged > 0) --damaged;  // another rank may be writing it
  }
};

struct Checkpoint::Impl {
  CheckpointOptions options;
  Clock::time_point since = Clock::now(), looked{};
  std::mutex mutex;
  std::map<std::string, int> names;
  std::vector<std::unique_ptr<Stage>> stages;
  int lock = -1;
  std::atomic<bool> on{false}, off{false};
  std::atomic<size_t> taken{0};

  Result<void> take_folder();

  // Keeps nothing more; what is there stays good.
  void give_up(const std::string& why) {
    if (!off.exchange(true)) options.warn(options.folder + ": no more is kept: " + why);
  }

  void open_stage(Stage& s) {
    const std::string own = name_of_rank(s.name, options.rank);
    s.path = options.folder + "/" + own;
    s.fd = ::open(s.path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (s.fd < 0) return give_up(system_message());
    std::error_code status;
    for (const auto& entry : fs::directory_iterator(options.folder, status)) {
      const std::string name = entry.path().filename().string();
      if (name == own || !is_of_stage(name, s.name)) continue;
      const int other = ::open(entry.path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
      if (other >= 0) s.others.push_back(other), s.scan(other);
    }
    s.scan(s.fd);
  }

  // Of a rank that is not the first: whether that has begun. Looked for now and then.
  bool is_there() {
    if (seconds_since(looked) < seconds_buffered) return false;
    looked = Clock::now();
    auto there = read_file(options.folder + "/" + checkpoint_identity_file);
    return there && std::string_view(reinterpret_cast<const char*>(there->data()), there->size()) == options.identity;
  }

  // Whether the work is long enough to be kept, as its stage goes.
  bool is_due(const Stage& s) const {
    const double ran = seconds_since(since), stage = seconds_since(s.since);
    const size_t made = s.made;
    const double rest = s.pieces > made && made > 0 && stage >= 1 ? stage * double(s.pieces - made) / double(made) : 0;
    return ran + rest > options.after;
  }

  // What is buffered, or one record.
  void write(Stage& s, bool sync, Record* record = nullptr) {
    std::unique_lock writing(s.write_mutex);
    if (!record) {
      std::lock_guard lock_buffer(s.buffer_mutex);
      s.writing.swap(s.buffer);
      s.buffer.clear();
      s.written = Clock::now();
    }
    if (off || s.fd < 0) return;
    iovec all{s.writing.data(), s.writing.size()};
    if (!(record ? write_runs(s.fd, record->runs) : write_runs(s.fd, {&all, all.iov_len > 0 ? size_t{1} : 0})))
      return give_up(system_message());
    if (!sync && seconds_since(s.synced) < seconds_unsynced) return;
    s.synced = Clock::now();
    writing.unlock();
    ::fdatasync(s.fd);
  }
};

Checkpoint::Checkpoint(CheckpointOptions options) : impl_(std::make_unique<Impl>()) {
  impl_->options = std::move(options);
}

Checkpoint::~Checkpoint() {
  flush();
  if (impl_->lock >= 0) ::close(impl_->lock);
}

bool Checkpoint::began() const { return impl_->on; }
size_t Checkpoint::taken() const { return impl_->taken; }

Result<void> Checkpoint::begin() {
  Impl& i = *impl_;
  if (i.options.rank == 0)
    if (auto ok = i.take_folder(); !ok) return ok;
  std::lock_guard lock(i.mutex);
  for (auto& s : i.stages) i.open_stage(*s);
  i.on = true;
  return {};
}

// The folder as this work's own.
Result<void> Checkpoint::Impl::take_folder() {
  Impl& i = *this;
  const std::string& folder = i.options.folder;
  if (::mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST)
    return Error{folder, "cannot be written: " + system_message()};
  std::error_code status;
  for (const auto& entry : fs::directory_iterator(folder, status))
    if (!is_ours(entry.path()))
      return Error{folder, "is no folder of a checkpoint: " + entry.path().filename().string() + " is in it"};
  if (status) return Error{folder, "cannot be read: " + status.message()};
  i.lock = open_locked(folder + "/" + lock_file, O_RDWR | O_CREAT);
  if (i.lock < 0)
    return errno == EWOULDBLOCK ? in_use(folder) : Error{folder, "cannot be written: " + system_message()};
  const std::string identity = folder + "/" + checkpoint_identity_file;
  if (!fs::exists(identity, status)) {
    // Pieces that nothing tells of are nobody's.
    for (const auto& entry : fs::directory_iterator(folder, status))
      if (entry.path().extension() == pieces_ending) ::unlink(entry.path().c_str());
    if (auto ok = write_file_atomically(identity, i.options.identity); !ok) return ok;
  } else {
    auto there = read_file(identity);
    if (!there) return there.error();
    if (auto ok = i.options.check(*there); !ok) return ok;
    i.options.identity.assign(there->begin(), there->end());
  }
  return {};
}

Checkpoint::Stage& Checkpoint::stage(const std::string& name, size_t pieces) {
  Impl& i = *impl_;
  std::lock_guard lock(i.mutex);
  const int number = ++i.names[name];
  Stage& s = *i.stages.emplace_back(std::make_unique<Stage>());
  s.name = number == 1 ? name : name + "-" + std::to_string(number), s.pieces = pieces;
  if (i.on && !i.off) i.open_stage(s);
  return s;
}

bool Checkpoint::read(Stage& s, uint64_t piece, std::vector<uint8_t>& bytes) {
  const auto found = s.index.find(piece);
  if (found == s.index.end()) return false;
  const auto& [fd, at, header] = found->second;
  bytes.resize(header.bytes);
  if (read_at(fd, bytes.data(), bytes.size(), at)) {
    const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
    if (hash.low64 == header.low && hash.high64 == header.high) {
      ++impl_->taken, ++s.made;
      return true;
    }
  }
  ++s.damaged;
  return false;
}

void Checkpoint::note_damage(Stage& s) { ++s.damaged, --s.made, --impl_->taken; }

void Checkpoint::append(Stage& s, uint64_t piece, std::span<const std::span<const uint8_t>> parts) {
  Impl& i = *impl_;
  ++s.made;
  if (i.off) return;
  if (!i.on) {
    static std::mutex beginning;
    if (i.options.rank == 0 && !i.is_due(s)) return;
    std::lock_guard lock(beginning);
    if (i.options.rank > 0 && !i.on && !i.is_there()) return;
    if (!i.on && !i.off)
      if (auto ok = begin(); !ok) return i.give_up(ok.error().message);
  }
  if (i.off || s.fd < 0) return;
  Record record(piece, parts);
  if (record.bytes > small_piece) return i.write(s, false, &record);
  bool full;
  {
    std::lock_guard lock(s.buffer_mutex);
    for (const iovec& run : record.runs) {
      const auto* from = static_cast<const uint8_t*>(run.iov_base);
      s.buffer.insert(s.buffer.end(), from, from + run.iov_len);
    }
    full = s.buffer.size() >= buffered || seconds_since(s.written) > seconds_buffered;
  }
  if (full) i.write(s, false);
}

void Checkpoint::flush() {
  Impl& i = *impl_;
  if (!i.on) return;
  for (auto& s : i.stages) {
    i.write(*s, true);
    if (const size_t n = s->damaged.exchange(0))
      i.options.warn(i.options.folder + ": " + s->name + ": " + std::to_string(n) +
                     (n == 1 ? " piece is damaged, and was left aside" : " pieces are damaged, and were left aside"));
  }
}

void Checkpoint::remove() {
  if (!impl_->on) return;
  impl_->off = true;  // what goes needs not reach the disk
  flush();
  if (impl_->options.rank > 0) return;
  if (auto ok = remove_files(impl_->options.folder); !ok) impl_->options.warn(ok.error().text());
}

bool is_checkpoint_in_use(const std::string& folder) {
  const int fd = open_locked(folder + "/" + lock_file, O_RDONLY);
  if (fd < 0) return errno == EWOULDBLOCK;
  ::close(fd);
  return false;
}

Result<void> remove_checkpoint(const std::string& folder) {
  const int fd = open_locked(folder + "/" + lock_file, O_RDONLY);
  if (fd < 0 && errno == EWOULDBLOCK) return in_use(folder);
  auto ok = remove_files(folder);
  if (fd >= 0) ::close(fd);
  return ok;
}

namespace checkpoint_detail {

void put(std::vector<uint8_t>& out, std::span<const uint8_t> part) {
  const uint64_t size = part.size();
  const auto* length = reinterpret_cast<const uint8_t*>(&size);
  out.insert(out.end(), length, length + sizeof size);
  out.insert(out.end(), part.begin(), part.end());
  out.resize(padded(out.size()));
}

bool get(std::span<const uint8_t> bytes, size_t& at, std::span<const uint8_t>& part) {
  uint64_t size;
  if (bytes.size() - at < sizeof size) return false;
  std::memcpy(&size, bytes.data() + at, sizeof size);
  at += sizeof size;
  if (size > bytes.size() - at || padded(size) > bytes.size() - at) return false;
  part = bytes.subspan(at, size);
  at += padded(size);
  return true;
}

}  // namespace checkpoint_detail
}  // namespace lambent

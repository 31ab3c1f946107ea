#include <lambent/core/file.h>
#include <lambent/core/own_part.h>
#include <lambent/core/ranks.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <optional>
#include <utility>

namespace lambent {
namespace {

namespace fs = std::filesystem;

// Then the writer's number. No other program's: what bears it may be removed.
const std::string temporary_ending = ".lambent-part";

std::string system_message() { return std::strerror(errno); }

// Temporaries of writes in flight, kept where a signal handler can reach them without allocating; it looks at those
// that are active. Never given back, but used again.
struct Unfinished {
  std::atomic<bool> active{false}, taken{true};
  std::string path;
  Unfinished* next = nullptr;
};
std::atomic<Unfinished*> all_unfinished{nullptr};

Unfinished* note_unfinished(const std::string& path) {
  for (Unfinished* note = all_unfinished; note; note = note->next)
    if (!note->taken.exchange(true)) {
      note->path = path, note->active = true;
      return note;
    }
  auto* note = new Unfinished;
  note->path = path, note->active = true, note->next = all_unfinished.load();
  while (!all_unfinished.compare_exchange_weak(note->next, note)) {
  }
  return note;
}
void release(Unfinished& note) { note.active = false, note.taken = false; }

// Where a name leads: of a link, to what it names, there or not.
std::string resolved(const std::string& path) {
  std::error_code status;
  fs::path at = path;
  for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(at, status)); ++links)
    at = at.parent_path() / fs::read_symlink(at, status);
  return at.string();
}

void sync_folder(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  const int fd = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

thread_local std::vector<const OwnPart*> own_parts;

// Bytes that go to a place in the file.
struct Run {
  size_t at = 0;
  std::span<const uint8_t> bytes;
};

// Of pieces one after the other, what rank k of `count` writes: of those that are in parts its own, of all others so
// much of the file.
std::vector<Run> runs_of(std::span<const std::span<const uint8_t>> pieces, size_t k, size_t count) {
  size_t bytes = 0, at = 0;
  for (const auto piece : pieces) bytes += piece.size();
  std::vector<Run> runs;
  for (const auto piece : pieces) {
    const auto add = [&](size_t first, size_t end) {  // in the file
      first = std::clamp(first, at, at + piece.size()), end = std::clamp(end, first, at + piece.size());
      if (end > first) runs.push_back({first, piece.subspan(first - at, end - first)});
    };
    bool parted = false;
    for (const OwnPart* part : own_parts) {
      const uint8_t *begin = part->all.data(), *from = piece.data();
      if (from < begin || from + piece.size() > begin + part->all.size() || part->ranks != count) continue;
      const size_t skipped = size_t(from - begin);  // pieces may be some of them, where a set has several files
      const auto place = [&](size_t end_of) {
        return at + std::clamp(end_of, skipped, skipped + piece.size()) - skipped;
      };
      for (size_t i = k; i < part->ends.size(); i += count)
        add(place(i == 0 ? 0 : part->ends[i - 1]), place(part->ends[i]));
      parted = true;
    }
    if (!parted) add(bytes * k / count, bytes * (k + 1) / count);
    at += piece.size();
  }
  return runs;
}

}  // namespace

void ZeroPages::forget(size_t begin, size_t end) {
  const size_t page = size_t(::sysconf(_SC_PAGESIZE));
  const auto at = reinterpret_cast<uintptr_t>(data());
  const uintptr_t from = (at + begin * sizeof(float) + page - 1) / page * page,
                  to = (at + end * sizeof(float)) / page * page;
  if (to > from) (void)::madvise(reinterpret_cast<void*>(from), to - from, MADV_DONTNEED);
}

OwnPart::OwnPart(std::span<const uint8_t> bytes, std::vector<size_t> stretch_ends, size_t count)
    : all(bytes), ends(std::move(stretch_ends)), ranks(count) {
  own_parts.push_back(this);
}
OwnPart::~OwnPart() { std::erase(own_parts, this); }

// A whole file under its temporary name. The lock says that somebody still writes it, until the descriptor is closed.
struct WrittenFile {
  std::string path, target, temporary;  // path: as asked for, in messages
  int fd = -1;
  Unfinished* note = nullptr;
  WrittenFile(std::string asked)
      : path(std::move(asked)),
        target(resolved(path)),
        temporary(target + temporary_ending + std::to_string(::getpid())) {}
  WrittenFile(const WrittenFile&) = delete;
  WrittenFile& operator=(const WrittenFile&) = delete;
  ~WrittenFile() {
    if (fd >= 0) ::close(fd);
    if (!note) return;
    ::unlink(temporary.c_str());
    release(*note);
  }
  Error error(const std::string& why) const { return {path, "cannot be written: " + why}; }

  // The mode and, as far as allowed, the owner of what it replaces.
  Result<void> open() {
    struct stat old;
    const bool replaces = ::stat(target.c_str(), &old) == 0;
    if (replaces && S_ISDIR(old.st_mode)) return Error{path, "is a folder"};
    if (replaces && !S_ISREG(old.st_mode)) return error("it is not a plain file");
    if (auto ok = check_replaces_no_input(path); !ok) return ok;
    remove_stale_temporaries(target);
    fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0) return error(system_message());
    ::flock(fd, LOCK_EX | LOCK_NB);
    note = note_unfinished(temporary);
    if (replaces) {
      (void)!::fchown(fd, old.st_uid, old.st_gid);
      ::fchmod(fd, old.st_mode & 0777);
    }
    return {};
  }

  Result<void> write(std::span<const Run> runs) {
    for (const Run& run : runs)
      for (size_t done = 0; done < run.bytes.size();) {
        const ssize_t put = ::pwrite(fd, run.bytes.data() + done,
                                     std::min<size_t>(run.bytes.size() - done, size_t{1} << 26), off_t(run.at + done));
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return error(system_message());
        done += size_t(put);
      }
    return {};
  }
  Result<void> sync() {
    if (::fsync(fd) != 0 && errno != EINVAL) return error(system_message());
    return {};
  }

  // The first rank writes what it is handed by the others, which do not see the file.
  Result<void> write_for_all(Ranks& ranks, std::span<const std::span<const uint8_t>> pieces) {
    const size_t count = size_t(ranks.count());
    Result<void> ok;
    for (size_t k = 0; k < count; ++k)
      for (const Run& run : runs_of(pieces, k, count)) {
        constexpr size_t most = size_t{1} << 26;
        for (size_t done = 0; done < run.bytes.size(); done += most) {
          const auto bytes = run.bytes.subspan(done, std::min(most, run.bytes.size() - done));
          std::vector<std::span<const uint8_t>> give(count);
          std::vector<std::span<uint8_t>> take(count);
          std::vector<uint8_t> taken(k > 0 && ranks.rank() == 0 ? bytes.size() : 0);
          if (k > 0 && ranks.rank() == int(k)) give[0] = bytes;
          take[k] = taken;
          if (k > 0) ranks.exchange(give, take);
          const Run now{run.at + done, k > 0 ? std::span<const uint8_t>(taken) : bytes};
          if (ranks.rank() == 0 && ok) ok = write({&now, 1});
        }
      }
    return ok;
  }

  // As open() and write(), of all ranks; all fail where one does. Where a rank does not
  // see the file, or has other bytes for it, the first one writes it alone.
  Result<void> write_by(Ranks& ranks, std::span<const std::span<const uint8_t>> pieces) {
    const bool leads = ranks.rank() == 0;
    Result<void> ok = leads ? open() : Result<void>();
    if (!ranks.all(bool(ok))) return ok ? error("by rank 0") : ok;
    size_t bytes = 0;
    for (auto piece : pieces) bytes += piece.size();
    struct stat info = {};
    if (leads) ::fstat(fd, &info);
    std::string name(ranks.from_first(temporary.size()), '\0');
    if (leads) name = temporary;
    ranks.broadcast({reinterpret_cast<uint8_t*>(name.data()), name.size()});
    const ino_t inode = ranks.from_first(info.st_ino);
    const bool alike = ranks.from_first(bytes) == bytes;
    if (!leads && alike) fd = ::open(name.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
    const bool seen = leads || (fd >= 0 && ::fstat(fd, &info) == 0 && info.st_ino == inode);
    const bool all_see = ranks.all(alike && seen);
    if (all_see) ok = write(runs_of(pieces, size_t(ranks.rank()), size_t(ranks.count())));
    else if (ranks.all(alike)) ok = write_for_all(ranks, pieces);
    else if (leads) ok = write(runs_of(pieces, 0, 1));
    if (ok && (all_see || leads)) ok = sync();
    if (!ok && !leads) ranks.say(ok.error().text());
    if (!ranks.all(bool(ok))) return ok ? error("by another rank") : ok;
    return {};
  }
};

namespace {

thread_local FileSet* current_set = nullptr;
thread_local Ranks* together = nullptr;  // null: one process

// Renames all, the last one last. A program that is killed meanwhile leaves no set in part: another process does it,
// which shares its memory and ends by itself. Power that fails meanwhile leaves no new file beside an old last one,
// which is removed first.
int rename_all(std::vector<std::unique_ptr<WrittenFile>>& files, const std::vector<std::string>& removed) {
  const auto rename_one = [](const WrittenFile& file) { return ::rename(file.temporary.c_str(), file.target.c_str()); };
  if (files.size() == 1 && removed.empty()) return rename_one(*files[0]) == 0 ? 0 : errno;
#ifdef __EMSCRIPTEN__  // where there is one process
  for (const auto& file : files)
    if (rename_one(*file) != 0) return errno;
  return 0;
#else
  volatile int failure = 0;
  const char* const head = files.back()->target.c_str();
  const pid_t child = ::vfork();
  if (child == 0) {
    ::setsid();  // what is sent to the group of the program does not reach it
    if (::unlink(head) != 0 && errno != ENOENT) failure = errno;
    for (size_t i = 0; i < removed.size() && !failure; ++i)
      if (::unlink(removed[i].c_str()) != 0 && errno != ENOENT) failure = errno;
    for (size_t i = 0; i < files.size() && !failure; ++i)
      if (rename_one(*files[i]) != 0) failure = errno;
    ::_exit(0);
  }
  if (child < 0) return errno;
  while (::waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
  }
  return failure;
#endif
}

}  // namespace

FileSet::FileSet() : outer_(current_set) { current_set = this; }
FileSet::~FileSet() { current_set = outer_; }

WriteTogether::WriteTogether(Ranks& ranks) : outer_(together) { together = ranks.count() > 1 ? &ranks : nullptr; }
WriteTogether::~WriteTogether() { together = outer_; }

Result<void> FileSet::commit() {
  if (outer_) {
    std::move(files_.begin(), files_.end(), std::back_inserter(outer_->files_));
    outer_->removed_.insert(outer_->removed_.end(), removed_.begin(), removed_.end());
    files_.clear(), removed_.clear();
    return {};
  }
  const bool leads = !together || together->rank() == 0;
  if (files_.empty() && !together) return {};
  const int failure = leads && !files_.empty() ? rename_all(files_, removed_) : 0;
  if (const int all = together ? together->from_first(failure) : failure; all != 0)
    return leads ? files_.back()->error(std::strerror(all)) : Error{"", std::strerror(all)};
  for (auto& file : files_) release(*std::exchange(file->note, nullptr));
  for (size_t i = 0; i < files_.size(); ++i)
    if (i == 0 || fs::path(files_[i]->target).parent_path() != fs::path(files_[i - 1]->target).parent_path())
      sync_folder(files_[i]->target);
  files_.clear(), removed_.clear();
  return {};
}

Result<void> write_file_atomically(const std::string& path, std::span<const std::span<const uint8_t>> pieces) {
  std::optional<FileSet> own;
  if (!current_set) own.emplace();
  auto file = std::make_unique<WrittenFile>(path);
  if (together) {
    if (auto ok = file->write_by(*together, pieces); !ok) return ok;
    if (together->rank() > 0) return own ? own->commit() : Result<void>();
  } else {
    if (auto ok = file->open(); !ok) return ok;
    if (auto ok = file->write(runs_of(pieces, 0, 1)); !ok) return ok;
    if (auto ok = file->sync(); !ok) return ok;
  }
  current_set->files_.push_back(std::move(file));
  return own ? own->commit() : Result<void>();
}

Result<void> write_file_atomically(const std::string& path, std::string_view text) {
  std::span<const uint8_t> piece(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  return write_file_atomically(path, {&piece, 1});
}

void remove_unfinished_files() {
  for (const Unfinished* note = all_unfinished; note; note = note->next)
    if (note->active) ::unlink(note->path.c_str());
}

std::vector<std::string> stale_temporaries(const std::string& folder, const std::string& name) {
  std::vector<std::string> out;
  std::error_code status;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, status)) {
    const std::string file = entry.path().filename().string();
    const size_t dot = file.rfind(temporary_ending), digits = dot + temporary_ending.size();
    if (dot == std::string::npos || digits == file.size() || (!name.empty() && file.substr(0, dot) != name) ||
        file.find_first_not_of("0123456789", digits) != std::string::npos)
      continue;
    const int fd = ::open(entry.path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0) continue;
    struct stat info;
    if (::fstat(fd, &info) == 0 && (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode)) &&
        ::flock(fd, LOCK_EX | LOCK_NB) == 0)
      out.push_back(entry.path().string());
    ::close(fd);
  }
  return out;
}

void remove_stale_temporaries(const std::string& path) {
  const fs::path target = resolved(path);
  for (const std::string& file : stale_temporaries(target.parent_path().string(), target.filename().string())) {
    std::error_code ignored;
    fs::remove_all(file, ignored);
  }
}

}  // namespace lambent

#pragma once
// Long work that is kept as it is made, so that it can go on after an interrupt, a crash or a loss of power. Work is
// pieces by number, in named stages; each piece is a record with its hash, appended to the stage's file. A piece that
// is not there, or not as it was written, is made again: it is a function of the work's inputs alone, so the result has
// the bytes of work that was never interrupted.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace lambent {

struct CheckpointOptions {
  std::string folder;
  std::string identity;  // what the work is, as JSON; kept as checkpoint.json
  // Whether the identity of a folder that is there already is that of the same work.
  std::function<Result<void>(std::span<const uint8_t>)> check = [](std::span<const uint8_t>) { return Result<void>(); };
  // Seconds that the work has to take, as far as one can tell, before anything is kept; 0: kept from the start.
  double after = 0;
  std::function<void(const std::string&)> warn = [](const std::string&) {};  // one line each
  // Of ranks (ranks.h) that keep one checkpoint, each its own pieces in files of its own; all read all. Rank 0 locks
  // the folder; others take part where they see it with the identity that they know.
  int rank = 0;
};

inline constexpr const char* checkpoint_identity_file = "checkpoint.json";

class Checkpoint {
 public:
  explicit Checkpoint(CheckpointOptions options);
  ~Checkpoint();  // flushes; the folder stays

  // Makes or takes up the folder and locks it. Errors: in use by another process; it cannot be written; it holds other
  // files; those of options.check. Called at the latest when the work turns out to be long.
  Result<void> begin();
  bool began() const;

  struct Stage;
  // Stages are told apart by their names, and alike names by their order. `pieces`: how many there will be, or 0.
  Stage& stage(const std::string& name, size_t pieces);
  bool read(Stage& stage, uint64_t piece, std::vector<uint8_t>& bytes);
  // The parts one after the other, as KeptPieces reads them.
  void append(Stage& stage, uint64_t piece, std::span<const std::span<const uint8_t>> parts);
  void note_damage(Stage& stage);

  void flush();          // to the disk
  void remove();         // the work is done
  size_t taken() const;  // pieces that were read

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Whether another process holds the folder's lock.
bool is_checkpoint_in_use(const std::string& folder);
// Its files and, where nothing else is in it, the folder. Errors: in use; the system's.
Result<void> remove_checkpoint(const std::string& folder);

namespace checkpoint_detail {

template <class T, size_t N>
std::span<uint8_t> bytes_of(std::span<T, N> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  return {reinterpret_cast<uint8_t*>(values.data()), values.size_bytes()};
}
template <class T>
std::span<uint8_t> bytes_of(T& value) {
  return bytes_of(std::span<T>(&value, 1));
}
template <class T>
std::span<uint8_t> bytes_of(std::vector<T>& values) {
  return bytes_of(std::span<T>(values));
}
// Whether so many bytes can become the part: spans and single values have their size, vectors take any.
template <class T>
bool fits(const T& part, size_t bytes) {
  return bytes_of(const_cast<T&>(part)).size() == bytes;
}
template <class T>
bool fits(const std::vector<T>&, size_t bytes) {
  return bytes % sizeof(T) == 0;
}
template <class T>
void make_room(T&, size_t) {}
template <class T>
void make_room(std::vector<T>& part, size_t bytes) {
  part.resize(bytes / sizeof(T));
}

// A length and the bytes, padded to eight, each.
void put(std::vector<uint8_t>& out, std::span<const uint8_t> part);
// Advances `at` over one part; false where there is none.
bool get(std::span<const uint8_t> bytes, size_t& at, std::span<const uint8_t>& part);

}  // namespace checkpoint_detail

// The pieces of one stage, kept where somebody wants them kept (Progress::checkpoint), and else without effect. From
// any thread. The parts of a piece are spans, vectors and single values of plain types, in an order of the stage's own.
class KeptPieces {
 public:
  KeptPieces(Progress* progress, const char* stage, size_t pieces)
      : progress_(progress), checkpoint_(progress ? progress->checkpoint : nullptr) {
    if (checkpoint_) stage_ = &checkpoint_->stage(stage, pieces);
  }
  explicit operator bool() const { return checkpoint_; }

  // False, and nothing changed, where the piece has to be made.
  template <class... Parts>
  bool load(uint64_t piece, Parts&&... parts) const {
    using namespace checkpoint_detail;
    thread_local std::vector<uint8_t> bytes;  // taken once: fresh pages cost more than reading
    if (!checkpoint_ || !checkpoint_->read(*stage_, piece, bytes)) return false;
    std::span<const uint8_t> part;
    size_t at = 0;
    if (!((get(bytes, at, part) && fits(parts, part.size())) && ...) || at != bytes.size()) {
      checkpoint_->note_damage(*stage_);
      return false;
    }
    at = 0;
    (take(bytes, at, parts), ...);
    return true;
  }
  // Nothing once cancelled: the piece may be unfinished.
  template <class... Parts>
  void save(uint64_t piece, Parts&&... parts) const {
    if (!checkpoint_ || progress_->cancelled()) return;
    const std::span<const uint8_t> all[] = {checkpoint_detail::bytes_of(parts)...};
    checkpoint_->append(*stage_, piece, all);
  }
  // What was loaded is nothing that the stage can have made.
  void refuse() const { checkpoint_->note_damage(*stage_); }

 private:
  template <class T>
  static void take(std::span<const uint8_t> bytes, size_t& at, T& part) {
    std::span<const uint8_t> from;
    checkpoint_detail::get(bytes, at, from);
    checkpoint_detail::make_room(part, from.size());
    if (!from.empty()) std::memcpy(checkpoint_detail::bytes_of(part).data(), from.data(), from.size());
  }
  Progress* progress_;
  Checkpoint* checkpoint_;
  Checkpoint::Stage* stage_ = nullptr;
};

}  // namespace lambent

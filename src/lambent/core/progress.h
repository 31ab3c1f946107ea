#pragma once
// Progress of long work, the wish to stop it and where it is kept, passed down as a pointer; null means silent and not
// to be stopped.
#include <atomic>
#include <cstddef>
#include <functional>
#include <mutex>
#include <string>

namespace lambent {

class Checkpoint;

// Made by whoever wants to see progress, or to stop the work.
class Progress {
 public:
  // report(stage, fraction in [0,1]) is called from any thread, one call at a time, at least once when a stage begins
  // and ends.
  using Report = std::function<void(const std::string& stage, double fraction)>;
  explicit Progress(Report report = {}) : report_(std::move(report)) {}

  void begin(std::string stage, size_t total);
  void advance(size_t amount = 1);
  void end();

  // Safe in a signal handler.
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

  Checkpoint* checkpoint = nullptr;  // where pieces of the work are kept (checkpoint.h); null: nowhere

 private:
  Report report_;
  std::mutex mutex_;
  std::string stage_;
  size_t total_ = 0, done_ = 0;
  std::atomic<bool> cancelled_{false};

 public:
  std::string scratch;  // a folder for what memory has no room for; "": that is made again
};

// False where there is nobody to stop it.
inline bool is_cancelled(const Progress* p) { return p && p->cancelled(); }

// One stage of work; ends when it goes out of scope.
class ProgressStage {
 public:
  ProgressStage(Progress* progress, std::string stage, size_t total) : progress_(progress) {
    if (progress_) progress_->begin(std::move(stage), total);
  }
  ~ProgressStage() {
    if (progress_) progress_->end();
  }
  ProgressStage(const ProgressStage&) = delete;
  ProgressStage& operator=(const ProgressStage&) = delete;
  void advance(size_t amount = 1) {
    if (progress_) progress_->advance(amount);
  }
  bool cancelled() const { return is_cancelled(progress_); }

 private:
  Progress* progress_;
};

}  // namespace lambent

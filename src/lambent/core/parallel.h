#pragma once
#include <cstddef>
#include <functional>
#include <memory>

namespace lambent {

// Calls body(begin, end) over [0, count) in pieces of at most `grain`, on all cores, in any order. Pieces always begin
// at multiples of `grain`, whatever the thread count, so results keyed by piece do not depend on it.
void parallel_for(size_t count, size_t grain, const std::function<void(size_t begin, size_t end)>& body);

// Runs body on one thread only, nested library parallelism included (used where a library's result would depend on
// threads).
void run_serially(const std::function<void()>& body);

// Limits the threads of the whole process for as long as it lives; 0 means all cores.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Threads that parallel_for uses at present.
int thread_count();

}  // namespace lambent

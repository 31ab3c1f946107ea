#pragma once
#include <cstddef>
#include <functional>
#include <memory>
#include <type_traits>

namespace lambent {

// Any callable (size_t begin, size_t end), borrowed for the time of a call: a loop over pieces allocates nothing.
class PieceBody {
 public:
  template <class F, class = std::enable_if_t<!std::is_same_v<std::remove_cvref_t<F>, PieceBody>>>
  PieceBody(F&& f)
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* o, size_t begin, size_t end) { (*static_cast<std::remove_reference_t<F>*>(o))(begin, end); }) {}
  void operator()(size_t begin, size_t end) const { call_(object_, begin, end); }

 private:
  void* object_;
  void (*call_)(void*, size_t, size_t);
};

// Calls body(begin, end) over [0, count) in pieces of at most `grain`, on all cores, in any order. Pieces always begin
// at multiples of `grain`, whatever the thread count, so results keyed by piece do not depend on it.
void parallel_for(size_t count, size_t grain, PieceBody body);

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

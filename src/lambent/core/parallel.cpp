#include <lambent/core/parallel.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <thread>

namespace lambent {

void parallel_for(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
  if (count == 0) return;
  grain = std::max<size_t>(grain, 1);
  size_t pieces = (count + grain - 1) / grain;
  tbb::parallel_for(size_t{0}, pieces, [&](size_t i) { body(i * grain, std::min(count, (i + 1) * grain)); });
}

void run_serially(const std::function<void()>& body) { tbb::task_arena(1).execute(body); }

struct ThreadLimit::Impl {
  tbb::global_control control;  // never copied: the copy's end would lift the limit
  explicit Impl(size_t threads) : control(tbb::global_control::max_allowed_parallelism, threads) {}
  Impl(const Impl&) = delete;
};

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0) impl_ = std::make_unique<Impl>(size_t(threads));
}
ThreadLimit::~ThreadLimit() = default;

int thread_count() {
  // The control in force knows; an arena that was made before it still reports what it was made with.
  return int(std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                      size_t(std::thread::hardware_concurrency())));
}

}  // namespace lambent

#include <lambent/core/parallel.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace lambent {

void parallel_for(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
  if (count == 0) return;
  grain = std::max<size_t>(grain, 1);
  size_t pieces = (count + grain - 1) / grain;
  tbb::parallel_for(size_t{0}, pieces, [&](size_t i) { body(i * grain, std::min(count, (i + 1) * grain)); });
}

void run_serially(const std::function<void()>& body) { tbb::task_arena(1).execute(body); }

struct ThreadLimit::Impl {
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0)
    impl_ = std::make_unique<Impl>(Impl{tbb::global_control(tbb::global_control::max_allowed_parallelism, size_t(threads))});
}
ThreadLimit::~ThreadLimit() = default;

int thread_count() {
  return int(std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                      size_t(tbb::this_task_arena::max_concurrency())));
}

}  // namespace lambent

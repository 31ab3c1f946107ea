// By TBB, which shares its threads with Embree, where LAMBENT_TBB is 1; else by a few threads of our own, for programs
// that embed lambent_relight alone.
#include <lambent/core/parallel.h>

#include <algorithm>
#include <thread>

#if LAMBENT_TBB

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace lambent {

void parallel_for(size_t count, size_t grain, PieceBody body) {
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

int thread_count() {
  // The control in force knows; an arena that was made before it still reports what it was made with.
  return int(std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                      size_t(std::thread::hardware_concurrency())));
}

}  // namespace lambent

#else

#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <set>
#include <vector>

namespace lambent {
namespace {

thread_local int serial_depth = 0;  // above 0: inside a piece, or run_serially()

std::mutex limits_mutex;
std::multiset<int> limits;

int cores() {
#if defined(__EMSCRIPTEN__) && !defined(__EMSCRIPTEN_PTHREADS__)
  return 1;
#else
  static const int count = std::max(1, int(std::thread::hardware_concurrency()));
  return count;
#endif
}

// One loop at a time has the threads; a loop that finds them taken is done by its caller alone.
class Crew {
 public:
  ~Crew() {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& t : threads_) t.join();
  }

  // False where the threads are taken.
  bool run(size_t count, size_t grain, PieceBody body, int threads) {
    std::unique_lock owner(owner_, std::try_to_lock);
    if (!owner) return false;
    Loop loop{body, count, grain};
    {
      std::lock_guard lock(mutex_);
      while (int(threads_.size()) + 1 < threads) threads_.emplace_back([this] { work(); });
      loop_ = &loop, free_places_ = threads - 1, ++loops_;
    }
    wake_.notify_all();
    loop.take_pieces();
    std::unique_lock lock(mutex_);
    loop_ = nullptr;
    done_.wait(lock, [&] { return at_work_ == 0; });
    if (loop.failure) std::rethrow_exception(loop.failure);
    return true;
  }

 private:
  struct Loop {
    PieceBody body;
    size_t count, grain;
    std::atomic<size_t> next{0};
    std::mutex mutex = {};
    std::exception_ptr failure = nullptr;

    void take_pieces() {
      ++serial_depth;
      try {
        for (size_t begin; (begin = next.fetch_add(grain, std::memory_order_relaxed)) < count;)
          body(begin, std::min(count, begin + grain));
      } catch (...) {
        std::lock_guard lock(mutex);
        failure = std::current_exception();
        next.store(count, std::memory_order_relaxed);
      }
      --serial_depth;
    }
  };

  void work() {
    uint64_t seen = 0;
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [&] { return stop_ || loops_ != seen; });
      if (stop_) return;
      seen = loops_;
      if (!loop_ || free_places_ == 0) continue;
      Loop& loop = *loop_;
      --free_places_, ++at_work_;
      lock.unlock();
      loop.take_pieces();
      lock.lock();
      if (--at_work_ == 0) done_.notify_all();
    }
  }

  std::mutex owner_, mutex_;
  std::condition_variable wake_, done_;
  std::vector<std::thread> threads_;
  Loop* loop_ = nullptr;  // null: nothing to join
  int free_places_ = 0, at_work_ = 0;
  uint64_t loops_ = 0;
  bool stop_ = false;
};

}  // namespace

void parallel_for(size_t count, size_t grain, PieceBody body) {
  static Crew crew;
  grain = std::max<size_t>(grain, 1);
  const int threads = serial_depth > 0 || count <= grain ? 1 : thread_count();
  if (threads > 1 && crew.run(count, grain, body, threads)) return;
  for (size_t begin = 0; begin < count; begin += grain) body(begin, std::min(count, begin + grain));
}

void run_serially(const std::function<void()>& body) {
  ++serial_depth;
  try {
    body();
  } catch (...) {
    --serial_depth;
    throw;
  }
  --serial_depth;
}

struct ThreadLimit::Impl {
  int threads;
  explicit Impl(size_t count) : threads(int(count)) {
    std::lock_guard lock(limits_mutex);
    limits.insert(threads);
  }
  ~Impl() {
    std::lock_guard lock(limits_mutex);
    limits.erase(limits.find(threads));
  }
};

int thread_count() {
  std::lock_guard lock(limits_mutex);
  return limits.empty() ? cores() : std::min(cores(), *limits.begin());
}

}  // namespace lambent

#endif

namespace lambent {

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0) impl_ = std::make_unique<Impl>(size_t(threads));
}
ThreadLimit::~ThreadLimit() = default;

}  // namespace lambent

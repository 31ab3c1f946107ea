// core/parallel.cpp as programs get it that embed lambent_relight alone: without TBB, by threads of its own.
#include <lambent/core/parallel.h>

#include <atomic>
#include <cstdio>
#include <set>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

using namespace lambent;

static int failures = 0;
#define CHECK(condition) \
  if (!(condition)) ++failures, std::printf("line %d: %s\n", __LINE__, #condition)

// Every piece once, at multiples of the grain.
static bool covers(size_t count, size_t grain) {
  std::vector<std::atomic<int>> times(count);
  std::atomic<bool> right{true};
  parallel_for(count, grain, [&](size_t begin, size_t end) {
    if (begin % grain || end - begin > grain || begin >= end) right = false;
    for (size_t i = begin; i < end; ++i) ++times[i];
  });
  for (auto& t : times) right = right && t == 1;
  return right;
}

int main() {
  for (size_t count : {0, 1, 7, 1000, 4096})
    for (size_t grain : {1, 3, 64, 5000}) CHECK(covers(count, grain));
  for (int i = 0; i < 2000; ++i) CHECK(covers(64, 1));  // one loop upon another

  // Loops inside loops, and from several threads at once.
  std::atomic<size_t> sum{0};
  parallel_for(50, 1, [&](size_t, size_t) { parallel_for(40, 1, [&](size_t, size_t) { ++sum; }); });
  CHECK(sum == 2000);
  std::atomic<int> wrong{0};
  std::vector<std::thread> callers;
  for (int t = 0; t < 4; ++t)
    callers.emplace_back([&] {
      for (int i = 0; i < 300; ++i) wrong += !covers(200, 7);
    });
  for (std::thread& t : callers) t.join();
  CHECK(wrong == 0);

  // What a piece throws reaches the caller, and the threads are fit for more.
  for (int i = 0; i < 20; ++i) {
    bool caught = false;
    try {
      parallel_for(100, 1, [&](size_t begin, size_t) {
        if (begin == 17) throw std::runtime_error("a piece");
      });
    } catch (const std::runtime_error&) {
      caught = true;
    }
    CHECK(caught && covers(100, 1));
  }

  // One thread where it is asked for.
  auto threads_seen = [] {
    std::set<std::thread::id> ids;
    std::mutex mutex;
    parallel_for(2000, 1, [&](size_t, size_t) {
      std::lock_guard lock(mutex);
      ids.insert(std::this_thread::get_id());
    });
    return ids.size();
  };
  CHECK(threads_seen() <= size_t(thread_count()));
  {
    ThreadLimit one(1);
    CHECK(thread_count() == 1 && threads_seen() == 1);
    ThreadLimit none(0), many(1000);
    CHECK(thread_count() == 1);
  }
  CHECK(thread_count() == int(std::max(1u, std::thread::hardware_concurrency())));
  run_serially([&] { CHECK(threads_seen() == 1); });
  if (failures == 0) std::printf("own_threads passed\n");
  return failures != 0;
}

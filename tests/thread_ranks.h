#pragma once
// Ranks (core/ranks.h) that are threads of one process: as those of MPI, but in a test.
#include <lambent/core/ranks.h>

#include <barrier>
#include <memory>
#include <thread>

namespace lambent {

class ThreadRanks final : public Ranks {
 public:
  struct Job {
    explicit Job(int n) : barrier(n), give(size_t(n)), flags(size_t(n)), from(nullptr) {}
    std::barrier<> barrier;
    std::vector<std::span<const std::span<const uint8_t>>> give;
    std::vector<char> flags;
    const uint8_t* from;
  };
  ThreadRanks(Job& job, int rank, int count) : job_(job), rank_(rank), count_(count) {}
  int rank() const override { return rank_; }
  int count() const override { return count_; }
  bool all(bool mine) override {
    job_.flags[size_t(rank_)] = mine;
    job_.barrier.arrive_and_wait();
    bool every = true;
    for (char f : job_.flags) every = every && f;
    job_.barrier.arrive_and_wait();
    return every;
  }
  void broadcast(std::span<uint8_t> bytes) override {
    if (rank_ == 0) job_.from = bytes.data();
    job_.barrier.arrive_and_wait();
    if (rank_ > 0) std::copy_n(job_.from, bytes.size(), bytes.data());
    job_.barrier.arrive_and_wait();
  }
  void exchange(std::span<const std::span<const uint8_t>> give, std::span<const std::span<uint8_t>> take) override {
    job_.give[size_t(rank_)] = give;
    job_.barrier.arrive_and_wait();
    for (size_t k = 0; k < size_t(count_); ++k) {
      if (int(k) == rank_ || take[k].empty()) continue;
      const std::span<const uint8_t> from = job_.give[k][size_t(rank_)];
      if (from.size() != take[k].size()) std::abort();
      std::copy_n(from.data(), from.size(), take[k].data()), received += from.size();
    }
    job_.barrier.arrive_and_wait();
  }

 private:
  Job& job_;
  int rank_, count_;
};

// work(Progress*) on so many ranks; the results in their order.
template <class Work>
auto by_ranks(int count, Work work) {
  using Result = decltype(work(static_cast<Progress*>(nullptr)));
  ThreadRanks::Job job(count);
  std::vector<std::unique_ptr<Result>> results(static_cast<size_t>(count));
  std::vector<std::thread> threads;
  for (int k = 0; k < count; ++k)
    threads.emplace_back([&, k] {
      ThreadRanks ranks(job, k, count);
      const WithRanks with(ranks);
      Progress progress;
      results[size_t(k)] = std::make_unique<Result>(work(&progress));
    });
  for (std::thread& t : threads) t.join();
  return results;
}

}  // namespace lambent

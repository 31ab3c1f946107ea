#pragma once
// gather_point() (gather.h) in two steps, for ranks that have rows of the solution that it reads from each other: what
// rays meet is kept, the rows that it names are asked for (asked_rows.h), and then it is added up.
#include <lambent/bake/gather.h>

#include <atomic>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

namespace lambent {

// A receiver that a ray met, and how much of its row comes back.
struct MetRow {
  uint32_t receiver;
  Vec3 weight;
};

// As gather_point() but for what surfaces send back, which becomes `met`, in the order of the rays; null: not asked
// for.
bool trace_point(const GatherSetup& setup, GatherScratch& scratch, Vec3 origin, Vec3 normal, uint64_t key,
                 const GatherSky& sky, std::vector<MetRow>* met, const GatherDirect* direct = nullptr);
// reflected, `width` floats, set to the sum.
void add_up(const std::vector<MetRow>& met, size_t channels, const float* x, size_t width, float* reflected);

// Gathers that were traced and wait for the rows that they met. From any thread.
class GathersAhead {
 public:
  struct Traced {
    bool clear = true;       // as gather_point() returns it
    std::vector<float> row;  // what is not met
    std::vector<MetRow> met;
  };
  explicit GathersAhead(size_t receivers) : asked_(receivers) {}

  // Whether it is clear.
  bool put(uint64_t key, Traced traced) {
    const bool clear = traced.clear;
    for (const MetRow& m : traced.met) std::atomic_ref(asked_[m.receiver]).store(1, std::memory_order_relaxed);
    std::lock_guard lock(mutex_);
    waiting_.insert_or_assign(key, std::move(traced));
    return clear;
  }
  std::optional<Traced> take(uint64_t key) {
    std::lock_guard lock(mutex_);
    auto node = waiting_.extract(key);
    if (node.empty()) return std::nullopt;
    return std::move(node.mapped());
  }
  // Rows that were met since it was asked last.
  std::vector<uint8_t> asked() { return std::exchange(asked_, std::vector<uint8_t>(asked_.size())); }

 private:
  std::mutex mutex_;
  std::unordered_map<uint64_t, Traced> waiting_;
  std::vector<uint8_t> asked_;
};

}  // namespace lambent

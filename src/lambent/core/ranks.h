#pragma once
// Processes that bake one scene together, "ranks", behind one seam: who they are, what they agree on and what they hand
// to each other. One process alone is a rank, too, so that a stage has one way for both: it divides its pieces
// (Shares), makes its own, and gathers those that it needs. Pieces are functions of the inputs alone and sums have a
// fixed order, so the result does not depend on who made what.
//
// Every call is made by all ranks, in the same order, each by its main thread, and outside of parallel loops.
#include <lambent/core/parallel.h>
#include <lambent/core/progress.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace lambent {

// By default the one process that there is.
class Ranks {
 public:
  virtual ~Ranks() = default;
  virtual int rank() const { return 0; }  // [0, count)
  virtual int count() const { return 1; }

  // Whether it is true on all ranks.
  virtual bool all(bool mine) { return mine; }
  // Rank 0's bytes on all of them; of one size.
  virtual void broadcast(std::span<uint8_t>) {}
  // give[k] goes to rank k, and take[k] comes from it; the sizes are known to both. What is one's own is left alone.
  virtual void exchange(std::span<const std::span<const uint8_t>>, std::span<const std::span<uint8_t>>) {}
  // A line of this rank's own, for people.
  virtual void say(const std::string&) {}

  // What other ranks' rows brought here between bounces, and how many times (bake/asked_rows.h).
  uint64_t asked_bytes = 0, asks = 0;
  uint64_t received = 0;  // bytes, of whatever kind

  // Of each rank, in their order.
  std::vector<std::vector<uint8_t>> gather(std::vector<uint8_t> mine);
  uint64_t sum(uint64_t mine);
  template <class T>
  T from_first(T value) {
    static_assert(std::is_trivially_copyable_v<T>);
    broadcast({reinterpret_cast<uint8_t*>(&value), sizeof value});
    return value;
  }
};

// Those that this thread works with; by default this process alone.
Ranks& this_ranks();

// While one lives, what this thread bakes is baked by these ranks. Threads that it starts work for it and have none.
class WithRanks {
 public:
  explicit WithRanks(Ranks& ranks);
  ~WithRanks();
  WithRanks(const WithRanks&) = delete;
  WithRanks& operator=(const WithRanks&) = delete;

 private:
  Ranks* outer_;
};

// No rank was cancelled; if one was, all are from here on.
bool none_cancelled(Progress* progress);

// Which of `count` items belong to which rank. Pieces of `grain` items are divided in stripes: what lies side by side,
// which often costs alike and asks for each other, stays together, and yet each rank has some of everywhere.
class Shares {
 public:
  Shares() : Shares(0, 1) {}
  Shares(size_t count, size_t grain);                                                         // among this_ranks()
  static Shares of_one(size_t count, size_t grain) { return Shares(count, grain, nullptr); }  // all one's own

  Ranks& ranks() const { return *ranks_; }
  bool alone() const { return size_ == 1; }
  size_t own() const { return size_of(rank_); }  // items
  size_t size_of(int rank) const;
  int owner(size_t item) const { return size_ == 1 ? 0 : int(stripe_of(item / grain_) % size_t(size_)); }
  // As parallel_for over all items, of this rank's alone.
  void for_own(PieceBody body) const;
  // f(first item, end) for each stripe of a rank, in order.
  template <class F>
  void each_stripe(int rank, F f) const {
    for (size_t s = size_t(rank); s < stripes_; s += size_t(size_)) f(first_of(s), first_of(s + 1));
  }

  // rows is [item][width]: each rank has made its own, and gets the others'.
  template <class T>
  void gather(T* rows, size_t width = 1) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (size_ > 1) gather_bytes(reinterpret_cast<uint8_t*>(rows), width * sizeof(T));
  }
  // The same of what there is one of for each `items`, which divide the grain: [item / items][width].
  template <class T>
  void gather_each(size_t items, T* values, size_t width = 1) const {
    if (size_ > 1) by(items).gather(values, width);
  }
  template <class T>
  void gather_pieces(T* values, size_t width = 1) const {
    gather_each(grain_, values, width);
  }

 private:
  Shares(size_t count, size_t grain, Ranks* ranks);
  Shares by(size_t items) const;
  void gather_bytes(uint8_t* rows, size_t each) const;
  size_t pieces() const { return (count_ + grain_ - 1) / grain_; }
  size_t stripe_of(size_t piece) const { return ((piece + 1) * stripes_ - 1) / pieces(); }
  size_t first_piece(size_t stripe) const { return stripe * pieces() / stripes_; }
  size_t first_of(size_t stripe) const { return std::min(count_, first_piece(stripe) * grain_); }

  Ranks* ranks_;
  int rank_, size_;
  size_t count_, grain_, stripes_;
};

// While one lives, files that this thread writes whole (core/file.h) are written by all ranks, each its part of the
// same bytes, where all see the first one's folder; else by that one alone. They are all there in the end, or none.
class WriteTogether {
 public:
  explicit WriteTogether(Ranks& ranks);
  ~WriteTogether();
  WriteTogether(const WriteTogether&) = delete;
  WriteTogether& operator=(const WriteTogether&) = delete;

 private:
  Ranks* outer_;
};

}  // namespace lambent

#pragma once
// Who of the ranks works for which room, in what order rooms are visited, and the search for the nodes of their
// openings.
#include <lambent/bake/room_space.h>
#include <lambent/core/checkpoint.h>
#include <lambent/core/ranks.h>
#include <lambent/receivers/receivers.h>

#include <functional>
#include <utility>

namespace lambent {

struct RoomWork {
  // Rooms of a step have no opening in common, and none that rays are handed on to, so that none of them asks for nodes
  // that another makes.
  std::vector<std::vector<uint32_t>> steps;
  std::vector<int> owner;  // of each room, the rank

  // Whatever the number of ranks the steps are the same; `cost` of each room spreads them.
  RoomWork() = default;
  RoomWork(const RoomSpace& space, const std::vector<size_t>& cost);
};

// Of each room, its receivers that rays of other rooms see, on surfaces that reach into both, or that fill others
// there.
std::vector<std::vector<uint32_t>> lent_receivers(const RoomSpace& space, const Scene& scene,
                                                  const CornerReceivers& basis, const std::vector<uint32_t>& room_of);

// Rows [first, second).
using RowRuns = std::vector<std::pair<size_t, size_t>>;
// Each rank has made the rows of these rooms that are its own, x[row][width], and gets the others'; the bytes it took.
uint64_t hand_rows(const RoomWork& work, const std::vector<uint32_t>& rooms,
                   const std::function<RowRuns(uint32_t)>& runs_of, float* x, size_t width);

// give[k] goes to rank k; what comes from all, one's own first.
template <class T>
std::vector<T> hand_over(std::vector<std::vector<T>> give) {
  Ranks& ranks = this_ranks();
  const size_t n = size_t(ranks.count()), self = size_t(ranks.rank());
  std::vector<T> out = std::move(give[self]);
  if (n == 1) return out;
  give[self] = {};
  std::vector<uint64_t> mine(n), theirs(n, 0);
  std::vector<std::span<const uint8_t>> from(n);
  std::vector<std::span<uint8_t>> to(n);
  for (size_t k = 0; k < n; ++k) {
    mine[k] = give[k].size();
    from[k] = checkpoint_detail::bytes_of(mine[k]), to[k] = checkpoint_detail::bytes_of(theirs[k]);
  }
  ranks.exchange(from, to);
  std::vector<std::vector<T>> take(n);
  for (size_t k = 0; k < n; ++k) {
    if (k != self) take[k].resize(theirs[k]);
    from[k] = checkpoint_detail::bytes_of(give[k]), to[k] = checkpoint_detail::bytes_of(take[k]);
  }
  ranks.exchange(from, to);
  for (const auto& t : take) out.insert(out.end(), t.begin(), t.end()), ranks.asked_bytes += t.size() * sizeof(T);
  return out;
}

struct RoomSurfaces;

struct FieldSize {
  size_t nodes = 0, rays = 0;
};

// Nodes that rays of receivers end at, by a few of them, and those that rays of nodes do, generation by generation;
// beyond openings that are handed on, too. Each rank follows those of its rooms, and keeps the rays of their nodes; all
// come to know how many nodes there are. False, and no node numbered, as soon as there are more than `most`. Errors:
// cancelled; a room without a tree.
Result<bool> find_nodes(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                        const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                        uint32_t seed, const FieldSize& most, Progress* progress);

}  // namespace lambent

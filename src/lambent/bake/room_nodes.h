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

struct RoomSurfaces;

// Nodes that rays of receivers end at, by a few of them, and those that rays of nodes do, generation by generation;
// beyond openings that are handed on, too. Each rank follows those of its rooms; all come to know all nodes. Errors:
// cancelled; a room without a tree.
Result<void> find_nodes(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                        const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                        uint32_t seed, Progress* progress);

}  // namespace lambent

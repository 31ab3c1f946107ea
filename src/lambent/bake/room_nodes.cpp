#include <lambent/bake/room_nodes.h>

#include <lambent/bake/directions.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/room_rays.h>
#include <lambent/core/aligned.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <tuple>

namespace lambent {
namespace {

constexpr int first_rays = 256;      // a receiver, which find the nodes
constexpr int most_generations = 6;  // of nodes that rays of nodes find
constexpr size_t grain = 64;

using Found = std::vector<std::vector<Crossing>>;  // of each block of receivers or nodes
using NodesOfRooms = std::vector<std::vector<uint32_t>>;

Found cross_from_receivers(const RoomSpace& space, size_t room, const Tracer& tracer, const Receivers& receivers,
                           const std::vector<uint32_t>& own, const DirectionSets& few, uint32_t seed) {
  Found found((own.size() + grain - 1) / grain);
  parallel_for(own.size(), grain, [&](size_t begin, size_t end) {
    AlignedVector<float> dx(few.stride), dy(few.stride), dz(few.stride);
    std::vector<Hit> hits(first_rays);
    for (size_t i = begin; i < end; ++i) {
      const uint32_t r = own[i];
      const DirectionChoice c = choose_directions(few, receivers.normals[r], seed, r);
      const size_t base = size_t(c.set) * few.stride;
      rotate_directions(c.rotation, few.x.data() + base, few.y.data() + base, few.z.data() + base, few.stride,
                        dx.data(), dy.data(), dz.data());
      tracer.closest_fan(receivers.origins[r], {dx.data(), dy.data(), dz.data(), first_rays}, hits.data());
      for (size_t j = 0; j < first_rays; ++j) {
        const Exit exit = space.exit(room, receivers.origins[r], {dx[j], dy[j], dz[j]}, hits[j]);
        if (exit.opening != none) found[begin / grain].push_back({exit, uint32_t(hash64(r, j))});
      }
    }
  });
  return found;
}

Found cross_from_nodes(const RoomSpace& space, size_t room, const Tracer& tracer, const std::vector<uint32_t>& nodes) {
  Found found((nodes.size() + grain - 1) / grain);
  parallel_for(nodes.size(), grain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (const NodeRay& ray : space.rays_of(nodes[i])) {
        const Exit exit = space.exit(room, ray.origin, ray.direction, tracer.closest(ray.origin, ray.direction));
        if (exit.opening != none) found[begin / grain].push_back({exit, uint32_t(hash64(nodes[i], ray.key))});
      }
  });
  return found;
}

// Of those at each cell the ones that its node would keep.
std::vector<Crossing> least_crossings(const Found& found) {
  std::vector<Crossing> all;
  for (const auto& block : found) all.insert(all.end(), block.begin(), block.end());
  std::sort(all.begin(), all.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.exit.opening, a.exit.cell, a.key, a.exit.at.x, a.exit.at.y, a.exit.at.z) <
           std::tie(b.exit.opening, b.exit.cell, b.key, b.exit.at.x, b.exit.at.y, b.exit.at.z);
  });
  size_t count = 0, of_cell = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    const bool same = i > 0 && all[i].exit.opening == all[i - 1].exit.opening &&
                      all[i].exit.cell == all[i - 1].exit.cell;
    of_cell = same ? of_cell + 1 : 0;
    if (of_cell < size_t(most_node_rays)) all[count++] = all[i];
  }
  all.resize(count);
  return all;
}

// Each rank has found those of its rooms, and gets the others'.
void share(Found& found, const RoomWork& work) {
  Ranks& ranks = this_ranks();
  if (ranks.count() == 1) return;
  std::vector<uint8_t> mine;
  for (size_t room = 0; room < found.size(); ++room)
    if (work.owner[room] == ranks.rank()) checkpoint_detail::put(mine, checkpoint_detail::bytes_of(found[room]));
  const auto all = ranks.gather(std::move(mine));
  std::vector<size_t> at(all.size(), 0);
  for (size_t room = 0; room < found.size(); ++room) {
    const size_t from = size_t(work.owner[room]);
    if (int(from) == ranks.rank()) continue;
    std::span<const uint8_t> part;
    checkpoint_detail::get(all[from], at[from], part);
    found[room].resize(part.size() / sizeof(Crossing));
    std::copy(part.begin(), part.end(), checkpoint_detail::bytes_of(found[room]).begin());
  }
}

}  // namespace

std::vector<std::vector<uint32_t>> lent_receivers(const RoomSpace& space, const Scene& scene,
                                                  const CornerReceivers& basis, const std::vector<uint32_t>& room_of) {
  std::vector<uint8_t> is_lent(room_of.size(), 0);
  parallel_for(scene.triangles.size(), 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Bounds reach;
      for (const uint32_t v : scene.triangles[i].v) reach.extend(scene.positions[v]);
      std::vector<uint32_t> rooms, own;
      for (uint32_t room = 0; room < space.rooms.size(); ++room)
        if (space.is_reached(room, reach)) rooms.push_back(room);
      for (const bool front : {true, false})
        if (const Corners* at = basis.find(uint32_t(i), front))
          own.insert(own.end(), at->receiver.begin(), at->receiver.end());
      for (const uint32_t r : own) rooms.push_back(room_of[r]);
      for (const uint32_t r : own)
        if (std::any_of(rooms.begin(), rooms.end(), [&](uint32_t room) { return room != room_of[r]; }))
          std::atomic_ref(is_lent[r]).store(1, std::memory_order_relaxed);
    }
  });
  std::vector<std::vector<uint32_t>> lent(space.rooms.size());
  for (uint32_t r = 0; r < room_of.size(); ++r)
    if (is_lent[r]) lent[room_of[r]].push_back(r);
  return lent;
}

namespace {

// Of each room, those whose openings' nodes its rays may end at, or the other way round: beyond its openings, and
// beyond those of rooms that rays are handed on through.
std::vector<std::vector<uint32_t>> rooms_beside(const RoomSpace& space) {
  const size_t count = space.rooms.size();
  std::vector<std::vector<uint32_t>> beside(count), on(count);
  for (const Opening& o : space.openings)
    if (o.handed) on[o.room].push_back(o.beyond);
  for (uint32_t room = 0; room < count; ++room) {
    std::vector<uint32_t> reached{room};
    std::vector<bool> is_reached(count);
    is_reached[room] = true;
    for (size_t k = 0; k < reached.size(); ++k)
      for (const uint32_t next : on[reached[k]])
        if (!is_reached[next]) is_reached[next] = true, reached.push_back(next);
    for (const Opening& o : space.openings)
      if (is_reached[o.room] && o.beyond != room && (o.room == room || !o.handed))
        beside[room].push_back(o.beyond), beside[o.beyond].push_back(room);
  }
  return beside;
}

}  // namespace

RoomWork::RoomWork(const RoomSpace& space, const std::vector<size_t>& cost) : owner(space.rooms.size(), 0) {
  const size_t count = space.rooms.size();
  const std::vector<std::vector<uint32_t>> beside = rooms_beside(space);
  std::vector<size_t> step(count, count);
  for (uint32_t room = 0; room < count; ++room) {
    std::vector<bool> taken(count + 1);
    for (const uint32_t other : beside[room]) taken[step[other]] = true;
    step[room] = size_t(std::find(taken.begin(), taken.end(), false) - taken.begin());
    if (step[room] >= steps.size()) steps.resize(step[room] + 1);
    steps[step[room]].push_back(room);
  }
  // In each step the dearest first, to whom has least to do in it, and in all.
  const size_t ranks = size_t(this_ranks().count());
  std::vector<size_t> in_all(ranks, 0);
  for (auto rooms : steps) {
    std::stable_sort(rooms.begin(), rooms.end(), [&](uint32_t a, uint32_t b) { return cost[a] > cost[b]; });
    std::vector<size_t> in_step(ranks, 0);
    for (const uint32_t room : rooms) {
      size_t least = 0;
      for (size_t k = 1; k < ranks; ++k)
        if (std::tie(in_step[k], in_all[k]) < std::tie(in_step[least], in_all[least])) least = k;
      owner[room] = int(least);
      in_step[least] += cost[room], in_all[least] += cost[room];
    }
  }
}

uint64_t hand_rows(const RoomWork& work, const std::vector<uint32_t>& rooms,
                   const std::function<RowRuns(uint32_t)>& runs_of, float* x, size_t width) {
  Ranks& ranks = this_ranks();
  if (ranks.count() == 1) return 0;
  std::vector<uint8_t> mine;
  for (const uint32_t room : rooms)
    if (work.owner[room] == ranks.rank())
      for (const auto& run : runs_of(room)) {
        const auto* bytes = reinterpret_cast<const uint8_t*>(x + run.first * width);
        mine.insert(mine.end(), bytes, bytes + (run.second - run.first) * width * sizeof(float));
      }
  const auto each = ranks.gather(std::move(mine));
  std::vector<size_t> at(each.size(), 0);
  uint64_t taken = 0;
  for (const uint32_t room : rooms) {
    const size_t from = size_t(work.owner[room]);
    if (int(from) == ranks.rank()) continue;
    for (const auto& run : runs_of(room)) {
      const size_t bytes = (run.second - run.first) * width * sizeof(float);
      if (bytes > 0) std::memcpy(x + run.first * width, each[from].data() + at[from], bytes);
      at[from] += bytes, taken += bytes;
    }
  }
  return taken;
}

namespace {

struct NodeSearch {
  RoomSpace& space;
  const RoomWork& work;
  const RoomSurfaces& surfaces;
  const Receivers& receivers;
  const std::vector<std::vector<uint32_t>>& receivers_of;
  uint32_t seed;
  Progress* progress;
  const KeptPieces& pieces;
  const DirectionSets few = make_direction_sets(1, first_rays, 8, uint32_t(hash64(seed, 0x726f6f6d)));
  Ranks& ranks = this_ranks();

  // Where rays of a room cross; those that go on beyond it are added to `on`.
  Result<std::vector<Crossing>> cross(size_t generation, uint32_t room, const std::vector<uint32_t>& nodes,
                                      std::vector<Traveller>& on) const {
    auto geometry = space.geometry(room, surfaces.scene);
    if (!geometry) return geometry.error();
    Found found = generation == 0
                    ? cross_from_receivers(space, room, geometry->tracer, receivers, receivers_of[room], few, seed)
                    : cross_from_nodes(space, room, geometry->tracer, nodes);
    for (auto& block : found)
      std::erase_if(block, [&](const Crossing& c) {
        if (!space.openings[c.exit.opening].handed) return false;
        const uint32_t beyond = space.openings[c.exit.opening].beyond;
        on.push_back({uint64_t(c.key) << 32 | on.size(), c.exit.at, c.exit.direction, beyond, 1, ranks.rank()});
        return true;
      });
    return least_crossings(found);
  }

  // Of one of each rank's rooms, `none` if it has no more; ranks do theirs side by side, since rays go on from one's
  // rooms to another's.
  Result<void> search(size_t generation, uint32_t room, const NodesOfRooms& nodes, Found& found) const {
    std::vector<Traveller> on;
    const size_t piece = generation * space.rooms.size() + room;
    const bool there = room == none || (generation > 0 && nodes[room].empty()) || pieces.load(piece, found[room]);
    Result<void> ok;
    if (!there && !is_cancelled(progress)) {
      auto crossed = cross(generation, room, nodes[room], on);
      if (crossed) found[room] = std::move(*crossed);
      else ok = crossed.error();
    }
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (!ranks.all(bool(ok))) return ok ? Error{surfaces.scene.path, "another rank has no tree of a room"} : ok;
    auto ends = follow(space, work, surfaces, std::move(on), false, progress);
    if (!ends) return ends.error();
    if (there) return {};
    Found further(1);
    for (const Traveller& t : *ends)
      if (t.end == Traveller::End::field)
        further[0].push_back({{t.receiver[0], false, t.receiver[1], t.at, t.direction}, uint32_t(t.tag >> 32)});
    further.push_back(std::move(found[room]));
    found[room] = least_crossings(further);
    pieces.save(piece, found[room]);
    return {};
  }
};

}  // namespace

Result<void> find_nodes(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                        const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                        uint32_t seed, Progress* progress) {
  const size_t rooms = space.rooms.size();
  const KeptPieces pieces(progress, "openings", (most_generations + 1) * rooms);
  const NodeSearch search{space, work, surfaces, receivers, receivers_of, seed, progress, pieces};
  std::vector<std::vector<uint32_t>> rooms_of(size_t(search.ranks.count()));
  for (uint32_t room = 0; room < rooms; ++room) rooms_of[size_t(work.owner[room])].push_back(room);
  size_t most = 0;
  for (const auto& own : rooms_of) most = std::max(most, own.size());
  ProgressStage stage(progress, "finding openings", (most_generations + 1) * most);
  NodesOfRooms fresh(rooms);  // nodes whose rays have not been followed
  for (size_t generation = 0; generation <= most_generations; ++generation) {
    NodesOfRooms now(rooms);
    now.swap(fresh);
    Found found(rooms);
    const auto& own = rooms_of[size_t(search.ranks.rank())];
    for (size_t k = 0; k < most; ++k, stage.advance())
      if (auto ok = search.search(generation, k < own.size() ? own[k] : none, now, found); !ok) return ok;
    share(found, work);
    for (const auto& of_room : found)
      for (const Crossing& c : of_room) space.take(c, fresh);
  }
  space.number_nodes();
  return {};
}

}  // namespace lambent

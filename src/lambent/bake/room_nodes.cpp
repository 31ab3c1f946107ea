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
#include <mutex>
#include <tuple>

namespace lambent {
namespace {

constexpr int first_rays = 256;      // a receiver, which find the nodes
constexpr int most_generations = 6;  // of nodes that rays of nodes find
constexpr size_t grain = 64;

constexpr size_t least_sorted = 1 << 19;  // crossings, at once

// Crossings of a room's rays, of which those of each cell that are least stay.
struct Found {
  std::vector<Crossing> kept;
  size_t most = SIZE_MAX;  // beyond these, there are too many
  size_t sorted = 0;
  std::atomic<bool> too_many{false};
  std::mutex mutex;

  void add(const std::vector<Crossing>& more) {
    const std::lock_guard lock(mutex);
    if (too_many) return;
    if (kept.size() + more.size() > kept.capacity()) {
      if (kept.size() > sorted) finish();
      kept.reserve(std::max(least_sorted, sorted + sorted / 2) + more.size());
    }
    kept.insert(kept.end(), more.begin(), more.end());
  }
  void finish() {
    keep_least(kept), sorted = kept.size();
    if (sorted > most) too_many = true, kept = {};
  }
};

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

// Of each room, itself and those that its rays are handed on into.
std::vector<std::vector<uint32_t>> rooms_reached(const RoomSpace& space) {
  const size_t count = space.rooms.size();
  std::vector<std::vector<uint32_t>> on(count), reached(count);
  for (const Opening& o : space.openings)
    if (o.handed) on[o.room].push_back(o.beyond);
  for (uint32_t room = 0; room < count; ++room) {
    reached[room] = {room};
    std::vector<bool> is_reached(count);
    is_reached[room] = true;
    for (size_t k = 0; k < reached[room].size(); ++k)
      for (const uint32_t next : on[reached[room][k]])
        if (!is_reached[next]) is_reached[next] = true, reached[room].push_back(next);
  }
  return reached;
}

// Of each room, those whose openings' nodes its rays may end at, or the other way round: beyond its openings, and
// beyond those of rooms that rays are handed on through.
std::vector<std::vector<uint32_t>> rooms_beside(const RoomSpace& space) {
  const auto reached = rooms_reached(space);
  std::vector<std::vector<uint32_t>> beside(space.rooms.size());
  for (uint32_t room = 0; room < beside.size(); ++room)
    for (const Opening& o : space.openings) {
      const bool is_reached = std::find(reached[room].begin(), reached[room].end(), o.room) != reached[room].end();
      if (is_reached && o.beyond != room && (o.room == room || !o.handed))
        beside[room].push_back(o.beyond), beside[o.beyond].push_back(room);
    }
  return beside;
}

// Of openings, whether rays of this rank's rooms may end there.
std::vector<uint8_t> openings_asked(const RoomSpace& space, const RoomWork& work) {
  const auto reached = rooms_reached(space);
  std::vector<uint8_t> from(space.rooms.size(), 0), asked(space.openings.size(), 0);
  for (size_t room = 0; room < from.size(); ++room)
    for (const uint32_t r : reached[room])
      if (work.owner[room] == this_ranks().rank()) from[r] = 1;
  for (size_t i = 0; i < asked.size(); ++i) asked[i] = from[space.openings[i].room] && !space.openings[i].handed;
  return asked;
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
  const FieldSize& most;
  Progress* progress;
  const KeptPieces& pieces;
  const DirectionSets few = make_direction_sets(1, first_rays, 8, uint32_t(hash64(seed, 0x726f6f6d)));
  Ranks& ranks = this_ranks();

  // A ray to where it leaves the room: to `found`, or to `on`, where it goes on beyond.
  void note(const Exit& exit, uint64_t key, std::vector<Crossing>& found, std::vector<Traveller>& on) const {
    if (exit.opening == none) return;
    const Opening& o = space.openings[exit.opening];
    if (!o.handed) return found.push_back(space.crossing(exit, key));
    on.push_back({key, exit.at, exit.direction, uint16_t(o.beyond), 1, uint16_t(ranks.rank())});
  }

  void cross_from_receivers(uint32_t room, const Tracer& tracer, Found& all, std::vector<Traveller>& on) const {
    const std::vector<uint32_t>& own = receivers_of[room];
    parallel_for(own.size(), grain, [&](size_t begin, size_t end) {
      AlignedVector<float> dx(few.stride), dy(few.stride), dz(few.stride);
      std::vector<Hit> hits(first_rays);
      std::vector<Crossing> found;
      std::vector<Traveller> beyond;
      for (size_t i = begin; i < end && !all.too_many; ++i) {
        const uint32_t r = own[i];
        const DirectionChoice c = choose_directions(few, receivers.normals[r], seed, r);
        const size_t base = size_t(c.set) * few.stride;
        rotate_directions(c.rotation, few.x.data() + base, few.y.data() + base, few.z.data() + base, few.stride,
                          dx.data(), dy.data(), dz.data());
        tracer.closest_fan(receivers.origins[r], {dx.data(), dy.data(), dz.data(), first_rays}, hits.data());
        for (size_t j = 0; j < first_rays; ++j)
          note(space.exit(room, receivers.origins[r], {dx[j], dy[j], dz[j]}, hits[j]), hash64(r, j), found, beyond);
      }
      add(found, beyond, all, on);
    });
  }

  // From cells that the search before this has met.
  void cross_from_nodes(uint32_t room, uint8_t generation, const Tracer& tracer, Found& all,
                        std::vector<Traveller>& on) const {
    for (uint32_t k = 0; k < space.openings.size(); ++k) {
      const Opening& o = space.openings[k];
      if (o.beyond != room) continue;
      parallel_for(o.rays.cells.size(), grain, [&](size_t begin, size_t end) {
        std::vector<Crossing> found;
        std::vector<Traveller> beyond;
        for (size_t i = begin; i < end && !all.too_many; ++i) {
          if (o.rays.generation[i] + 1 != generation) continue;
          const uint64_t cell = uint64_t(k) << 32 | o.rays.cells[i];
          for (const CellRay r : o.rays.of(i)) {
            const NodeRay ray = space.ray(o, o.rays.cells[i], r);
            note(space.exit(room, ray.origin, ray.direction, tracer.closest(ray.origin, ray.direction)),
                 hash64(cell, r), found, beyond);
          }
        }
        add(found, beyond, all, on);
      });
    }
  }

  void add(const std::vector<Crossing>& found, const std::vector<Traveller>& beyond, Found& all,
           std::vector<Traveller>& on) const {
    if (!found.empty()) all.add(found);
    if (beyond.empty()) return;
    const std::lock_guard lock(all.mutex);
    on.insert(on.end(), beyond.begin(), beyond.end());
  }

  bool has_rays(uint32_t room, uint8_t generation) const {
    if (generation == 0) return true;
    return std::any_of(space.openings.begin(), space.openings.end(), [&](const Opening& o) {
      const auto& g = o.rays.generation;
      return o.beyond == room && std::find(g.begin(), g.end(), generation - 1) != g.end();
    });
  }

  // Of one of each rank's rooms, `none` if it has no more; ranks do theirs side by side, since rays go on from one's
  // rooms to another's. What was found there, to the rank of the room beyond.
  Result<std::vector<Crossing>> search(uint8_t generation, uint32_t room, bool& too_many) const {
    std::vector<Traveller> on;
    Found found{.most = most.rays};
    const size_t piece = generation * space.rooms.size() + room;
    const bool there = room == none || !has_rays(room, generation) || pieces.load(piece, found.kept);
    Result<void> ok;
    if (!there && !is_cancelled(progress)) {
      auto geometry = space.geometry(room, surfaces.scene);
      if (!geometry) ok = geometry.error();
      else if (generation == 0) cross_from_receivers(room, geometry->tracer, found, on);
      else cross_from_nodes(room, generation, geometry->tracer, found, on);
    }
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (!ranks.all(bool(ok))) return ok ? Error{surfaces.scene.path, "another rank has no tree of a room"} : ok.error();
    auto ends = follow(space, work, surfaces, std::move(on), false, progress);
    if (!ends) return ends.error();
    if (!there && !found.too_many) {
      for (const Traveller& t : *ends)
        if (t.end == Traveller::End::field)
          found.kept.push_back(space.crossing({t.receiver[0], false, t.receiver[1], t.at, t.direction}, t.tag));
      found.finish();
      if (!found.too_many) pieces.save(piece, found.kept);
    }
    too_many = !ranks.all(!found.too_many);
    if (too_many) return std::vector<Crossing>();
    std::vector<std::vector<Crossing>> give(size_t(ranks.count()));
    for (const Crossing& c : found.kept) give[size_t(work.owner[space.openings[c.opening].beyond])].push_back(c);
    found.kept = {};
    return hand_over(std::move(give));
  }

  // Of this rank's rooms.
  FieldSize size() const {
    FieldSize sum;
    for (const Opening& o : space.openings) sum.nodes += o.rays.cells.size(), sum.rays += o.rays.rays.size();
    return sum;
  }

  // In which crossings come does not matter: of each cell the least stay.
  void take(std::vector<Crossing> crossings, uint8_t generation) const {
    keep_least(crossings);
    for (size_t begin = 0, end; begin < crossings.size(); begin = end) {
      const uint32_t o = crossings[begin].opening;
      for (end = begin; end < crossings.size() && crossings[end].opening == o;) ++end;
      space.openings[o].rays.merge(std::span(crossings).subspan(begin, end - begin), generation);
    }
  }
};

}  // namespace

Result<bool> find_nodes(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                        const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                        uint32_t seed, const FieldSize& most, Progress* progress) {
  const size_t rooms = space.rooms.size();
  const KeptPieces pieces(progress, "openings", (most_generations + 1) * rooms);
  const NodeSearch search{space, work, surfaces, receivers, receivers_of, seed, most, progress, pieces};
  std::vector<std::vector<uint32_t>> rooms_of(size_t(search.ranks.count()));
  for (uint32_t room = 0; room < rooms; ++room) rooms_of[size_t(work.owner[room])].push_back(room);
  size_t steps = 0;
  for (const auto& own : rooms_of) steps = std::max(steps, own.size());
  ProgressStage stage(progress, "finding openings", (most_generations + 1) * steps);
  for (uint8_t generation = 0; generation <= most_generations; ++generation) {
    const auto& own = rooms_of[size_t(search.ranks.rank())];
    std::vector<Crossing> later;  // those whose rays are being followed stay what they are
    for (size_t k = 0; k < steps; ++k, stage.advance()) {
      bool too_many = false;
      auto found = search.search(generation, k < own.size() ? own[k] : none, too_many);
      if (!found) return found.error();
      if (too_many) return false;
      if (generation == 0) search.take(std::move(*found), generation);
      else later.insert(later.end(), found->begin(), found->end());
      const FieldSize size = search.size();
      if (search.ranks.sum(size.nodes) > most.nodes || search.ranks.sum(size.rays) > most.rays) return false;
    }
    search.take(std::move(later), generation);
  }
  space.number_nodes(openings_asked(space, work));
  const FieldSize size = search.size();
  return search.ranks.sum(size.nodes) <= most.nodes && search.ranks.sum(size.rays) <= most.rays;
}

}  // namespace lambent

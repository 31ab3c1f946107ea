#include <lambent/bake/room_rays.h>

#include <lambent/bake/directions.h>
#include <lambent/bake/kernels.h>
#include <lambent/basis/sh.h>
#include <lambent/core/aligned.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace lambent {
namespace {

constexpr uint16_t most_passed = 4096;  // openings of a ray; more than there can be, but for rounding
constexpr size_t grain = 1024;

struct Journey {
  const RoomSpace& space;
  const RoomWork& work;
  const RoomSurfaces& surfaces;
  bool all;
  Progress* progress;
  Ranks& ranks = this_ranks();
  std::vector<std::vector<Traveller>> in_room = std::vector<std::vector<Traveller>>(space.rooms.size());
  std::vector<std::vector<Traveller>> leaving = std::vector<std::vector<Traveller>>(size_t(ranks.count()));
  std::vector<std::vector<Traveller>> done = leaving;  // by the rank that sent them

  void put(const Traveller& t) {
    if (t.end != Traveller::End::none) done[size_t(t.home)].push_back(t);
    else if (const int owner = work.owner[t.room]; owner == ranks.rank()) in_room[t.room].push_back(t);
    else leaving[size_t(owner)].push_back(t);
  }

  // In memory for as many as there are: they are most of what handing on takes.
  void put_all(std::vector<Traveller> these) {
    std::vector<size_t> into(in_room.size(), 0);
    for (const Traveller& t : these) into[t.room] += t.end == Traveller::End::none;
    for (size_t room = 0; room < into.size(); ++room)
      if (work.owner[room] == ranks.rank()) in_room[room].reserve(in_room[room].size() + into[room]);
    for (const Traveller& t : these) put(t);
  }

  // Through its room.
  void step(const RoomGeometry& geometry, Traveller& t) const {
    const Hit hit = geometry.tracer.closest(t.at, t.direction);
    const Exit exit = space.exit(t.room, t.at, t.direction, hit);
    if (exit.outside) {
      t.end = Traveller::End::outside;
    } else if (exit.opening != none) {
      const Opening& o = space.openings[exit.opening];
      t.at = exit.at;
      if (all || o.handed) t.room = uint16_t(o.beyond), t.end = ++t.passed > most_passed ? Traveller::End::lost : t.end;
      else t.end = Traveller::End::field, t.receiver = {exit.opening, exit.cell, 0};
    } else {
      const uint32_t triangle = geometry.triangles[hit.triangle];
      const Corners* at = surfaces.basis.find(triangle, hit.front);
      t.end = at ? Traveller::End::surface : Traveller::End::back;
      if (at) t.at = surfaces.reflected(triangle, *at, hit), t.receiver = at->receiver, t.direction = {hit.u, hit.v, 0};
    }
  }

  // Those in this rank's rooms, until they have ended or are in other ranks'.
  Result<void> through_own_rooms() {
    for (bool moved = true; moved && !is_cancelled(progress);) {
      moved = false;
      for (size_t room = 0; room < in_room.size() && !is_cancelled(progress); ++room) {
        if (in_room[room].empty()) continue;
        std::vector<Traveller> here;
        here.swap(in_room[room]);
        moved = true;
        auto geometry = space.geometry(room, surfaces.scene);
        if (!geometry) return geometry.error();
        parallel_for(here.size(), grain, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) step(*geometry, here[i]);
        });
        put_all(std::move(here));
      }
    }
    return {};
  }
};

// The stand-in's numbers: of a sky that is each of the harmonics of three bands.
constexpr int stand_order = 3;
using Stand = std::array<double, stand_order * stand_order>;

Stand add(Stand a, const Stand& b, double times) {
  for (size_t k = 0; k < a.size(); ++k) a[k] += times * b[k];
  return a;
}
double product(const Stand& a, const Stand& b) { return std::inner_product(a.begin(), a.end(), b.begin(), 0.0); }
Stand of_sky(Vec3 d) {
  std::array<float, stand_order * stand_order> y;
  evaluate_sh(stand_order, d, y);
  Stand out;
  std::copy(y.begin(), y.end(), out.begin());
  return out;
}
// Half of what an open surface has: the cosine's bands are 1, 2/3 and 1/4 of pi.
Stand of_surface(Vec3 reflected, Vec3 normal) {
  const double half = 0.5 * (reflected.x + reflected.y + reflected.z) / 3;
  Stand out = of_sky(normal);
  for (size_t k = 0; k < out.size(); ++k) out[k] *= half * (k == 0 ? 1.0 : k < 4 ? 2.0 / 3 : 0.25);
  return out;
}

constexpr size_t held_out = 512;  // receivers
constexpr size_t rays_of_each = 256;

// A ray of a receiver that is held out, through an opening.
struct HeldRay {
  uint32_t sample, opening, node;  // node: of the room beyond's, or none
  bool odd;
};

struct Sample {
  uint32_t room;
  Stand all{};  // of its rays that end in its room, and then of all
};

struct LossMeter {
  RoomSpace& space;
  const RoomWork& work;
  const RoomSurfaces& surfaces;
  const Receivers& receivers;
  Progress* progress;
  std::vector<Sample> samples{};
  std::vector<HeldRay> rays{};
  std::vector<Traveller> travellers{};

  Stand end_of(const Traveller& t) const {
    if (t.end == Traveller::End::outside) return of_sky(t.direction);
    return t.end == Traveller::End::surface ? of_surface(t.at, receivers.normals[t.receiver[0]]) : Stand{};
  }

  void send(uint32_t room, uint32_t r, const RoomGeometry& geometry, const DirectionSets& few, uint32_t seed) {
    AlignedVector<float> dx(few.stride), dy(few.stride), dz(few.stride);
    std::vector<Hit> hits(rays_of_each);
    const Vec3 origin = receivers.origins[r];
    const DirectionChoice c = choose_directions(few, receivers.normals[r], seed, r);
    const size_t base = size_t(c.set) * few.stride;
    rotate_directions(c.rotation, few.x.data() + base, few.y.data() + base, few.z.data() + base, few.stride, dx.data(),
                      dy.data(), dz.data());
    geometry.tracer.closest_fan(origin, {dx.data(), dy.data(), dz.data(), rays_of_each}, hits.data());
    Sample sample{room};
    for (size_t j = 0; j < rays_of_each; ++j) {
      const Vec3 d(dx[j], dy[j], dz[j]);
      const Exit exit = space.exit(room, origin, d, hits[j]);
      if (exit.opening != none) {
        const uint32_t beyond = space.openings[exit.opening].beyond;
        travellers.push_back({rays.size(), exit.at, d, uint16_t(beyond), 1, uint16_t(this_ranks().rank())});
        rays.push_back({uint32_t(samples.size()), exit.opening, space.find_node(exit), j % 2 == 1});
      } else if (exit.outside) {
        sample.all = add(sample.all, of_sky(d), 1);
      } else if (const uint32_t triangle = geometry.triangles[hits[j].triangle];
                 const Corners* at = surfaces.basis.find(triangle, hits[j].front)) {
        sample.all = add(sample.all,
                         of_surface(surfaces.reflected(triangle, *at, hits[j]), receivers.normals[at->receiver[0]]), 1);
      }
    }
    samples.push_back(sample);
  }

  Result<void> send_all(const std::vector<std::vector<uint32_t>>& receivers_of, uint32_t seed) {
    const DirectionSets few = make_direction_sets(1, int(rays_of_each), 8, uint32_t(hash64(seed, 0x6c6f7373)));
    const size_t stride = std::max<size_t>(receivers.count() / held_out, 1);
    for (uint32_t room = 0; room < receivers_of.size() && !is_cancelled(progress); ++room) {
      if (work.owner[room] != this_ranks().rank()) continue;
      auto geometry = space.geometry(room, surfaces.scene);
      if (!geometry) return geometry.error();
      for (const uint32_t r : receivers_of[room])
        if (hash64(r, seed) % stride == 0) send(room, r, *geometry, few, seed);
    }
    return {};
  }

  // Of nodes that rays ended at, (room, node), which rise.
  using Nodes = std::vector<std::pair<uint32_t, uint32_t>>;
  struct Mean {
    std::pair<uint32_t, uint32_t> node;
    Stand value;
  };
  Nodes nodes() const {
    Nodes out;
    for (const HeldRay& ray : rays)
      if (ray.node != none) out.emplace_back(space.openings[ray.opening].beyond, ray.node);
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
  }
  // Each rank follows the rays of its rooms' nodes, whoever asks for them.
  Result<std::vector<Stand>> means_of(const Nodes& asked) const {
    Ranks& ranks = this_ranks();
    const auto* bytes = reinterpret_cast<const uint8_t*>(asked.data());
    Nodes own;
    for (const auto& theirs : ranks.gather({bytes, bytes + asked.size() * sizeof(asked[0])})) {
      Nodes nodes(theirs.size() / sizeof(asked[0]));
      if (!theirs.empty()) std::memcpy(static_cast<void*>(nodes.data()), theirs.data(), theirs.size());
      for (const auto& node : nodes)
        if (work.owner[node.first] == ranks.rank()) own.push_back(node);
    }
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    std::array<NodeRay, most_node_rays> buffer;
    std::vector<size_t> counts;
    std::vector<Traveller> sent;
    for (size_t i = 0; i < own.size(); ++i) {
      const auto rays_of = space.rays_of(own[i].first, own[i].second, buffer);
      for (size_t k = 0; k < rays_of.size(); ++k)
        sent.push_back({i * most_node_rays + k, rays_of[k].origin, rays_of[k].direction, uint16_t(own[i].first), 1,
                        uint16_t(ranks.rank())});
      counts.push_back(rays_of.size());
    }
    auto ends = follow(space, work, surfaces, std::move(sent), true, progress);
    if (!ends) return ends.error();
    std::vector<Mean> made(own.size());
    for (size_t i = 0; i < own.size(); ++i) made[i] = {own[i], {}};
    for (const Traveller& t : *ends) {
      const size_t i = t.tag / most_node_rays;
      made[i].value = add(made[i].value, end_of(t), 1.0 / double(counts[i]));
    }
    std::vector<Stand> out(asked.size(), Stand{});
    bytes = reinterpret_cast<const uint8_t*>(made.data());
    for (const auto& theirs : ranks.gather({bytes, bytes + made.size() * sizeof(Mean)})) {
      std::vector<Mean> means(theirs.size() / sizeof(Mean));
      if (!theirs.empty()) std::memcpy(static_cast<void*>(means.data()), theirs.data(), theirs.size());
      for (const Mean& mean : means) {
        const auto at = std::lower_bound(asked.begin(), asked.end(), mean.node);
        if (at != asked.end() && *at == mean.node) out[size_t(at - asked.begin())] = mean.value;
      }
    }
    return out;
  }

  // Of each room's samples: squares of what each opening's field loses, and at the end of the whole.
  std::vector<std::vector<double>> squares(const std::vector<Traveller>& ends, const Nodes& nodes,
                                           const std::vector<Stand>& means) {
    const size_t openings = space.openings.size();
    std::vector<std::vector<double>> out(space.rooms.size(), std::vector<double>(openings + 1, 0.0));
    std::vector<std::array<Stand, 2>> off(openings);
    for (size_t i = 0, s = 0; s < samples.size(); ++s) {
      std::vector<uint32_t> met;
      for (; i < rays.size() && rays[i].sample == s; ++i) {
        const HeldRay& ray = rays[i];
        const Stand exact = end_of(ends[i]);
        Stand told{};
        if (ray.node != none)
          told = means[size_t(
              std::lower_bound(nodes.begin(), nodes.end(), std::pair(space.openings[ray.opening].beyond, ray.node)) -
              nodes.begin())];
        off[ray.opening][ray.odd] = add(add(off[ray.opening][ray.odd], told, 1), exact, -1);
        samples[s].all = add(samples[s].all, exact, 1);
        met.push_back(ray.opening);
      }
      std::vector<double>& sums = out[samples[s].room];
      sums[openings] += product(samples[s].all, samples[s].all);
      for (const uint32_t o : met)  // the first time; then it is nought
        sums[o] += 4 * product(off[o][0], off[o][1]), off[o] = {};
    }
    return out;
  }
};

// All rooms' sums, each from its rank, in the order of rooms.
std::vector<double> sum_of_rooms(const RoomWork& work, const std::vector<std::vector<double>>& mine) {
  Ranks& ranks = this_ranks();
  const size_t width = mine[0].size();
  std::vector<uint8_t> bytes(mine.size() * width * sizeof(double));
  for (size_t room = 0; room < mine.size(); ++room)
    std::memcpy(bytes.data() + room * width * sizeof(double), mine[room].data(), width * sizeof(double));
  const auto each = ranks.gather(std::move(bytes));
  std::vector<double> sum(width, 0.0), one(width);
  for (size_t room = 0; room < mine.size(); ++room) {
    std::memcpy(one.data(), each[size_t(work.owner[room])].data() + room * width * sizeof(double),
                width * sizeof(double));
    for (size_t k = 0; k < width; ++k) sum[k] += one[k];
  }
  return sum;
}

}  // namespace

Vec3 RoomSurfaces::reflected(uint32_t triangle, const Corners& at, const Hit& hit) const {
  const Material& m = scene.materials[scene.parts[at.part].material];
  return m.base_color_texture >= 0 || !scene.colors.empty() ? albedo(scene, scene.triangles[triangle], hit.u, hit.v)
                                                            : m.base_color;
}

Result<std::vector<Traveller>> follow(const RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                      std::vector<Traveller> mine, bool all, Progress* progress) {
  Journey journey{space, work, surfaces, all, progress};
  journey.put_all(std::move(mine));
  Ranks& ranks = journey.ranks;
  for (;;) {
    Result<void> ok = journey.through_own_rooms();
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (!ranks.all(bool(ok))) return ok ? Error{surfaces.scene.path, "another rank has no tree of a room"} : ok.error();
    size_t left = 0;
    for (const auto& l : journey.leaving) left += l.size();
    if (ranks.sum(left) == 0) break;
    std::vector<std::vector<Traveller>> leaving(journey.leaving.size());
    leaving.swap(journey.leaving);
    journey.put_all(hand_over(std::move(leaving)));
  }
  std::vector<Traveller> out = hand_over(std::move(journey.done));
  std::sort(out.begin(), out.end(), [](const Traveller& a, const Traveller& b) { return a.tag < b.tag; });
  return out;
}

Result<double> share_that_crosses(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                  const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                                  uint32_t seed, Progress* progress) {
  LossMeter meter{space, work, surfaces, receivers, progress};
  Result<void> ok = meter.send_all(receivers_of, seed);
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  if (!this_ranks().all(bool(ok)))
    return ok ? Error{surfaces.scene.path, "another rank has no tree of a room"} : ok.error();
  const uint64_t sent = this_ranks().sum(meter.samples.size() * rays_of_each);
  return double(this_ranks().sum(meter.rays.size())) / double(std::max<uint64_t>(sent, 1));
}

Result<FieldLoss> hand_on_what_fields_lose(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                           const Receivers& receivers,
                                           const std::vector<std::vector<uint32_t>>& receivers_of, uint32_t seed,
                                           double most, Progress* progress) {
  LossMeter meter{space, work, surfaces, receivers, progress};
  Result<void> ok = meter.send_all(receivers_of, seed);
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  if (!this_ranks().all(bool(ok)))
    return ok ? Error{surfaces.scene.path, "another rank has no tree of a room"} : ok.error();
  const LossMeter::Nodes nodes = meter.nodes();
  auto ends = follow(space, work, surfaces, std::move(meter.travellers), true, progress);
  if (!ends) return ends.error();
  auto means = meter.means_of(nodes);
  if (!means) return means.error();
  std::vector<double> lost = sum_of_rooms(work, meter.squares(*ends, nodes, *means));
  const double all = lost.back();
  lost.pop_back();
  double left = 0;
  for (double& l : lost) l = all > 0 ? std::max(l, 0.0) / all : 0.0, left += l;
  FieldLoss out{std::sqrt(left)};
  std::vector<uint32_t> order(lost.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return lost[a] > lost[b]; });
  for (const uint32_t o : order) {
    left = 0;
    for (size_t k = 0; k < lost.size(); ++k) left += space.openings[k].handed ? 0.0 : lost[k];
    if (left <= most * most || lost[o] <= 0) break;
    space.openings[o].handed = true, ++out.handed;
  }
  left = 0;
  for (size_t k = 0; k < lost.size(); ++k) left += space.openings[k].handed ? 0.0 : lost[k];
  out.left = std::sqrt(left);
  return out;
}

}  // namespace lambent

#pragma once
// Rays that go on through openings into the rooms beyond, to their ends. In each room a ray is traced by the rank that
// the room belongs to, which also says what it met; the one that sent it knows nothing of other rooms' surfaces.
#include <lambent/bake/room_nodes.h>

#include <array>

namespace lambent {

// What surfaces are to rays: whose values they carry, and what they reflect.
struct RoomSurfaces {
  const Scene& scene;
  const CornerReceivers& basis;

  // Of a triangle of the whole scene.
  Vec3 reflected(uint32_t triangle, const Corners& at, const Hit& hit) const;
};

struct Traveller {
  enum class End : uint16_t { none, surface, back, outside, field, lost };

  uint64_t tag = 0;     // the sender's own; no two of its rays have the same
  Vec3 at, direction;   // of a surface, in the end, what it reflects, and where it was met (u, v, 0)
  uint16_t room = 0;    // that it is in
  uint16_t passed = 0;  // openings
  uint16_t home = 0;    // the rank that sent it
  End end = End::none;
  std::array<uint32_t, 3> receiver{};  // of a surface at its corners; of a field: opening, cell, 0
};

// Rays to their ends, in the order of their tags: through openings that are handed on, or through `all`. All ranks.
// Errors: cancelled; a room without a tree.
Result<std::vector<Traveller>> follow(const RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                      std::vector<Traveller> mine, bool all, Progress* progress);

// Of receivers' rays, the share that leaves their room, by those that are held out. All ranks. Errors: as follow().
Result<double> share_that_crosses(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                  const Receivers& receivers, const std::vector<std::vector<uint32_t>>& receivers_of,
                                  uint32_t seed, Progress* progress);

struct FieldLoss {
  double all = 0, left = 0;  // relative RMS over receivers: of all openings' light fields; of those that stay
  size_t handed = 0;         // openings whose rays are handed on
};

// What light fields lose, measured once their nodes are found: at receivers held out, each opening's rays end at nodes,
// whose means are of the rays that stand for them, or go on to their ends, under a stand-in for the light: each of the
// harmonics of three bands as a sky, of which a surface sends back half of what it would have with nothing about it.
// Noise is left out: halves of a receiver's rays are multiplied. Of openings that lose most, as many are handed on
// (Opening::handed) as leave the others' loss at `most`. All ranks. Errors: cancelled; a room without a tree.
Result<FieldLoss> hand_on_what_fields_lose(RoomSpace& space, const RoomWork& work, const RoomSurfaces& surfaces,
                                           const Receivers& receivers,
                                           const std::vector<std::vector<uint32_t>>& receivers_of, uint32_t seed,
                                           double most, Progress* progress);

}  // namespace lambent

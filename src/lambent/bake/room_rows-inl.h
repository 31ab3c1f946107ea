#pragma once
// The rays of a row (room_rows.cpp, room_handed.cpp).
#include <lambent/bake/room_baker.h>

namespace lambent {

// Calls f(number, origin, direction, hit) for each ray of row i of a room's block, none of rows that only pad it.
template <class F>
void RoomBaker::each_ray(size_t room, const RoomGeometry& geometry, size_t block, size_t i, RowScratch& s, F f) const {
  const size_t rays = rays_in(room, block);
  if (block >= receiver_blocks(room)) {
    const size_t node = (block - receiver_blocks(room)) * gather_block + i;
    if (node >= space.nodes_in[room]) return;
    const std::span<const NodeRay> own = space.rays_of(room, node, s.of_node);
    for (size_t j = 0; j < own.size(); ++j)
      f(j, own[j].origin, own[j].direction, geometry.tracer.closest(own[j].origin, own[j].direction));
    return;
  }
  if (block * gather_block + i >= receivers_of[room].size()) return;
  const uint32_t r = receivers_of[room][block * gather_block + i];
  const Vec3 origin = receivers.origins[r];
  const DirectionChoice c = choose_directions(sets, receivers.normals[r], options.seed, r);
  const size_t base = size_t(c.set) * sets.stride;
  rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                    s.x.data(), s.y.data(), s.z.data());
  geometry.tracer.closest_fan(origin, {s.x.data(), s.y.data(), s.z.data(), rays}, s.hits.data());
  for (size_t j = 0; j < rays; ++j) f(j, origin, Vec3(s.x[j], s.y[j], s.z[j]), s.hits[j]);
}

}  // namespace lambent

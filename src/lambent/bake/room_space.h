#pragma once
// The space of rooms.h: where rays leave a room, and the nodes of the light fields in its openings.
#include <lambent/bake/room_boxes.h>
#include <lambent/trace/tracer.h>

#include <span>
#include <vector>

namespace lambent {

// Rays that stand for a node, of those that were met there.
inline constexpr int most_node_rays = 24;

// Where two rooms touch, seen from one of them.
struct Opening {
  uint32_t room = 0, beyond = 0;
  int axis = 0;
  bool upper = false;  // on the room's face of greater coordinates
  Bounds face;
  int across[2] = {1, 1};      // cells of place along the two other axes, in the order axis + 1, axis + 2
  std::vector<uint32_t> node;  // of each cell [direction][place], `none` where nobody has met it
  bool handed = false;         // it has no light field: rays go on beyond it
};

// Where a ray goes: into a surface, out of the scene, or through an opening.
struct Exit {
  uint32_t opening = none;
  bool outside = false;
  uint32_t cell = 0;  // of the opening
  Vec3 at{0}, direction{0};
};
// With a key that tells it from others, whatever the order in which they are found.
struct Crossing {
  Exit exit;
  uint32_t key = 0;
};
struct NodeRay {
  Vec3 origin, direction;
  uint32_t key = 0;
};

// The triangles that reach into a room.
struct RoomGeometry {
  std::unique_ptr<Scene> scene;
  Tracer tracer;
  std::vector<uint32_t> triangles;  // of the whole scene
};

class RoomSpace {
 public:
  RoomSpace(const Scene& scene, const std::vector<Room>& rooms, int places, int directions);

  std::vector<Room> rooms;
  std::vector<Opening> openings;
  std::vector<std::vector<uint32_t>> nodes_of;  // of each room: nodes of openings that lead into it, numbered

  uint32_t room_at(Vec3 p) const;
  // Whether a surface within these bounds is of the room's geometry.
  bool is_reached(size_t room, const Bounds& reach) const;
  Result<RoomGeometry> geometry(size_t room, const Scene& scene) const;
  // Of a ray from within a room, given what it meets there.
  Exit exit(size_t room, Vec3 origin, Vec3 direction, const Hit& hit) const;
  // No nodes, as before any was found. Rays are kept of nodes of these rooms alone, [room].
  void clear_nodes(std::vector<uint8_t> kept);
  // Notes a ray at its node, of which the keys that are least are kept. New nodes go to the room beyond.
  void take(const Crossing& crossing, std::vector<std::vector<uint32_t>>& fresh);
  std::span<const NodeRay> rays_of(uint32_t node) const {
    return {rays_.data() + size_t(slot_[node]) * most_node_rays, counts_[slot_[node]]};
  }
  // Once all are found: gives each node its number among those of its room, in the order of openings and cells.
  void number_nodes();
  // The number of the ray's node in the room beyond: its own, or the nearest that there is; `none`: there is none near.
  uint32_t find_node(const Exit& exit) const;
  size_t node_count() const { return slot_.size(); }
  size_t bytes() const;

 private:
  uint32_t cell_of(const Opening& o, Vec3 at, Vec3 direction) const;
  Bounds bounds_;
  float tolerance_;
  int directions_;
  std::vector<std::vector<uint32_t>> openings_of_;  // of each room
  std::vector<uint8_t> kept_;                       // of each room: rays of its nodes
  std::vector<uint32_t> slot_;                      // of each node, its place in these; none
  std::vector<NodeRay> rays_;
  std::vector<uint8_t> counts_;
  std::vector<uint32_t> number_;  // of each node, once numbered
};

}  // namespace lambent

#pragma once
// The space of rooms.h: where rays leave a room, and the nodes of the light fields in its openings.
#include <lambent/bake/room_boxes.h>
#include <lambent/bake/room_cells.h>
#include <lambent/trace/tracer.h>

#include <array>
#include <numeric>
#include <span>
#include <vector>

namespace lambent {

// Where two rooms touch, seen from one of them.
struct Opening {
  uint32_t room = 0, beyond = 0;
  int axis = 0;
  bool upper = false;  // on the room's face of greater coordinates
  Bounds face;
  int across[2] = {1, 1};  // cells of place along the two other axes, in the order axis + 1, axis + 2
  bool handed = false;     // it has no light field: rays go on beyond it
  CellSet met;             // cells [direction][place], where this rank's rays may end
  CellRays rays;           // of nodes, where the room beyond is this rank's
  uint32_t first = 0;      // node, in the room beyond
};

// Where a ray goes: into a surface, out of the scene, or through an opening.
struct Exit {
  uint32_t opening = none;
  bool outside = false;
  uint32_t cell = 0;  // of the opening
  Vec3 at{0}, direction{0};
};
struct NodeRay {
  Vec3 origin, direction;
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
  // Of each room: nodes of openings that lead into it, numbered in the order of openings and cells.
  std::vector<size_t> nodes_in;

  uint32_t room_at(Vec3 p) const;
  // Whether a surface within these bounds is of the room's geometry.
  bool is_reached(size_t room, const Bounds& reach) const;
  Result<RoomGeometry> geometry(size_t room, const Scene& scene) const;
  // Of a ray from within a room, given what it meets there.
  Exit exit(size_t room, Vec3 origin, Vec3 direction, const Hit& hit) const;
  size_t cells(const Opening& o) const { return size_t(o.across[0] * o.across[1]) * size_t(directions_ * directions_); }
  Crossing crossing(const Exit& exit, uint64_t key) const;
  NodeRay ray(const Opening& o, uint32_t cell, CellRay ray) const;
  // No nodes, as before any was found.
  void clear_nodes();
  // Once those of this rank's rooms are found: all ranks come to know how many there are, and cells of openings that
  // they ask for.
  void number_nodes(const std::vector<uint8_t>& asked);
  // The rays of a node of one of this rank's rooms, into `out`.
  std::span<const NodeRay> rays_of(size_t room, size_t node, std::array<NodeRay, most_node_rays>& out) const;
  size_t ray_count(size_t room, size_t node) const;
  // The number of the ray's node in the room beyond: its own, or the nearest that there is; `none`: there is none near.
  uint32_t find_node(const Exit& exit) const;
  size_t node_count() const { return std::accumulate(nodes_in.begin(), nodes_in.end(), size_t{0}); }
  size_t bytes() const;

 private:
  struct Where {
    int cell[4];      // two of place, two of direction
    float within[4];  // [0, 1]
  };
  const Opening& opening_of(size_t room, size_t node) const;
  Where where(const Opening& o, Vec3 at, Vec3 direction) const;
  uint32_t cell_of(const Opening& o, Vec3 at, Vec3 direction) const;
  Bounds bounds_;
  float tolerance_;
  int directions_;
  std::vector<std::vector<uint32_t>> openings_of_, leading_to_;  // of each room
  std::vector<std::vector<uint32_t>> triangles_of_;              // of each room
};

}  // namespace lambent

#pragma once
// A scene's space in boxes that tile it, cut where it is closed most: at walls and floors, so that what is open of a
// cut is a door, a window, a stairwell.
#include <lambent/core/result.h>
#include <lambent/scene/scene.h>

#include <string>
#include <vector>

namespace lambent {

// A box of space; two that touch share the coordinate of their face to the bit.
struct Room {
  std::string name;
  Bounds box;
};

// All of the scene, with a little around it.
Bounds room_bounds(const Scene& scene);

// Cuts at axis-parallel planes, the most closed ones first, up to `most` rooms (>= 1): while less than a third of the
// cut is open, or, of a box with over an eighth of all that there is, nine tenths; by a grid of 96 cells along the
// scene's longest side, where both parts hold something.
std::vector<Room> find_rooms(const Scene& scene, size_t most);

// A room a box that is asked for, parted by planes between the boxes: each is grown to all of the space on its side.
// Errors: two boxes that no axis-parallel plane parts, but for an eighth of their extent.
Result<std::vector<Room>> part_rooms(const Bounds& whole, const std::vector<Room>& asked);

}  // namespace lambent

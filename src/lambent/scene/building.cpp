#include <lambent/scene/procedural.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

struct Walls {
  Scene& scene;
  uint32_t material;
  float cell;

  int cells(float length) const { return std::max(1, int(std::ceil(length / cell - 1e-3f))); }
  void quad(const char* name, Vec3 origin, Vec3 a, Vec3 b) {
    add_quad(scene, material, name, origin, a, b, cells(length(a)), cells(length(b)));
  }
  // A block, all of its faces outward.
  void block(Vec3 low, Vec3 high) {
    const Vec3 d = high - low, x(d.x, 0, 0), y(0, d.y, 0), z(0, 0, d.z);
    quad("wall", low, z, y), quad("wall", low + x, y, z);
    quad("wall", low, y, x), quad("wall", low + z, x, y);
    quad("wall", low, x, z), quad("wall", low + y, z, x);
  }
  // Along x at z to z + thickness, with a hole from x0 to x1 and y0 to y1.
  void with_hole(float low, float high, float z, float thickness, float height, float x0, float x1, float y0,
                 float y1) {
    block(Vec3(low, 0, z), Vec3(x0, height, z + thickness));
    block(Vec3(x1, 0, z), Vec3(high, height, z + thickness));
    if (y0 > 0) block(Vec3(x0, 0, z), Vec3(x1, y0, z + thickness));
    block(Vec3(x0, y1, z), Vec3(x1, height, z + thickness));
  }
};

}  // namespace

Scene make_building(int rooms_a_side, float cell) {
  constexpr float side = 4, height = 3, hall = 2, wall = 0.2f;
  Scene scene;
  const uint32_t plaster = add_material(scene, "plaster", Vec3(0.7f, 0.7f, 0.65f)),
                 brick = add_material(scene, "brick", Vec3(0.6f, 0.35f, 0.25f)),
                 wood = add_material(scene, "wood", Vec3(0.5f, 0.4f, 0.3f));
  const float long_side = float(rooms_a_side) * (side + wall) + wall, depth = 2 * (side + 2 * wall) + hall;
  Walls floors{scene, wood, cell}, walls{scene, plaster, cell}, inner{scene, brick, cell};
  floors.quad("floor", Vec3(0, 0, 0), Vec3(0, 0, depth), Vec3(long_side, 0, 0));
  walls.quad("ceiling", Vec3(0, height, 0), Vec3(long_side, 0, 0), Vec3(0, 0, depth));
  const float hall_low = side + 2 * wall, hall_high = hall_low + hall;
  for (int i = 0; i < rooms_a_side; ++i) {
    const float low = float(i) * (side + wall) + wall, high = low + side, middle = 0.5f * (low + high);
    const float begin = i == 0 ? 0 : low - wall, end = i + 1 == rooms_a_side ? high + wall : high;
    // Windows outside, doors to the hall.
    walls.with_hole(begin, end, 0, wall, height, middle - 0.8f, middle + 0.8f, 1, 2.2f);
    walls.with_hole(begin, end, depth - wall, wall, height, middle - 0.8f, middle + 0.8f, 1, 2.2f);
    inner.with_hole(begin, end, hall_low - wall, wall, height, low + 0.4f, low + 1.4f, 0, 2.1f);
    inner.with_hole(begin, end, hall_high, wall, height, low + 0.4f, low + 1.4f, 0, 2.1f);
  }
  // Between rooms, and at the ends.
  for (int i = 0; i <= rooms_a_side; ++i) {
    const float x = float(i) * (side + wall);
    walls.block(Vec3(x, 0, wall), Vec3(x + wall, height, hall_low - wall));
    walls.block(Vec3(x, 0, hall_high + wall), Vec3(x + wall, height, depth - wall));
  }
  walls.block(Vec3(0, 0, hall_low), Vec3(wall, height, hall_high));
  walls.block(Vec3(long_side - wall, 0, hall_low), Vec3(long_side, height, hall_high));
  return scene;
}

}  // namespace lambent

#pragma once
// Objects that shine and move: their light on receivers, from harmonics of what shines at points around them ("source
// radiance fields"), held back by what of other objects is nearer. Source: Zhou, Hu, Lin, Guo, Shum, "Precomputed
// Shadow Fields" (2005), as triple-product-integrals cites it.
#include <lambent/relight/moving.h>

namespace lambent {

// How an object shines, in its own axes, as it is read.
struct ShiningLight {
  Shells shells;
  std::vector<float> log_radii;
  int order = 0;
  std::vector<float> values;  // [point][r, g, b][order^2]
};
// The field is of IncidentRows about an object, for one group of lamps; `order` bands of it at most.
ShiningLight shining_light(const Field& field, int order);

// A lamp where it stands, its field turned to the world. Radiance does not change with the scale.
struct PlacedLamp {
  const ShiningLight* light = nullptr;
  RigidPlace place;
  AlignedVector<float> values;  // [point][r, g, b][order^2], padded to a multiple of 16 a point, world axes
  size_t stride() const { return (3 * size_t(sh_count(light->order)) + 15) / 16 * 16; }
  float radius() const { return light->shells.radius * place.scale; }
};
// `light` must outlive it.
PlacedLamp place_lamp(const ShiningLight& light, const RigidPlace& place);
// The coefficients of the radiance that arrives from the lamp at a point: order^2 of them.
void arriving_from(const PlacedLamp& lamp, Vec3 point, std::span<Vec3> out);

// A lamp over receivers.
struct SeenLamp {
  const PlacedLamp* lamp = nullptr;
  const PlacedObject* itself = nullptr;  // the same object as what hides: not in the way of its own light
  // By receiver: how much of what the lamp sends there is not held back by what is no object, [0, 1]. Empty: all.
  std::span<const float> open = {};
};

// What receivers do with the light: nothing but the cosine, where `open` says what else is in the way, or their own
// transfer, which has their own shadows on themselves, all around, as an object that stands free has.
enum class LampResponse { cosine, transfer };

// Keeps tables from frame to frame; not for two threads at a time.
class LampShader {
 public:
  // Adds the exit radiance of white receivers to `values`. An object is in the way of a receiver where its middle is
  // nearer than the lamp's. Every lamp counts, however far.
  MovingCount add(const MovingReceivers& receivers, std::span<const SeenLamp> lamps,
                  std::span<const PlacedObject* const> objects, LampResponse response, Relit& values);

 private:
  ShTileProducts products_;
};

}  // namespace lambent

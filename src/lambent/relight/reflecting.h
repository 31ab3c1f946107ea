#pragma once
// Objects that reflect and move: what arrives at one, the same all over it, leaves it again as the light of a lamp of
// its shape, from how it reflects towards points around it ("transfer fields"). Source: Zhou, Hu, Lin, Guo, Shum,
// "Precomputed Shadow Fields" (2005), whose source radiance fields they make anew each frame.
#include <lambent/relight/shining.h>

namespace lambent {

// How an object reflects, in its own axes, as it is read.
struct ReflectingLight {
  Shells shells;
  std::vector<float> log_radii;
  int incident_order = 0, order = 0;  // bands of the light that arrives at the object, and of what leaves it
  std::vector<float> values;          // [point][r, g, b][order^2][incident_order^2]
};
// The field is of IncidentRows about an object, for harmonics.
ReflectingLight reflecting_light(const Field& field);

// What the object shines with under the light that arrives at it: coefficients in the world's axes, incident_order^2 of
// them at least. `rotation` is the object's.
ShiningLight reflected_light(const ReflectingLight& light, std::span<const Vec3> arriving, const Mat3& rotation);

// `light` (order^2 coefficients of radiance that arrives at a point) less what objects are in the way of; of those that
// are nearer than `distance` alone. What hides less than 1/4,000 of the sphere is passed over.
void pass_objects(std::span<Vec3> light, Vec3 point, std::span<const PlacedObject* const> objects,
                  float distance = INFINITY);

}  // namespace lambent

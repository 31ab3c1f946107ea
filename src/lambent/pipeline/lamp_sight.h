#pragma once
// How much of a lamp that moves is in sight of each receiver, past a scene that stays: the only rays that a frame of
// objects that move needs beside the picture's, since the scene has no field of its own around it.
#include <lambent/relight/shining.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// A point of what shines, in the object's own axes.
struct ShiningPoint {
  Vec3 position, normal;
  float power = 0;  // its share of the object's
  bool both = false;
};
// `count` points over the emissive triangles, evenly by area times emission. Empty where nothing emits.
std::vector<ShiningPoint> shining_points(const Scene& object, int count);

// The same over all surfaces, evenly by area times base colour.
std::vector<ShiningPoint> surface_points(const Scene& object, int count);

// By receiver: of the light of those points (form factors), the share that the scene does not hold back; 0 where none
// of it comes from above the horizon. `place` as for its field, about `center`; origins are lifted along the normals
// off the surface of a scene of that diagonal. Receivers are an object's or the scene's own; those farther than `reach`
// from the object's middle are not looked from, and have 0.
std::vector<float> lamp_in_sight(const Tracer& scene, float diagonal, const MovingReceivers& receivers,
                                 std::span<const ShiningPoint> points, Vec3 center, const RigidPlace& place,
                                 float reach = INFINITY);

}  // namespace lambent

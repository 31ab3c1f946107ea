#pragma once
// Light that varies over what it lights: distant light and lamps that are near. Each place has coefficients of its own,
// those of the light that would arrive there if nothing were in the way; transfer adds shadows as if that light were
// distant, so occluders should be nearer than the lamp. Source: local-deformable-prt, section 5 (local lighting).
#include <lambent/core/aligned.h>
#include <lambent/core/vec.h>

#include <functional>
#include <span>
#include <vector>

namespace lambent {

// A sphere that glows evenly.
struct SphereLamp {
  Vec3 centre{0.0f};
  float radius = 1;  // above 0
  Vec3 radiance{1.0f};
};

// Distant light, and lamps that are near.
struct LocalLight {
  std::vector<Vec3> distant;  // coefficients of radiance, order^2 of them
  std::vector<SphereLamp> lamps;
  std::vector<float>
      window;  // factors a band of the lamps' light, which `distant` has already; beyond them 0; empty: 1 for all
};

// The coefficients at a place, as many as `distant` has: a lamp is a cap of directions there, with zonal coefficients
// in closed form; within it, all directions.
void light_at(const LocalLight& light, Vec3 place, std::span<Vec3> out);

// Of every receiver, in blocks as transfer has them: [block][coefficient][r, g, b][receiver in block].
struct LightField {
  size_t receivers = 0;
  int order = 0;
  AlignedVector<float> values;
};
LightField make_light_field(const LocalLight& light, std::span<const Vec3> places);

}  // namespace lambent

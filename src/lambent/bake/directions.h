#pragma once
// Directions and their basis values, made once and shared by all receivers: a few sets, cosine-distributed about +z
// unless another warp is given. A receiver takes one set, turned into its frame by a rotation of its own; sums over its
// visible directions are formed in the set's frame and turned back as spherical harmonics.
#include <lambent/basis/sh.h>
#include <lambent/core/progress.h>
#include <lambent/core/sampling.h>
#include <lambent/trace/tracer.h>

#include <vector>

namespace lambent {

struct DirectionSets {
  int order = 0, samples = 0, sets = 0;
  size_t stride = 0;  // samples padded to whole vectors
  size_t half =
      0;  // directions [0, half) and [half, samples) are two sets in their own right; half = samples: no split
  std::vector<float> x, y, z;  // [set][stride]
  std::vector<float> weights;  // [sample], of mean 1, alike in all sets; empty: all are 1
  std::vector<float> table;    // [set][coefficient][stride]: harmonics at each direction, 0 in the padding
  // [set][all, first half][coefficient]: what the mean of the harmonics over cosine-distributed directions has too
  // much. A receiver that sees a share s of its sky has about s of it in its row: a control variate. Empty where
  // directions follow another distribution.
  std::vector<float> excess;
};

// From the unit square to directions (core/sampling.h).
using DirectionWarp = Vec3 (*)(Vec2);

// The first `count` Sobol' points under one Owen scrambling; [0, half) and [half, count) each sorted along a
// space-filling curve.
std::vector<Vec2> sorted_points(size_t count, size_t half, uint32_t key);

// Sobol' points, Owen-scrambled anew for every set, sorted within each half along a space-filling curve. Left
// unfinished when cancelled.
DirectionSets make_direction_sets(int order, int samples, int sets, uint32_t seed,
                                  DirectionWarp warp = square_to_cosine_hemisphere, Progress* progress = nullptr);

// One set of the pixels of a hemicube, as many as are nearest to `samples`: 3 n^2 for a top face of n x n, n even; rays
// go through their centres, and each weighs its delta form factor, cos / pi integrated over the whole pixel in closed
// form, which sum to 1. Source: M. Cohen and D. Greenberg, "The hemi-cube: a radiosity solution for complex
// environments", 1985.
DirectionSets make_hemicube_set(int order, int samples);

// 64 cosine-distributed directions about a normal, the same for every seed: for yes and no.
struct FixedFan {
  static constexpr size_t count = 64;
  float x[count], y[count], z[count];
  explicit FixedFan(Vec3 normal);
  Vec3 operator[](size_t k) const { return {x[k], y[k], z[k]}; }
};

// A receiver's draw: which set, and the rotation Rz(a) Ry(b) Rz(c) that takes +z to its normal with a random spin c.
struct DirectionChoice {
  int set;
  float a, b, c;
  Mat3 rotation;
};
DirectionChoice choose_directions(const DirectionSets& sets, Vec3 normal, uint32_t seed, size_t receiver);

}  // namespace lambent

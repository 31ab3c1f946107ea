#pragma once
// Direct light at surfels -> indirect light, all bounces (transfer/indirect.h). Exit radiance of white surfaces
// throughout: what arrives, over pi.
#include <lambent/relight/relight.h>
#include <lambent/transfer/indirect.h>

#include <span>

namespace lambent {

// What stays while lamps move: allocated once.
struct IndirectSolve {
  std::vector<Vec3> albedos;       // of leaves
  std::vector<uint32_t> ancestor;  // gathering surfel of each leaf
  std::vector<float> node_areas;
  std::vector<Vec3> nodes;            // what each node sends out
  std::vector<Vec3> direct, x, next;  // of leaves; of gathering surfels
  int bounces = 0;                    // of the last solve
  double residual = 0;                // what further bounces would add, relative to the light there is
};

// `albedos` empty: as baked; else one a leaf.
IndirectSolve make_indirect_solve(const IndirectTransfer& t, std::span<const Vec3> albedos = {});

// x += G P R (of what leaves send out): one bounce of `leaves` (light at leaves, one a surfel), into y, one a gathering
// surfel.
void gather_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> leaves, std::span<Vec3> y);

// Indirect light at gathering surfels, into s.x: bounces until those to come would add less than `tolerance` of
// all light, `most` at most. Works on all cores; sums in a fixed order.
void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance = 1e-3,
                    int most = 64);

// Reconstruction at every receiver by its kernels.
void read_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out);

}  // namespace lambent

#pragma once
// Direct light at surfels -> indirect light, all bounces (transfer/indirect.h). Exit radiance of white surfaces
// throughout: what arrives, over pi.
#include <lambent/core/aligned.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/indirect.h>

#include <span>

namespace lambent {

// What stays while lamps move: allocated once.
struct IndirectSolve {
  std::vector<uint32_t> ancestor;  // gathering surfel of each leaf
  // Of nodes: albedo, the mean of their leaves; share in the mean of the node above.
  std::vector<Vec3> albedos;
  std::vector<float> shares;
  AlignedVector<float> sent;    // what each node sends out, [node][4], the fourth 0
  std::vector<Vec3> first;      // light of the first bounce, G P R d
  std::vector<Vec3> x, before;  // of gathering surfels: the newest iterates
  Vec3 radius;                  // spectral radius of G P R U, by channel, about
  int bounces = 0;              // applications of G in the last solve
  double residual = 0;          // |G P R (d + U x) - x| / |G P R d| of the iterate before the last, sums of magnitudes
};

// `albedos` empty: as baked; else one a leaf.
IndirectSolve make_indirect_solve(const IndirectTransfer& t, std::span<const Vec3> albedos = {});

// One bounce of `leaves` (light at leaves, one a surfel), G P R of it, into y, one a gathering surfel.
void gather_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> leaves, std::span<Vec3> y);

// Indirect light at gathering surfels, into s.x: iterates until `residual` is at most `tolerance`, by `most` bounces at
// most. Linear in `direct` for a number of bounces. Works on all cores; sums in a fixed order. Source of the iteration:
// G. Golub and R. Varga, "Chebyshev semi-iterative methods, successive overrelaxation iterative methods, and second
// order Richardson iterative methods", 1961.
void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance = 1e-3,
                    int most = 64);

// Reconstruction at every receiver by its kernels.
void read_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out);

}  // namespace lambent

#pragma once
// Direct light at surfels -> indirect light, all bounces (transfer/indirect.h). Exit radiance of white surfaces
// throughout: what arrives, over pi.
#include <lambent/core/aligned.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/directional.h>
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
// most; of light that was solved before it goes on from there, where `goes_on` says so, in fewer bounces. Linear in
// `direct` for a number of bounces from the start. Works on all cores; sums in a fixed order. Source of the iteration:
// G. Golub and R. Varga, "Chebyshev semi-iterative methods, successive overrelaxation iterative methods, and second
// order Richardson iterative methods", 1961.
void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance = 1e-3,
                    int most = 64, bool goes_on = false);

// One bounce more, of the light that s.x has now and of `direct`: x becomes G P R (d + U x). Over several frames light
// that has changed settles so, at a bounce a frame.
void step_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct);

// Reconstruction at every receiver by its kernels.
void read_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out);

// What follows reads what nodes send out, which the solution leaves as of its last bounce: sets s.sent of direct light
// and s.x, as solved.
void send_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct);

// Rows of directional light at every receiver, by the directions of nodes from gathering surfels: of sh:2, sh:3 and
// vector, whose axes are the world's. Where the normal that it is evaluated for is the receiver's own, the vector gives
// what read_indirect() does. After send_indirect().
void read_directional_indirect(const IndirectTransfer& t, const IndirectSolve& s, DirectionalKind kind, Relit& out);

// Harmonics of the radiance that arrives at the points of t.lattice, which has to be there: order^2 rows. After
// send_indirect().
void read_lattice_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out);

}  // namespace lambent

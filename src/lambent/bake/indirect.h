#pragma once
// Bakes direct-to-indirect transport (transfer/indirect.h): gathering surfels send their rays once, and what they meet
// is looked up in the tree of surfels, near things finely and far ones coarsely.
#include <lambent/bake/surfels.h>
#include <lambent/receivers/receivers.h>
#include <lambent/transfer/directional.h>

namespace lambent {

struct IndirectOptions {
  size_t surfels = 0;       // leaves, about (SurfelOptions)
  int samples = 1024;       // rays a gathering surfel
  bool all_gather = false;  // rows are of all leaves, and not of the level above, a quarter of them
  float angle = 0.2f;       // a node's spacing over its distance, at most
  float dropped = 0.01f;    // of a row's sum: its smallest entries are left out, and the others make up for them
  uint32_t seed = 1;
  // Light in free space, at a lattice's points, of so many bands (transfer/lattice.h).
  std::optional<Lattice> lattice = std::nullopt;
  int lattice_order = 4;
  // What receivers have: sh:2, sh:3 and vector add rows, and nothing that is kept.
  DirectionalKind directional = DirectionalKind::none;
};

struct IndirectReport {
  size_t rays = 0;
  size_t strays = 0;   // hits for which no surfel stood; they count as black
  size_t buried = 0;   // receivers that see no surfel near them, and read what neighbours read
  size_t unread = 0;   // those without such a neighbour, black
  size_t invalid = 0;  // points of the lattice that lie inside something
  double surfel_seconds = 0, trace_seconds = 0, reader_seconds = 0;
};

// Receivers read gathering surfels by kernels. Coloured glass is taken for grey. Errors: those of make_surfels(); every
// point of the lattice inside something; cancelled.
Result<IndirectTransfer> bake_indirect(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                       const IndirectOptions& options, IndirectReport* report = nullptr,
                                       Progress* progress = nullptr);

// What such a bake would take, from its surfels and a little of the rest: bytes in a file, and seconds. Errors: the
// same.
struct IndirectExpected {
  IndirectTransfer::Bytes bytes;
  double seconds = 0;
};
Result<IndirectExpected> expect_indirect(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                         const IndirectOptions& options, Progress* progress = nullptr);

}  // namespace lambent

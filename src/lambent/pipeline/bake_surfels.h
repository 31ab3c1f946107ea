#pragma once
// Direct-to-indirect transport of a request, with its lattice, and what it says of itself.
#include <lambent/bake/bake.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/bake_parse.h>

namespace lambent {

// The plan's, with the lattice that the request asks for. Errors: those of --lattice and --lattice-box.
Result<IndirectOptions> indirect_options(const BakeRequest& request, const BakePlan& plan, const Scene& scene);

// Errors: those of bake_indirect(), of --lattice and --lattice-box.
Result<IndirectTransfer> bake_indirect_of_request(const BakeRequest& request, const BakePlan& plan, const Scene& scene,
                                                  const Tracer& tracer, const Receivers& receivers, const Job& job,
                                                  BakeReport& report, Summary& summary);

}  // namespace lambent

#pragma once
// Bakes over a cube of directions: visibility in blocks, and diffuse transfer in wavelets, which is made of it.
#include <lambent/bake/bake.h>
#include <lambent/pipeline/bake_parse.h>

namespace lambent {

// What the receivers see; what it says of itself goes to the report and the summary. Warns of glass that it cannot
// hold. Errors: those of bake_visibility().
Result<Visibility> bake_visibility_of_plan(const BakePlan& plan, const Scene& scene, const Tracer& tracer,
                                           const Receivers& receivers, const Job& job, BakeReport& report,
                                           Summary& summary);

// That times the cosine, in wavelets; with bounces the Neumann series of those rows, X = T0 + B X, some columns at a
// time. Errors: cancelled; memory.
Result<HaarTransfer> fit_haar_of_plan(const BakePlan& plan, const Visibility& seen, const Scene& scene,
                                      const Tracer& tracer, const Receivers& receivers, const Job& job,
                                      BakeReport& report, Summary& summary, nlohmann::json& told);

}  // namespace lambent

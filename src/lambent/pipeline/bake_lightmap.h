#pragma once
#include <lambent/pipeline/bake_parse.h>

#include <map>

namespace lambent {

// bake() of a lightmap: `request` and `plan` are resolved.
Result<BakeOutcome> bake_lightmap_request(const BakeRequest& request, const BakePlan& plan, const Job& job);

extern const std::map<std::string, Solver> solver_names;
// {converged, steps: [{applications, residual}]}
nlohmann::json convergence(const SolveReport& report);

}  // namespace lambent

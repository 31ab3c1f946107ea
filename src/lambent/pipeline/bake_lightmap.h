#pragma once
#include <lambent/pipeline/bake_parse.h>

#include <map>

namespace lambent {

// bake() of a lightmap: `request` and `plan` are resolved.
Result<BakeOutcome> bake_lightmap_request(const BakeRequest& request, const BakePlan& plan, const Job& job);

// The sky of a lightmap, as --sky and --lamp say; none: none.
Result<std::optional<Environment>> sky_of_request(const BakeRequest& request, const Job& job);

// The request with the density of its texels, where neither it nor the atlas says one: as light asks for (`remark`).
Result<BakeRequest> with_density(const BakeRequest& request, const BakePlan& plan, const Scene& scene,
                                 const Lamps& lamps, std::string& remark, const Job& job);

extern const std::map<std::string, Solver> solver_names;
// {converged, steps: [{applications, residual}]}
nlohmann::json convergence(const SolveReport& report);

}  // namespace lambent

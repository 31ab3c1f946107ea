#pragma once
#include <lambent/pipeline/bake_parse.h>

namespace lambent {

// bake() of a lightmap: `request` and `plan` are resolved.
Result<BakeOutcome> bake_lightmap_request(const BakeRequest& request, const BakePlan& plan, const Job& job);

}  // namespace lambent

#pragma once
#include <lambent/pipeline/bake.h>
#include <lambent/receivers/atlas.h>
#include <lambent/trace/tracer.h>

namespace lambent {

struct PlacedReceivers {
  Receivers receivers;
  std::optional<Atlas> atlas;  // of texels
};
// As a resolved request says. May split the scene's vertices, so before anything is built from it.
Result<PlacedReceivers> place_receivers(Scene& scene, const BakeRequest& request, const Job& job);

// One line where no receiver has a way out to the environment: what is around all of them.
void warn_if_enclosed(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Job& job);

// JSON text: what made the file, its inputs and their hashes, the request, and what the bake reported.
std::string provenance_of(const BakeRequest& request, const Scene& scene, nlohmann::json report);

}  // namespace lambent

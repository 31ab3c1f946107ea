#pragma once
// The table of a bake request's fields, and its JSON.
#include <lambent/pipeline/options.h>
#include <lambent/pipeline/request.h>

namespace lambent {

enum class BakeKind { diffuse, matrix, factors, zonal, glossy_zonal, membrane, lightmap, blocks, indirect, wavelets };
inline constexpr const char* bake_kind_names[] = {"diffuse transfer",
                                                  "matrix transfer",
                                                  "factors",
                                                  "zonal transfer",
                                                  "glossy lobes (zonal with --brdf or --outgoing)",
                                                  "membranes (--membrane)",
                                                  "lightmaps",
                                                  "blocks",
                                                  "direct to indirect light",
                                                  "wavelets (--light haar)"};
std::span<const Option<BakeRequest>> bake_options();
BakeKind kind_of(const BakeRequest& request);

// Fills in what depends on the kind, and refuses by name what has no effect, what contradicts another option and what
// is out of range. Errors begin with the option.
Result<BakeRequest> resolved(BakeRequest request);

// The fields that have an effect, of files the name alone; and back. Errors name the field.
nlohmann::json to_json(const BakeRequest& request);
Result<BakeRequest> bake_request_from_json(const nlohmann::json& object);
Result<BakeRequest> load_bake_request(const std::string& path);

// The request that a baked file was made by, its inputs looked for beside it and where we are; `scene`, if not empty,
// is the scene instead. Errors: no such request in the file, a scene that is not there or is another.
Result<BakeRequest> request_of_baked_file(const std::string& path, const std::string& scene);

}  // namespace lambent

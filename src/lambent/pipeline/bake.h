#pragma once
// bake() of a request (request.h) with all that a command says of it and writes beside it.
#include <lambent/baked/baked_file.h>
#include <lambent/core/progress.h>
#include <lambent/image/image.h>
#include <lambent/pipeline/bake_request.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace lambent {

// What a command says of its work: for people, a label and a text a line; for programs, JSON.
struct Summary {
  std::vector<std::pair<std::string, std::string>> lines;
  nlohmann::json json = nlohmann::json::object();
};

struct BakeOutcome {
  Baked baked;                     // with its provenance
  std::optional<ViewerLook> look;  // of lightmaps over texels
  std::vector<std::pair<std::string, Image>>
      pictures;  // of lightmaps: what is to be added to the output's stem, ".exr"
  Summary summary;
};

// Errors: those of resolved(), of files, of the stages; cancelled.
Result<BakeOutcome> bake_with_summary(const BakeRequest& request, const Job& job = {});

// Writes the baked file and, beside it, its pictures, whose names are given back as JSON. Errors: the disk's.
Result<nlohmann::json> save_outcome(const std::string& path, const BakeOutcome& outcome,
                                    size_t bin_limit = default_bin_limit);

// Bakes and writes the request's output and its pictures; their names are in the summary.
Result<Summary> bake_to_file(const BakeRequest& request, const Job& job = {});

// What the bake would take, from a little of it: {request, receivers, bytes, seconds}. Seconds are of tracing and
// bounces, measured on a sample of receivers on all cores; about right for diffuse transfer and lightmaps, a lower
// bound for others.
Result<Summary> plan_bake(const BakeRequest& request, const Job& job = {});

}  // namespace lambent

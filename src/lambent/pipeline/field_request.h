#pragma once
// What `lambent field` is asked for, and the whole way from it to a file: an object's own bake, with what it hides
// around it.
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/options.h>

namespace lambent {

struct FieldRequest {
  std::string object, output;
  int order = 4, shells = 24, side = 16, samples = 1024;
  float inner = 0.3f, outer = 12;
  bool radiance = false, transfer = false;
  std::string bounces = "1";
  uint32_t seed = 1;
  GivenOptions given;
};
inline constexpr const char* field_kind_names[] = {"objects", "baked objects"};
std::span<const Option<FieldRequest>> field_options();

// Writes request.output. An object that is a baked file keeps its bake. Errors: an option that has no effect or is out
// of range; of files; a bake that is no diffuse one at vertices by harmonics; those of the stages; cancelled.
Result<Summary> field_to_file(const FieldRequest& request, const Job& job = {});

}  // namespace lambent

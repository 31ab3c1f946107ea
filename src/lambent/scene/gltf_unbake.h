#pragma once
#include <nlohmann/json.hpp>

namespace lambent {

// Takes out of a document what a bake put into it (docs/file-format.md): the extension LAMBENT_transfer, and of what
// viewers without it are to show the primitives, materials, texture coordinates, texture, image and sampler. Accessors
// and buffer views stay behind, unused. Documents without the extension stay as they are. The document's lists must be
// arrays of objects; all else may be anything. Whether there was the extension.
bool unbake(nlohmann::json& document);

}  // namespace lambent

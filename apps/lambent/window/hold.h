#pragma once
// Lamps as a hand takes hold of them.
#include <lambent/pipeline/moving_lamps.h>

#include <optional>
#include <string>

namespace lambent::tool {

// Where a lamp of --lamp stands, in the scene's space; none: a sun.
std::optional<Vec3> lamp_place(const std::string& text, Vec3d origin);
// A lamp of a kind over the middle of a scene, as text.
std::string lamp_over(const Scene& scene, const std::string& kind);

}  // namespace lambent::tool

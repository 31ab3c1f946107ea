#pragma once
// Islands of a layout in an atlas that somebody else made.
#include <lambent/scene/scene.h>

namespace lambent {

// Numbers of triangles' islands: triangles that share an edge in space, and, but for `rounding` texels, in the layout
// `at`, are of one. `none` for triangles without an area.
std::vector<uint32_t> islands_of(const Scene& scene, const std::vector<Vec2>& at, float rounding);

// Texels, of width x height, whose tents reach two islands, or a front and a back: a look-up at one would read light of
// the other. `back` is empty, or has the places of two-sided triangles' backs.
size_t count_shared_texels(const Scene& scene, const std::vector<uint32_t>& islands, const std::vector<Vec2>& front,
                           const std::vector<Vec2>& back, int width, int height);

}  // namespace lambent

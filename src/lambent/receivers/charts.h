#pragma once
// Cutting a surface into charts that can be laid flat with little distortion.
#include <lambent/scene/scene.h>

#include <array>
#include <vector>

namespace lambent {

// A chart's triangles turn at most so far from its plane; projecting them stretches lengths by at most 1 / 0.8.
inline constexpr float chart_cosine = 0.8f;

struct Charts {
  std::vector<uint32_t> of_triangle;  // `none` for triangles without an area
  uint32_t count = 0;
};

// Connected pieces over shared edges (of exactly two triangles, alike in winding and sidedness), each within
// chart_cosine of the normal of its largest triangle, grown from the largest triangles first. Triangles of different
// `layers` are kept apart (empty: all of one).
Charts make_charts(const Scene& scene, const std::vector<uint8_t>& layers = {});

// Charts laid flat: orthogonal projection along the seed's normal, turned so that the bounding box is small, wider than
// high, and begins at 0.
struct FlatCharts {
  std::vector<std::array<Vec2, 3>> corners;  // of each triangle, world units; zero for those without a chart
  std::vector<Vec2> size;                    // of each chart
};
FlatCharts flatten(const Scene& scene, const Charts& charts);

}  // namespace lambent

#pragma once
// Points on spheres about an object, where it is known what the object does to light: how much of the sphere it hides
// ("shadow fields"), and what it shines with. Source: triple-product-integrals, on Zhou, Hu, Lin, Guo, Shum,
// "Precomputed Shadow Fields for Dynamic Scenes" (2005).
#include <lambent/core/vec.h>

#include <array>
#include <cstddef>
#include <vector>

namespace lambent {

// At most.
inline constexpr int max_shells = 64;
// At most.
inline constexpr int max_shell_side = 64;

// A shell has side x side points: the corners of a grid over the square [-1, 1]^2, which is folded to the sphere along
// the diagonals of its quarters (octahedral map). Points on its border appear twice, so that no cell wraps around.
struct Shells {
  Vec3 center{0.0f};         // of the object's box
  float radius = 1;          // of the least sphere about it that holds the object
  std::vector<float> radii;  // of the shells, above 0 and rising
  int side = 16;             // at least 2
  size_t count() const { return radii.size() * size_t(side) * size_t(side); }
};

// Unit direction of a place in the square, and the other way round (any direction but zero).
Vec3 unfold_octahedron(Vec2 place);
Vec2 fold_octahedron(Vec3 direction);

// Direction and place of a point: shell by shell, row by row.
Vec3 shell_direction(const Shells& shells, size_t point);
Vec3 shell_point(const Shells& shells, size_t point);

// Whether all of it is finite and within the limits.
bool is_consistent(const Shells& shells);

// What of the points is to be summed at a place: bilinear in the square, linear in the logarithm of the distance.
// Within the first shell and beyond the last one their values hold; `fade` is what is left of them beyond the last.
struct ShellMix {
  std::array<uint32_t, 8> points;
  std::array<float, 8> weights;
  float fade = 1;
};
// log_radii: the logarithms of the radii, to base 2.
ShellMix mix_shells(const Shells& shells, const std::vector<float>& log_radii, Vec3 from_center);

}  // namespace lambent

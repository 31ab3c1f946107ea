#pragma once
// Directional lightmaps: what arrives at a receiver as a function of the normal that a normal map gives it there, in
// few rows. Sources: radiosity, "Discussion 3" and the slides on Half-Life 2; G. McTaggart, "Half-Life 2 / Valve Source
// Shading", 2004.
#include <lambent/core/vec.h>

#include <optional>
#include <span>
#include <string>

namespace lambent {

// Every value is of exit radiance of a white surface, irradiance / pi, of light from above the receiver's own plane.
enum class DirectionalKind {
  none,  // 1 row: for the receiver's own normal
  sh2,  // 4 rows: harmonics of order 2 of irradiance / pi as a function of the normal; E(n) = sum e_lm y_lm(n), may dip
        // below 0
  sh3,  // 9 rows: of order 3
  hl2,  // 3 rows, never negative: irradiance / pi of the three directions of Half-Life 2's basis about the receiver's
        // normal
  vector,  // 3 rows: the vector V with E(n) = max(0, n . V), exact for normals that see all the light; may have
           // negative parts
};
int directional_rows(DirectionalKind kind);

// "none", "sh:2", "sh:3", "hl2", "vector".
std::string directional_name(DirectionalKind kind);
std::optional<DirectionalKind> directional_kind(const std::string& name);

// Half-Life 2's directions in a frame (t, b, n).
inline const Vec3 hl2_basis[3] = {
    {-0.40824829f, -0.70710678f, 0.57735027f}, {-0.40824829f, 0.70710678f, 0.57735027f}, {0.81649658f, 0, 0.57735027f}};

// E(n) / E's unit from the rows of one receiver; `frame` has columns (t, b, n) of the receiver, as the rows were made
// with. Half-Life 2 weighs by squares of the cosines, made to sum to 1.
Vec3 evaluate_directional_light(DirectionalKind kind, std::span<const Vec3> rows, const Mat3& frame, Vec3 n);

// What one unit of E, exit radiance of a white receiver, from the unit direction d adds to each row: the row's kernel
// over that of E, cos / pi. Grazing light, which counts for little in E, would weigh without bound: the cosine is taken
// for `grazing` at least.
void directional_weights(DirectionalKind kind, Vec3 d, const Mat3& frame, float grazing, std::span<float> out);

// The receiver's frame: frame_about its normal, so that no tangents need to be stored.
inline Mat3 receiver_frame(Vec3 normal) { return frame_about(normal); }

}  // namespace lambent

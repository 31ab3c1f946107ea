#pragma once
// Vectors are GLM's. Positions are metres in glTF axes (right-handed, +Y up); colours are linear Rec. 709.
#include <glm/glm.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace lambent {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Vec4 = glm::vec4;
using Mat3 = glm::mat3;  // column-major: m[column][row], as in GLM
using Mat4 = glm::mat4;

inline constexpr float pi = std::numbers::pi_v<float>;

// Rec. 709 luminance of a linear colour.
inline float luminance(Vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

inline float largest(Vec3 v) { return std::max({v.x, v.y, v.z}); }
inline bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// Unit vector along v, or `fallback` where v is too short to have a direction.
inline Vec3 normalize_or(Vec3 v, Vec3 fallback) {
  float len2 = glm::dot(v, v);
  return len2 > 1e-30f && std::isfinite(len2) ? v / std::sqrt(len2) : fallback;
}

// Columns (t, b, n): a right-handed orthonormal frame about the unit vector n.
// Source: Duff et al. 2017, "Building an orthonormal basis, revisited".
inline Mat3 frame_about(Vec3 n) {
  float sign = std::copysign(1.0f, n.z);
  float a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  return {Vec3(1 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3(b, sign + n.y * n.y * a, -n.y), n};
}

// Rotation by yaw about +Y, then pitch about +X, then roll about +Z, degrees, applied in the order roll, pitch, yaw:
// R = Ry(yaw) Rx(pitch) Rz(roll). It acts on functions as (Rf)(s) = f(R^-1 s).
inline Mat3 rotation_from_yaw_pitch_roll(Vec3 degrees) {
  Vec3 r = glm::radians(degrees);
  float cy = std::cos(r.x), sy = std::sin(r.x), cp = std::cos(r.y), sp = std::sin(r.y), cr = std::cos(r.z),
        sr = std::sin(r.z);
  Mat3 yaw(Vec3(cy, 0, -sy), Vec3(0, 1, 0), Vec3(sy, 0, cy));
  Mat3 pitch(Vec3(1, 0, 0), Vec3(0, cp, sp), Vec3(0, -sp, cp));
  Mat3 roll(Vec3(cr, sr, 0), Vec3(-sr, cr, 0), Vec3(0, 0, 1));
  return yaw * pitch * roll;
}

struct Bounds {
  Vec3 min{INFINITY}, max{-INFINITY};
  void extend(Vec3 p) { min = glm::min(min, p), max = glm::max(max, p); }
  bool empty() const { return !(min.x <= max.x); }
  Vec3 centre() const { return 0.5f * (min + max); }
  float diagonal() const { return empty() ? 0.0f : glm::length(max - min); }
};

}  // namespace lambent

#pragma once
#include <lambent/core/vec.h>

#include <span>

namespace lambent {

// A pinhole camera in the scene's axes. `fov` is vertical, degrees.
struct Camera {
  Vec3 eye{0, 0, 3}, target{0}, up{0, 1, 0};
  float fov = 40.0f;
};

// Maps image positions to directions. (x, y) in pixels from the top left corner, fractional; the result is a unit
// vector.
struct CameraRays {
  Vec3 eye, corner, dx, dy;
  CameraRays(const Camera& camera, int width, int height) : eye(camera.eye) {
    Vec3 forward = normalize_or(camera.target - camera.eye, {0, 0, -1});
    Vec3 side = cross(forward, camera.up);
    if (dot(side, side) < 1e-10f) side = cross(forward, Vec3(0, 0, -1));  // looking straight up or down
    side = normalize_or(side, {1, 0, 0});
    Vec3 up = cross(side, forward);
    float half_height = std::tan(radians(camera.fov) / 2), pixel = 2 * half_height / float(height);
    dx = side * pixel, dy = up * -pixel;
    corner = forward - dx * (float(width) / 2) - dy * (float(height) / 2);
  }
  Vec3 direction(float x, float y) const { return normalize(corner + dx * x + dy * y); }
};

// Looks at all of the points from the front right and a little above, so that they just fit a picture of this width
// over height, but for a margin of a fiftieth of it a side; what the picture is tighter for touches both margins.
inline Camera camera_around(std::span<const Vec3> points, float aspect, float fov = 35.0f) {
  constexpr double margin = 0.02;
  const Vec3d forward = normalize(Vec3d(-0.55, -0.4, -1.0)), side = normalize(cross(forward, Vec3d(0, 1, 0))),
              up = cross(side, forward);
  const double tan_y = std::tan(double(radians(fov)) / 2) * (1 - 2 * margin), tan_x = tan_y * double(aspect);
  // The eye must lie behind the four planes of the frustum moved to touch the points: in the axes (side, up, forward),
  // x_eye - tan_x z_eye >= right, and so on; the depths of the points say where to look.
  double right = -INFINITY, left = -INFINITY, top = -INFINITY, bottom = -INFINITY, near = INFINITY, far = -INFINITY;
  for (Vec3 point : points) {
    const Vec3d p(point);
    const double x = dot(p, side), y = dot(p, up), z = dot(p, forward);
    right = std::max(right, x - tan_x * z), left = std::max(left, -x - tan_x * z);
    top = std::max(top, y - tan_y * z), bottom = std::max(bottom, -y - tan_y * z);
    near = std::min(near, z), far = std::max(far, z);
  }
  if (!(near <= far)) near = far = right = left = top = bottom = 0;
  const double z = std::min(-(right + left) / (2 * tan_x), -(top + bottom) / (2 * tan_y));
  const Vec3d eye = side * ((right - left) / 2) + up * ((top - bottom) / 2) + forward * z;
  const double depth = (near + far) / 2 - z;
  Camera camera;
  camera.fov = fov, camera.target = Vec3(eye + forward * depth);
  camera.eye = Vec3(depth > 0 ? eye : eye - forward);  // a point alone is as large from everywhere
  return camera;
}

// The same of a box's corners.
inline Camera camera_around(const Bounds& box, float aspect = 1.0f, float fov = 35.0f) {
  Vec3 corners[8];
  for (int i = 0; i < 8; ++i)
    corners[i] = {i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z};
  return camera_around(std::span<const Vec3>(corners, box.empty() ? 0 : 8), aspect, fov);
}

}  // namespace lambent

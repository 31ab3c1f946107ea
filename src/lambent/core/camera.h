#pragma once
#include <lambent/core/vec.h>

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

// Looks at the whole of the box from the front right and a little above.
inline Camera camera_around(const Bounds& box, float fov = 35.0f) {
  Camera camera;
  camera.fov = fov, camera.target = box.centre();
  float radius = std::max(0.5f * box.diagonal(), 1e-6f);
  camera.eye = camera.target + normalize(Vec3(0.55f, 0.4f, 1.0f)) * (radius / std::sin(radians(fov) / 2) * 0.95f);
  return camera;
}

}  // namespace lambent

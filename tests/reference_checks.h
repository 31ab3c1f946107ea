#pragma once
// What tests of the path tracer share: cameras, lights, and the comparison of two noisy pictures.
#include <lambent/reference/path_tracer.h>

#include <gtest/gtest.h>

namespace lambent::test {

// An estimate may lie this many of its own standard deviations from the truth: by chance once in 5e8 for one number, so
// about once in 1e5 for a whole small picture; and the seeds are fixed.
inline constexpr float sigmas = 6.0f;

inline Environment uniform_environment(float L) {
  return make_environment("uniform", 8, 4, [=](Vec3) { return Vec3(L); });
}

// Bright on one side, no symmetry, never zero.
inline Environment skewed_environment() {
  return make_environment("skewed", 32, 16, [](Vec3 d) {
    return Vec3(0.3f) + 3.0f * std::exp(4 * (dot(d, normalize(Vec3(1, 2, -0.5f))) - 1)) * Vec3(1, 0.8f, 0.5f) +
           0.2f * std::max(0.0f, d.z) * Vec3(0.2f, 0.4f, 1);
  });
}

inline ReferenceOptions small_picture(int size, int spp, int bounces) {
  ReferenceOptions options;
  options.width = options.height = size, options.spp = spp, options.bounces = bounces, options.background = false;
  return options;
}

inline Camera look(Vec3 eye, Vec3 target, float fov = 40) {
  Camera camera;
  camera.eye = eye, camera.target = target, camera.fov = fov;
  return camera;
}

// Fails where two independent estimates of one picture differ by more than their noise, pixel by pixel or on the whole.
inline void expect_same(const ReferenceImage& a, const ReferenceImage& b) {
  Vec3d difference(0), variance(0);
  for (size_t i = 0; i < a.image.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      double d = double(a.image.rgb[i][c]) - double(b.image.rgb[i][c]),
             v = double(a.variance[i][c]) + double(b.variance[i][c]);
      EXPECT_LE(std::abs(d), sigmas * std::sqrt(v) + 1e-6)
          << "pixel " << i;  // 1e-6: pixels without noise round differently
      difference[c] += d, variance[c] += v;
    }
  // Three numbers: 4 sigmas are rare enough.
  for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(difference[c]), 4 * std::sqrt(variance[c]));
}

}  // namespace lambent::test

#include <lambent/basis/sh.h>
#include <lambent/core/parallel.h>
#include <lambent/light/project.h>

namespace lambent {

std::vector<Vec3> project_environment(const Environment& env, int order) {
  const int w = env.image.width, h = env.image.height, split = std::max(1, (1024 + w - 1) / w);
  const size_t coefficients = size_t(sh_count(order));
  // One partial sum a row of texels, added in order afterwards.
  std::vector<glm::dvec3> rows(coefficients * size_t(h), glm::dvec3(0));
  parallel_for(size_t(h), 1, [&](size_t begin, size_t end) {
    std::vector<float> y(coefficients);
    for (size_t row = begin; row < end; ++row) {
      glm::dvec3* sum = rows.data() + row * coefficients;
      for (int s = 0; s < split; ++s) {
        const int fine_row = int(row) * split + s;
        const double solid_angle = texel_solid_angle(fine_row, w * split, h * split);
        for (int x = 0; x < w; ++x) {
          const glm::dvec3 energy = glm::dvec3(env.image.at(x, int(row))) * solid_angle;
          for (int i = 0; i < split; ++i) {
            evaluate_sh(order, texel_direction(x * split + i, fine_row, w * split, h * split), y);
            for (size_t k = 0; k < coefficients; ++k) sum[k] += energy * double(y[k]);
          }
        }
      }
    }
  });
  std::vector<Vec3> light(coefficients);
  for (size_t k = 0; k < coefficients; ++k) {
    glm::dvec3 sum(0);
    for (size_t row = 0; row < size_t(h); ++row) sum += rows[row * coefficients + k];
    light[k] = Vec3(sum);
  }
  return light;
}

Environment reconstruct_environment(std::span<const Vec3> light, int width) {
  return make_environment("spherical harmonics of order " + std::to_string(sh_order(light.size())), width, width / 2,
                          [&](Vec3 d) { return reconstruct_sh(light, d); });
}

}  // namespace lambent

// Follows: the formulas of directional_convert.h; R. Ramamoorthi and P. Hanrahan, "An efficient representation for
// irradiance environment maps", 2001, for three.js' constants.
#include <lambent/basis/sh_convert.h>
#include <lambent/core/check.h>
#include <lambent/transfer/directional_convert.h>

#include <lambent/basis/sh.h>

namespace lambent {

std::vector<Vec3> three_light_probe(DirectionalKind kind, std::span<const Vec3> rows) {
  LAMBENT_CHECK((kind == DirectionalKind::sh2 || kind == DirectionalKind::sh3) &&
                rows.size() >= size_t(directional_rows(kind)));
  // Rows are E_lm / pi = A_l L_lm / pi.
  std::vector<Vec3> radiance(rows.begin(), rows.begin() + directional_rows(kind));
  for (size_t k = 0; k < radiance.size(); ++k) radiance[k] *= float(std::numbers::pi / clamped_cosine(sh_band(int(k))));
  return convert_sh(radiance, ShConvention::three);
}

std::array<Vec3, 4> godot_lightmap_layers(DirectionalKind kind, std::span<const Vec3> rows) {
  LAMBENT_CHECK((kind == DirectionalKind::sh2 || kind == DirectionalKind::sh3) && rows.size() >= 4);
  float y[4];
  evaluate_sh(2, normalize(Vec3(1)), y);
  const float axis = std::sqrt(3.0f);  // of (1, 1, 1): makes a row's factor of x, y or z
  std::array<Vec3, 4> layers{max(rows[0] * y[0], Vec3(0)), Vec3(0.5f), Vec3(0.5f), Vec3(0.5f)};
  for (size_t k = 1; k < 4; ++k)
    for (int c = 0; c < 3; ++c)
      if (layers[0][c] > 0)
        layers[k][c] = std::clamp(0.5f + 0.5f * rows[k][c] * y[k] * axis / (4 * layers[0][c]), 0.0f, 1.0f);
  return layers;
}

std::array<Vec3, 4> godot_unpacked_layers(DirectionalKind kind, std::span<const Vec3> rows) {
  LAMBENT_CHECK((kind == DirectionalKind::sh2 || kind == DirectionalKind::sh3) && rows.size() >= 4);
  float y[4];
  evaluate_sh(2, normalize(Vec3(1)), y);
  std::array<Vec3, 4> layers{rows[0] * (y[0] / 0.282095f), Vec3(0), Vec3(0), Vec3(0)};
  for (size_t k = 1; k < 4; ++k) layers[k] = rows[k] * (y[k] * std::sqrt(3.0f) / 0.32573f);
  return layers;
}

UnityDirection unity_direction(DirectionalKind kind, std::span<const Vec3> rows, Vec3 normal) {
  LAMBENT_CHECK((kind == DirectionalKind::sh2 || kind == DirectionalKind::sh3) && rows.size() >= 4);
  float y[4];
  evaluate_sh(2, normalize(Vec3(1)), y);
  const Vec3 luminance(0.2126f, 0.7152f, 0.0722f);
  const float level = dot(rows[0], luminance) * y[0], axis = std::sqrt(3.0f);
  UnityDirection out;
  if (!(level > 0)) return out;
  const float along[4] = {0, dot(rows[1], luminance) * y[1] * axis / level,
                          dot(rows[2], luminance) * y[2] * axis / level, dot(rows[3], luminance) * y[3] * axis / level};
  Vec3 d(along[3], along[1], along[2]);
  if (const float far = length(d); far > 1) d /= far;
  out.direction = 0.5f * d + Vec3(0.5f), out.balance = 0.5f * dot(normal, d) + 0.5f;
  return out;
}

}  // namespace lambent

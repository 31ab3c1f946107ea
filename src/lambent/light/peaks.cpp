#include <lambent/core/check.h>
#include <lambent/light/peaks.h>

#include <algorithm>
#include <numbers>
#include <utility>

namespace lambent {

Environment without_peaks(const Environment& env, int order) {
  LAMBENT_CHECK(order >= 1);
  const int w = env.image.width, h = env.image.height;
  std::vector<std::pair<float, double>> texels;  // luminance, solid angle
  texels.reserve(env.image.rgb.size());
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) texels.emplace_back(luminance(env.image.at(x, y)), texel_solid_angle(y, w, h));
  std::sort(texels.begin(), texels.end(), std::greater());
  double left = 4 * std::numbers::pi / (double(order) * order);
  float most = 0;
  for (const auto& [bright, angle] : texels) {
    most = bright;
    if ((left -= angle) < 0) break;
  }
  Environment cut = env;
  for (Vec3& c : cut.image.rgb)
    if (const float bright = luminance(c); bright > most) c *= most / bright;
  return cut;
}

}  // namespace lambent

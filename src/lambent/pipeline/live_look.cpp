#include <lambent/pipeline/live_look.h>

#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

Vec3 signed_color(float x) { return x < 0 ? Vec3(-x, -0.25f * x, 0) : Vec3(0, 0.5f * x, x); }

// A colour of the receiver's own, darker towards the borders between receivers.
Vec3 receiver_color(uint32_t receiver, float weight) {
  const uint64_t h = hash64(receiver, 0x5eed);
  const Vec3 hue(float(h & 255), float(h >> 8 & 255), float(h >> 16 & 255));
  return (0.15f + 0.85f * weight) * (0.3f + 0.7f / 255 * hue);
}

}  // namespace

std::function<SurfaceShade()> look_shade(Look look, const Scene& scene, const SpatialBasis& basis, const Relit& relit) {
  const Bounds box = bounds(scene);
  const float unit = length(box.max - box.min) / 1000;
  return [=, &scene, &basis, &relit]() -> SurfaceShade {
    return [=, &scene, &basis, &relit](const Hit& hit, Vec3) {
      Vec3 out(0.0f);
      std::visit(
          [&](const auto& b) {
            const auto* at = b.find(hit.triangle, hit.front);
            if (!at) return;
            uint32_t nearest = none;
            float most = -1, value = 0;
            b.spread(*at, hit.u, hit.v, [&](uint32_t receiver, float weight) {
              if (weight > most) nearest = receiver, most = weight;
              if (look == Look::coefficient) value += weight * relit.at(receiver).x;
            });
            if (look == Look::coefficient) out = signed_color(value);
            else if (look == Look::receivers) out = receiver_color(nearest, most);
          },
          basis);
      if (look != Look::density) return out;
      // Triangles for each thousandth of the scene's size squared, from 1/16 to 65,536.
      const float area = length(area_normal(scene, scene.triangles[hit.triangle])) / 2;
      return false_color((std::log2(unit * unit / std::max(area, 1e-30f)) + 4) / 20);
    };
  };
}

}  // namespace lambent

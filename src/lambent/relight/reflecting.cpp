#include <lambent/relight/reflecting.h>

#include <lambent/basis/sh_product.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <cmath>

namespace lambent {

ReflectingLight reflecting_light(const Field& field) {
  const Transfer& t = std::get<Transfer>(field.store);
  const int order = std::get<IncidentRows>(field.rows).order;
  LAMBENT_CHECK(t.channels == 3 && t.light.order >= 1 && t.columns() == size_t(sh_count(t.light.order)));
  ReflectingLight out{std::get<ShellPlacement>(field.where).shells, {}, t.light.order, order, {}};
  for (float r : out.shells.radii) out.log_radii.push_back(std::log2(r));
  const size_t n = size_t(sh_count(order)), m = t.columns();
  out.values.resize(t.receivers * 3 * n * m);
  parallel_for(t.receivers, 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const std::vector<float> rows = load_receiver(t, p);  // [row][channel][column]
      for (size_t c = 0; c < 3; ++c)
        for (size_t k = 0; k < n; ++k)
          std::copy_n(rows.begin() + ptrdiff_t((k * 3 + c) * m), m,
                      out.values.begin() + ptrdiff_t(((p * 3 + c) * n + k) * m));
    }
  });
  return out;
}

ShiningLight reflected_light(const ReflectingLight& light, std::span<const Vec3> arriving, const Mat3& rotation) {
  const size_t n = size_t(sh_count(light.order)), m = size_t(sh_count(light.incident_order));
  LAMBENT_CHECK(arriving.size() >= m);
  std::vector<Vec3> own(m);
  rotate_sh_zyz(transpose(rotation), arriving.first(m), std::span<Vec3>(own));
  ShiningLight out{light.shells, light.log_radii, light.order, {}};
  out.values.resize(light.shells.count() * 3 * n);
  parallel_for(light.shells.count(), 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p)
      for (size_t c = 0; c < 3; ++c)
        for (size_t k = 0; k < n; ++k) {
          const float* row = light.values.data() + ((p * 3 + c) * n + k) * m;
          float sum = 0;
          for (size_t i = 0; i < m; ++i) sum += row[i] * own[i][int(c)];
          out.values[(p * 3 + c) * n + k] = sum;
        }
  });
  return out;
}

void pass_objects(std::span<Vec3> light, Vec3 point, std::span<const PlacedObject* const> objects, float distance) {
  std::vector<float> factor, channel(light.size());
  for (const PlacedObject* object : objects) {
    const float far = length(object->place.position - point), reach = object->radius() / std::max(far, 1e-30f);
    if (!(far < distance) || 0.25f * reach * reach < MovingOptions().least_share) continue;
    factor.resize(size_t(sh_count(object->light->order)));
    hidden_from(*object, point, factor);
    for (float& f : factor) f = -f;
    factor[0] += 3.5449077f;  // of the constant 1: sqrt(4 pi)
    for (int c = 0; c < 3; ++c) {
      for (size_t k = 0; k < light.size(); ++k) channel[k] = light[k][c];
      multiply_sh(channel, factor, channel);
      for (size_t k = 0; k < light.size(); ++k) light[k][c] = channel[k];
    }
  }
}

}  // namespace lambent

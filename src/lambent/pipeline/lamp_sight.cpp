#include <lambent/pipeline/lamp_sight.h>

#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/lights.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lambent {

namespace {

// By area times weight(triangle).
template <class Weight>
std::vector<ShiningPoint> points_over(const Scene& object, int count, Weight weight) {
  std::vector<double> until;
  std::vector<uint32_t> triangles;
  double sum = 0;
  for (size_t t = 0; t < object.triangles.size(); ++t) {
    const Triangle& triangle = object.triangles[t];
    const Vec3 e = weight(triangle), a = object.positions[triangle.v[0]];
    const Vec3 area = cross(object.positions[triangle.v[1]] - a, object.positions[triangle.v[2]] - a);
    const double power = double(length(area)) * double(e.x + e.y + e.z);
    if (!(power > 0)) continue;
    sum += power, until.push_back(sum), triangles.push_back(uint32_t(t));
  }
  std::vector<ShiningPoint> out;
  for (int i = 0; i < count && sum > 0; ++i) {
    const double at = (i + 0.5) / count * sum;
    const size_t k =
        std::min(size_t(std::lower_bound(until.begin(), until.end(), at) - until.begin()), triangles.size() - 1);
    const Triangle& t = object.triangles[triangles[k]];
    Vec2 u = sobol_owen(uint32_t(i), 1);
    if (u.x + u.y > 1) u = Vec2(1 - u.x, 1 - u.y);
    const Vec3 a = object.positions[t.v[0]], b = object.positions[t.v[1]] - a, c = object.positions[t.v[2]] - a;
    out.push_back({a + u.x * b + u.y * c, normalize_or(cross(b, c), Vec3(0, 1, 0)), 1 / float(count), t.two_sided});
  }
  return out;
}

}  // namespace

std::vector<ShiningPoint> shining_points(const Scene& object, int count) {
  return points_over(object, count, [&](const Triangle& t) {
    return emits(object, t, true) ? emission(object, t, 1.0f / 3, 1.0f / 3) : Vec3(0.0f);
  });
}

std::vector<ShiningPoint> surface_points(const Scene& object, int count) {
  return points_over(object, count, [&](const Triangle& t) { return albedo(object, t, 1.0f / 3, 1.0f / 3); });
}

std::vector<float> lamp_in_sight(const Tracer& scene, float diagonal, const MovingReceivers& r,
                                 std::span<const ShiningPoint> points, Vec3 center, const RigidPlace& place,
                                 float reach) {
  std::vector<ShiningPoint> there(points.begin(), points.end());
  for (ShiningPoint& p : there) {
    p.position = place.position + place.scale * (place.rotation * (p.position - center));
    p.normal = place.rotation * p.normal;
  }
  std::vector<float> out(r.count);
  parallel_for(r.count, sh_tile, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (length(r.positions[i] - place.position) > reach) continue;
      const Vec3 origin = r.positions[i] + r.normals[i] * receiver_lift(r.positions[i], 0, diagonal);
      double all = 0, seen = 0;
      for (const ShiningPoint& p : there) {
        const Vec3 to = p.position - origin;
        const float squared = dot(to, to), distance = std::sqrt(squared);
        const float above = dot(to, r.normals[i]), facing = p.both ? std::abs(dot(to, p.normal)) : -dot(to, p.normal);
        if (!(above > 0 && facing > 0 && squared > 0)) continue;
        const double weight = double(p.power) * double(above) * double(facing) / (double(squared) * double(squared));
        const Vec3 passed = scene.transmittance(origin, to / distance, distance);
        all += weight, seen += weight * double(passed.x + passed.y + passed.z) / 3;
      }
      out[i] = all > 0 ? float(seen / all) : 0.0f;
    }
  });
  return out;
}

}  // namespace lambent

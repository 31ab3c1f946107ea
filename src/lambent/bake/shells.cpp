#include <lambent/bake/shells.h>

#include <lambent/basis/sh.h>
#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/scene/lights.h>

#include <algorithm>
#include <atomic>
#include <cmath>

namespace lambent {
namespace {

constexpr size_t rays_at_once = 64;

// Directions in which the object may be seen from a point, and the solid angle of all of them.
struct Cone {
  Mat3 frame{1.0f};
  float solid_angle = 4 * pi;
  bool whole = true;
  Vec3 direction(Vec2 u) const {
    if (whole) return square_to_sphere(u);
    const float z = 1 - u.x * solid_angle / (2 * pi), r = std::sqrt(std::max(0.0f, 1 - z * z));
    return frame * Vec3(r * std::cos(2 * pi * u.y), r * std::sin(2 * pi * u.y), z);
  }
};

Cone cone_towards(const Shells& shells, Vec3 point) {
  const Vec3 to = shells.center - point;
  const float distance = length(to), sine = shells.radius / std::max(distance, 1e-30f);
  if (!(sine < 0.999f)) return {};
  return {frame_about(to / distance), 2 * pi * (1 - std::sqrt(1 - sine * sine)), false};
}

// Integrals over the sphere of value(directions, values) times each of order^2 harmonics, at every point. `value` is
// given up to 64 directions, and fills `functions` numbers a direction, 64 apart. Of one row they are channels and the
// harmonics are columns; of more, the harmonics are rows, and they channels, and columns within.
template <class Value>
Result<Transfer> integrate(const Shells& shells, const ShellOptions& o, int order, WritableTransfer out,
                           const char* stage_name, Progress* progress, Value value) {
  const size_t n = size_t(sh_count(order)), count = shells.count();
  const size_t functions = out.transfer.receiver_values() / n;
  const bool one_row = out.transfer.rows == 1;
  ProgressStage stage(progress, stage_name, count);
  parallel_for(count, transfer_block, [&](size_t begin, size_t end) {
    alignas(64) float x[rays_at_once], y[rays_at_once], z[rays_at_once];
    AlignedVector<float> table(n * rays_at_once), values(functions * rays_at_once);
    std::vector<double> sums(functions * n), ones(n);
    std::vector<float> row(sums.size());
    for (size_t p = begin; p < end && !stage.cancelled(); ++p) {
      const Vec3 point = shell_point(shells, p);
      const Cone cone = cone_towards(shells, point);
      const auto key = uint32_t(hash64(p, o.seed));
      std::fill(sums.begin(), sums.end(), 0.0), std::fill(ones.begin(), ones.end(), 0.0);
      for (size_t first = 0; first < size_t(o.samples); first += rays_at_once) {
        const size_t rays = std::min(rays_at_once, size_t(o.samples) - first);
        for (size_t i = 0; i < rays; ++i) {
          const Vec3 d = cone.direction(sobol_owen(uint32_t(first + i), key));
          x[i] = d.x, y[i] = d.y, z[i] = d.z;
        }
        value(point, Directions{x, y, z, rays}, values.data());
        evaluate_sh(order, std::span(x, rays), std::span(y, rays), std::span(z, rays), rays_at_once, table);
        for (size_t f = 0; f < functions; ++f)
          for (size_t k = 0; k < n; ++k)
            for (size_t i = 0; i < rays; ++i)
              sums[f * n + k] += double(values[f * rays_at_once + i] * table[k * rays_at_once + i]);
        for (size_t k = 0; k < n; ++k)
          for (size_t i = 0; i < rays; ++i) ones[k] += double(table[k * rays_at_once + i]);
      }
      // Over the whole sphere the mean is integrated exactly: it has no harmonics but the first. So what is surrounded
      // is hidden without noise.
      for (size_t f = 0; cone.whole && f < functions; ++f)
        for (size_t k = 1; k < n; ++k) sums[f * n + k] -= sums[f * n] / ones[0] * ones[k];
      for (size_t f = 0; f < functions; ++f)
        for (size_t k = 0; k < n; ++k)
          row[one_row ? f * n + k : k * functions + f] = float(sums[f * n + k] * double(cone.solid_angle) / o.samples);
      store_receiver(out, p, row);
    }
    stage.advance(end - begin);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return out.transfer;
}

void add_radii(std::vector<float>& radii, double from, double to, int count) {
  for (int i = 0; i < count; ++i)
    radii.push_back(float(from * std::pow(to / from, count > 1 ? double(i) / (count - 1) : 0.0)));
}

}  // namespace

Result<Shells> make_shells(const Scene& scene, const ShellOptions& o) {
  if (o.order < 1 || o.order > max_sh_order) return Error{"", "the order must be 1 to 16"};
  if (o.shells < 2 || o.shells > max_shells || o.side < 2 || o.side > max_shell_side)
    return Error{"", "from 2 to 64 shells of 2 to 64 points a side are possible"};
  if (!(o.inner > 0 && o.inner < 1 && o.outer > 1) || !std::isfinite(o.outer))
    return Error{"", "the first shell must lie within the object's sphere, and the last one beyond it"};
  const Bounds box = bounds(scene);
  Shells s{0.5f * (box.min + box.max), 0, {}, o.side};
  for (const Vec3& p : scene.positions) s.radius = std::max(s.radius, length(p - s.center));
  if (scene.triangles.empty() || !is_finite(s.center) || !(s.radius > 0) || !std::isfinite(s.radius * o.outer))
    return Error{scene.path, "has no size to put shells about"};
  const int within = o.shells / 3;
  if (within > 0) add_radii(s.radii, o.inner * double(s.radius), 0.98 * double(s.radius), within);
  // What is hidden changes fast just outside: even steps of the logarithm of the distance from the sphere.
  std::vector<float> beyond;
  add_radii(beyond, 0.01, o.outer - 1.0, o.shells - within);
  for (float b : beyond) s.radii.push_back(float((1 + double(b)) * double(s.radius)));
  if (!is_consistent(s)) return Error{"", "the shells do not rise: the first or the last lies too near the sphere"};
  return s;
}

Result<Field> bake_hidden(const Tracer& tracer, const Shells& shells, const ShellOptions& o, ShellReport* report,
                          Progress* progress) {
  const auto start = Clock::now();
  auto t = integrate(shells, o, o.order, make_transfer({.order = o.order}, 1, 1, shells.count(), Precision::half),
                     "shells", progress, [&](Vec3 point, const Directions& d, float* values) {
                       tracer.visible_fan(point, d, values);
                       for (size_t i = 0; i < d.count; ++i) values[i] = 1 - values[i];
                     });
  if (!t) return t.error();
  if (report) *report = {shells.count(), shells.count() * size_t(o.samples), t->bytes(), seconds_since(start)};
  return Field{ShellPlacement{shells}, std::move(*t), HiddenRows{}};
}

Result<Field> bake_shining(const Scene& scene, const Tracer& tracer, const Shells& shells, const ShellOptions& o,
                           Progress* progress) {
  if (std::none_of(scene.materials.begin(), scene.materials.end(),
                   [](const Material& m) { return m.emissive != Vec3(0.0f); }))
    return Error{scene.path, "has no emissive material that it could shine with"};
  float brightest = 0;
  for (const Material& m : scene.materials) brightest = std::max({brightest, m.emissive.x, m.emissive.y, m.emissive.z});
  // 4 pi of the brightest times a harmonic is beyond what half a float holds.
  const Precision precision = brightest > 500 ? Precision::single : Precision::half;
  auto t =
      integrate(shells, o, o.order, make_transfer({.groups = {"all"}}, sh_count(o.order), 3, shells.count(), precision),
                "shining", progress, [&](Vec3 point, const Directions& d, float* values) {
                  Hit hits[rays_at_once];
                  tracer.closest_fan(point, d, hits);
                  for (size_t i = 0; i < d.count; ++i) {
                    Vec3 e(0.0f);
                    if (hits[i].triangle != none && emits(scene, scene.triangles[hits[i].triangle], hits[i].front)) {
                      const Triangle& triangle = scene.triangles[hits[i].triangle];
                      e = scene.materials[scene.parts[triangle.part].material].emissive *
                          emission_texel(scene, triangle, hits[i].u, hits[i].v);
                    }
                    for (size_t c = 0; c < 3; ++c) values[c * rays_at_once + i] = e[int(c)];
                  }
                });
  if (!t) return t.error();
  return Field{ShellPlacement{shells}, std::move(*t), IncidentRows{o.order}};
}

Result<Field> bake_reflecting(const Scene& scene, const Tracer& tracer, const CornerReceivers& receivers,
                              const Transfer& own, const Shells& shells, const ShellOptions& o, Progress* progress) {
  const int incident = std::min(own.light.order, reflected_incident_order), order = std::min(o.order, reflected_order);
  const size_t n = size_t(sh_count(incident)), width = 3 * n, channels = size_t(own.channels);
  std::vector<float> exit(own.receivers * width);  // [receiver][channel][column]
  parallel_for(own.receivers, 256, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      const std::vector<float> row = load_receiver(own, r);
      for (size_t c = 0; c < 3; ++c)
        std::copy_n(row.begin() + ptrdiff_t(std::min(c, channels - 1) * own.columns()), n,
                    exit.begin() + ptrdiff_t(r * width + c * n));
    }
  });
  auto t = integrate(
      shells, o, order, make_transfer({.order = incident}, sh_count(order), 3, shells.count(), Precision::half),
      "reflecting", progress, [&](Vec3 point, const Directions& d, float* values) {
        Hit hits[rays_at_once];
        tracer.closest_fan(point, d, hits);
        std::fill_n(values, width * rays_at_once, 0.0f);
        for (size_t i = 0; i < d.count; ++i) {
          const Hit& hit = hits[i];
          const Corners* corners = hit.triangle == none ? nullptr : receivers.find(hit.triangle, hit.front);
          if (!corners) continue;
          const Vec3 colour = albedo(scene, scene.triangles[hit.triangle], hit.u, hit.v);
          receivers.spread(*corners, hit.u, hit.v, [&](uint32_t r, float weight) {
            const float* from = exit.data() + size_t(r) * width;
            for (size_t f = 0; f < width; ++f) values[f * rays_at_once + i] += weight * colour[int(f / n)] * from[f];
          });
        }
      });
  if (!t) return t.error();
  return Field{ShellPlacement{shells}, std::move(*t), IncidentRows{order}};
}

}  // namespace lambent

// Follows: radiosity, "Discussion 4" (direct light apart); E. Veach and L. Guibas, "Optimally combining sampling
// techniques for Monte Carlo rendering", 1995.
#include <lambent/bake/fan.h>
#include <lambent/bake/lamps.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/scene/see_through.h>

#include <algorithm>
#include <numeric>

namespace lambent {
namespace {

// Cells of all lamps together.
constexpr size_t most_cells = size_t{1} << 22;

// Distances that agree to this fraction are the same surface.
constexpr float same_distance = 1e-3f;

// A fan of rays that end at given distances; says which arrive.
struct ShadowRays {
  std::vector<float> x, y, z;
  std::vector<Hit> hits;
  void clear() { x.clear(), y.clear(), z.clear(); }
  size_t add(Vec3 d) {
    x.push_back(d.x), y.push_back(d.y), z.push_back(d.z);
    return x.size() - 1;
  }
  void trace(const Tracer& tracer, Vec3 origin, const Progress* progress) {
    hits.resize(x.size());
    trace_hits(tracer, origin, {x.data(), y.data(), z.data(), x.size()}, hits.data(), {}, progress);
  }
};

// L p_c / (N p_l + M p_c)
Vec3 balanced(Vec3 radiance, float cosine, double lamp_density, int samples, size_t rays) {
  const double p_c = double(std::max(cosine, 0.0f)) / std::numbers::pi;
  const double sum = double(samples) * lamp_density + double(rays) * p_c;
  return sum > 0 ? radiance * float(p_c / sum) : Vec3(0);
}

// Of a lamp's picture, over the square of its cells a side: a bright spot between the points that were looked at, which
// is smaller than a cell, is not drawn too seldom.
constexpr float least_share = 0.02f;

// Texels that a triangle's picture spans, about.
double texels_over(const Scene& scene, const Triangle& t) {
  const Material& m = scene.materials[scene.parts[t.part].material];
  const Texture& texture = scene.textures[size_t(m.emissive_texture)];
  auto at = [&](float u, float v) { return texture_place(scene, t, u, v, m.emissive_set, m.emissive_transform); };
  const Vec2 a = at(0, 0), b = at(1, 0) - a, c = at(0, 1) - a;
  const double area = 0.5 * std::abs(double(b.x) * double(c.y) - double(b.y) * double(c.x));
  return area * texture.width * texture.height;
}

// Cells a side: about two a texel, since light between texels is interpolated, as far as there is room.
uint32_t cells_of(const Scene& scene, const Triangle& t, size_t room) {
  constexpr uint32_t most = 64;
  if (scene.materials[scene.parts[t.part].material].emissive_texture < 0) return 0;
  const double side = 2 * std::sqrt(texels_over(scene, t));
  uint32_t n = 1;
  while (n < most && n < side) n *= 2;
  while (n > 1 && 2 * size_t(n) * n > room) n /= 2;
  return n;
}

// The mean of the emission's texels over each cell, 0 for those that are not in the triangle, and over all of them.
std::vector<double> cell_means(const Scene& scene, const Triangle& t, uint32_t n, Vec3& mean) {
  // As many points in all whatever the cells, a few in each at least.
  const int points = std::max(256 / int(n * n), 8);
  const Vec3 color = scene.materials[scene.parts[t.part].material].emissive;
  std::vector<double> out(2 * size_t(n) * n, 0.0);
  Vec3 sum(0);
  for (uint32_t j = 0; j < n; ++j) {
    for (uint32_t i = 0; i + j < n; ++i) {
      for (uint32_t far = 0; far < (i + j + 1 < n ? 2u : 1u); ++far) {
        Vec3 cell(0);
        for (int k = 0; k < points; ++k) {
          Vec2 x = sobol_owen(uint32_t(k), far + 2 * (i + n * j));
          if ((x.x + x.y > 1) != (far == 1)) x = Vec2(1 - x.x, 1 - x.y);
          cell += emission_texel(scene, t, (float(i) + x.x) / float(n), (float(j) + x.y) / float(n));
        }
        cell = cell / float(points);
        sum += cell;
        out[2 * (size_t(j) * n + i) + far] = double(largest(color * cell));
      }
    }
  }
  mean = color * (max(sum, Vec3(least_share)) / float(n * n));
  // One sample in ten goes anywhere.
  const double all = std::accumulate(out.begin(), out.end(), 0.0), least = all > 0 ? 0.1 * all / (double(n) * n) : 1;
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i + j < n; ++i)
      for (uint32_t far = 0; far < (i + j + 1 < n ? 2u : 1u); ++far) {
        double& cell = out[2 * (size_t(j) * n + i) + far];
        cell = std::max(cell, least);
      }
  return out;
}

// What of the lamp's samples falls into a cell, over the cell's share of its area.
double cell_density(const Lamps& lamps, const AreaLamp& lamp, uint32_t cell) {
  const double* to = lamps.cell_cumulative.data() + lamp.first_cell;
  return (to[cell] - (cell > 0 ? to[cell - 1] : 0)) * lamp.cells * lamp.cells;
}

// A point of a lamp for a random one of the unit square: by its cells, uniform within each. `density`: over the mean.
Vec2 draw_point(const Lamps& lamps, const AreaLamp& lamp, Vec2 u, double& density) {
  density = 1;
  uint32_t cell = 0;
  if (lamp.cells > 0) {
    const auto begin = lamps.cell_cumulative.begin() + lamp.first_cell, end = begin + 2 * lamp.cells * lamp.cells;
    cell = uint32_t(std::min(std::upper_bound(begin, end, double(u.x)), end - 1) - begin);
    const double low = cell > 0 ? begin[cell - 1] : 0.0, share = begin[cell] - low;
    u.x = share > 0 ? std::clamp(float((double(u.x) - low) / share), 0.0f, 1.0f) : 0.5f;
    density = cell_density(lamps, lamp, cell);
  }
  const float root = std::sqrt(u.x);
  Vec2 at(1 - root, u.y * root);
  if (lamp.cells == 0) return at;
  const uint32_t square = cell / 2, n = lamp.cells;
  if (cell % 2 == 1) at = Vec2(1 - at.x, 1 - at.y);
  return Vec2((float(square % n) + at.x) / float(n), (float(square / n) + at.y) / float(n));
}

struct PendingSample {
  LampLight light;
  uint32_t triangle;  // that the ray must meet; none: it must travel `distance`
  float distance;
};

}  // namespace

uint32_t lamp_cell(uint32_t n, float u, float v) {
  const float x = std::clamp(u, 0.0f, 1.0f) * float(n), y = std::clamp(v, 0.0f, 1.0f) * float(n);
  const uint32_t i = std::min(uint32_t(x), n - 1), j = std::min(uint32_t(y), n - 1 - i);  // rounding keeps it inside
  const bool far = i + j + 1 < n && (x - float(i)) + (y - float(j)) > 1;
  return 2 * (j * n + i) + (far ? 1 : 0);
}

Lamps make_lamps(const Scene& scene, const Environment* sky, bool separate) {
  Lamps lamps;
  auto group_of = [&](const std::string& name) {
    const std::string key = separate ? name : all_lamps;
    const auto known = std::find(lamps.names.begin(), lamps.names.end(), key);
    if (known != lamps.names.end()) return uint32_t(known - lamps.names.begin());
    lamps.names.push_back(key);
    return uint32_t(lamps.names.size() - 1);
  };
  std::vector<uint32_t> material_group(scene.materials.size(), none);
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const Triangle& triangle = scene.triangles[t];
    const uint32_t m = scene.parts[triangle.part].material;
    const Material& material = scene.materials[m];
    const float area = 0.5f * area_length(area_normal(scene, triangle));
    if (!(largest(material.emissive) > 0) || !(area > 0)) continue;
    if (material_group[m] == none)
      material_group[m] = group_of(material.name.empty() ? "material " + std::to_string(m) : material.name);
    AreaLamp lamp{t, material_group[m], material.emissive, double(area)};  // its area, until all are known
    lamp.cells = cells_of(scene, triangle, most_cells - std::min(most_cells, lamps.cell_cumulative.size()));
    if (lamp.cells > 0) {
      lamp.first_cell = uint32_t(lamps.cell_cumulative.size());
      const std::vector<double> means = cell_means(scene, triangle, lamp.cells, lamp.radiance);
      const double all = std::accumulate(means.begin(), means.end(), 0.0);
      double sum = 0;
      for (double mean : means) lamps.cell_cumulative.push_back((sum += mean) / all);
    }
    lamps.area.push_back(lamp);
  }
  for (const PunctualLight& light : scene.lights)
    lamps.punctual_group.push_back(largest(light.intensity) > 0 ? group_of(light.name) : none);
  if (sky) {
    lamps.sky = sky, lamps.sky_sampler = make_environment_sampler(*sky);
    if (lamps.sky_sampler.total > 0) lamps.sky_group = group_of(sky_name);
    else lamps.sky = nullptr;
  }
  std::stable_sort(lamps.area.begin(), lamps.area.end(),
                   [](const AreaLamp& a, const AreaLamp& b) { return a.group < b.group; });
  lamps.first.assign(lamps.groups() + 1, 0);
  for (const AreaLamp& lamp : lamps.area) ++lamps.first[lamp.group + 1];
  for (size_t g = 0; g < lamps.groups(); ++g) lamps.first[g + 1] += lamps.first[g];
  lamps.cumulative.resize(lamps.area.size());
  if (!lamps.area.empty()) lamps.of_triangle.assign(scene.triangles.size(), none);
  for (size_t g = 0; g < lamps.groups(); ++g) {
    double sum = 0;
    for (uint32_t i = lamps.first[g]; i < lamps.first[g + 1]; ++i) {
      sum += lamps.area[i].density * double(largest(lamps.area[i].radiance));
      lamps.cumulative[i] = sum, lamps.of_triangle[lamps.area[i].triangle] = i;
    }
    for (uint32_t i = lamps.first[g]; i < lamps.first[g + 1]; ++i)
      lamps.area[i].density = double(largest(lamps.area[i].radiance)) / sum;
  }
  return lamps;
}

void sample_lamps(const Scene& scene, const Tracer& tracer, const Lamps& lamps, Vec3 origin, Vec3 normal, int samples,
                  size_t rays, uint32_t seed, size_t receiver, std::vector<LampLight>& out, const Progress* progress) {
  thread_local ShadowRays shadow;
  thread_local std::vector<PendingSample> pending;
  shadow.clear(), pending.clear();
  auto add = [&](uint32_t group, Vec3 d, Vec3 value, uint32_t triangle, float distance) {
    if (!(largest(value) > 0)) return;
    shadow.add(d);
    pending.push_back({{group, d, value}, triangle, distance});
  };
  for (size_t g = 0; g < lamps.groups(); ++g) {
    const uint32_t begin = lamps.first[g], end = lamps.first[g + 1];
    if (begin == end) continue;
    const double total = lamps.cumulative[end - 1];
    const uint32_t key = uint32_t(hash64(hash64(seed, 0x1a3 + g), receiver));
    for (int s = 0; s < samples; ++s) {
      if (ends_fan(size_t(s), progress)) return;
      // One number picks the triangle and, by where within its share it fell, the place in it: the points stay spread
      // over both. (A second sequence of the same dimension would follow the first, digit by digit, however it is
      // scrambled.)
      Vec2 u = sobol_owen(uint32_t(s), key);
      const double target = double(u.x) * total;
      const size_t at = std::min<size_t>(
          size_t(std::upper_bound(lamps.cumulative.begin() + begin, lamps.cumulative.begin() + end, target) -
                 lamps.cumulative.begin()),
          end - 1);
      const AreaLamp& lamp = lamps.area[at];
      const Triangle& t = scene.triangles[lamp.triangle];
      const double low = at == begin ? 0.0 : lamps.cumulative[at - 1];
      u.x = std::min(float((target - low) / (lamps.cumulative[at] - low)), 1.0f);
      double share;
      const Vec2 place = draw_point(lamps, lamp, u, share);
      const Vec3 to = interpolate(scene.positions, t, place.x, place.y) - origin;
      const float distance2 = dot(to, to);
      if (!(distance2 > 0)) continue;
      const float distance = std::sqrt(distance2);
      const Vec3 d = to / distance;
      const float cosine = dot(normal, d), facing = -dot(unit_normal(scene, t), d);
      if (!(cosine > 0) || !emits(scene, t, facing > 0) || facing == 0) continue;
      const double density = lamp.density * share * double(distance2) / double(std::abs(facing));
      Vec3 radiance = emission(scene, t, place.x, place.y);
      if (tracer.lets_pass(lamp.triangle)) radiance *= coverage(scene, t, place.x, place.y);
      add(lamp.group, d, balanced(radiance, cosine, density, samples, rays), lamp.triangle, distance);
    }
  }
  for (size_t l = 0; l < lamps.punctual_group.size(); ++l) {
    if (lamps.punctual_group[l] == none) continue;
    const LampArrival a = arriving(scene.lights[l], origin);
    add(lamps.punctual_group[l], a.direction, a.irradiance * (std::max(0.0f, dot(normal, a.direction)) / pi), none,
        a.distance);
  }
  if (lamps.sky) {
    const uint32_t key = uint32_t(hash64(hash64(seed, 0x5c1), receiver));
    for (int s = 0; s < samples; ++s) {
      const EnvironmentSample e = sample_environment(lamps.sky_sampler, sobol_owen(uint32_t(s), key));
      add(lamps.sky_group, e.direction, balanced(e.radiance, dot(normal, e.direction), double(e.pdf), samples, rays),
          none, INFINITY);
    }
  }
  shadow.trace(tracer, origin, progress);
  for (size_t i = 0; i < pending.size(); ++i) {
    if (ends_fan(i, progress)) return;
    const Hit& h = shadow.hits[i];
    const bool arrives = h.triangle == none || h.triangle == pending[i].triangle ||
                         h.distance >= pending[i].distance * (1 - same_distance);
    if (!arrives && h.triangle != none && tracer.lets_pass(h.triangle)) {
      LampLight light = pending[i].light;
      light.value *= tracer.transmittance(origin, light.direction, pending[i].distance * (1 - same_distance));
      if (largest(light.value) > 0) out.push_back(light);
    }
    if (arrives) out.push_back(pending[i].light);
  }
}

LampLight met_lamp(const Scene& scene, const Lamps& lamps, uint32_t index, const Hit& hit, Vec3 direction, float cosine,
                   int samples, size_t rays) {
  const AreaLamp& lamp = lamps.area[index];
  const Triangle& t = scene.triangles[lamp.triangle];
  const float facing = std::abs(dot(unit_normal(scene, t), direction));
  const double share = lamp.cells > 0 ? cell_density(lamps, lamp, lamp_cell(lamp.cells, hit.u, hit.v)) : 1.0;
  const double density = lamp.density * share * double(hit.distance) * double(hit.distance) /
                         double(std::max(facing, 1e-30f));
  return {lamp.group, direction, balanced(emission(scene, t, hit.u, hit.v), cosine, density, samples, rays)};
}

LampLight met_sky(const Lamps& lamps, Vec3 direction, float cosine, int samples, size_t rays) {
  return {lamps.sky_group, direction,
          balanced(radiance(*lamps.sky, direction), cosine, double(environment_pdf(lamps.sky_sampler, direction)),
                   samples, rays)};
}

}  // namespace lambent

#pragma once
// The scene's own lamps as light columns: emissive materials, punctual lights, and a sky, alone or in named groups.
// What a group sends to a receiver without a bounce is gathered by two ways of sampling, each sample weighted by the
// densities of both (Veach and Guibas 1995, balance heuristic): directions towards the lamps, and the
// cosine-distributed rays of the gather operator, whose hits are known anyway. A sample from direction w then counts L
// p_c / (N p_l + M p_c), with p_c = cos / pi the density of the M rays and p_l that of the N lamp samples; which of the
// two drew it does not matter.
#include <lambent/light/environment.h>
#include <lambent/scene/lights.h>
#include <lambent/trace/tracer.h>

#include <string>
#include <vector>

namespace lambent {

struct AreaLamp {
  uint32_t triangle, group;
  Vec3 radiance;   // the mean over it, or a little more: what the density follows
  double density;  // of the group's samples, per area, where it has no cells
  // Of a lamp with a picture: the first of its cells (LampCells), in rows of 2 * cells.
  uint32_t first_cell = 0, cells = 0;
};

// A triangle cut into n x n alike ones by weights (u, v) of its corners, so that samples follow its picture: of square
// (i, j) of n x n the near half is cell 2 (j n + i), the far one, which lies in the triangle too where i + j < n - 1,
// the next.
uint32_t lamp_cell(uint32_t n, float u, float v);

struct Lamps {
  std::vector<std::string> names;        // of groups
  std::vector<AreaLamp> area;            // by group, then triangle
  std::vector<uint32_t> first;           // of each group's run in `area`; one more at the end
  std::vector<double> cumulative;        // within each group, as `area`
  std::vector<double> cell_cumulative;   // within each lamp that has cells, ending in 1
  std::vector<uint32_t> of_triangle;     // lamp of each scene triangle, or none; empty without area lamps
  std::vector<uint32_t> punctual_group;  // of each of Scene::lights
  const Environment* sky = nullptr;
  EnvironmentSampler sky_sampler;
  uint32_t sky_group = none;

  size_t groups() const { return names.size(); }
};

// Name of the group of everything, where groups are not wanted.
inline constexpr const char* all_lamps = "all";
inline constexpr const char* sky_name = "sky";

// One group a material or light name with `separate`, in order of first appearance, the sky last; else one of all. No
// lamps at all gives no groups. `sky` may be null and must outlive the lamps. Lamps that are black or without an area
// are left out.
Lamps make_lamps(const Scene& scene, const Environment* sky, bool separate);

// One contribution to a receiver: radiance times weight, such that their sum is exit radiance of a white surface there.
struct LampLight {
  uint32_t group;
  Vec3 direction;  // unit, from the receiver
  Vec3 value;
};

// N samples towards each group's area lamps, as many towards the sky, one ray a punctual light; adds what arrives.
// Random numbers are keyed by (seed, receiver). `rays`: M, of the gather's fan whose hits will be added by the two
// below; 0: there are none, and lamp samples stand alone. Ends early, with less than arrives, where cancelled.
void sample_lamps(const Scene& scene, const Tracer& tracer, const Lamps& lamps, Vec3 origin, Vec3 normal, int samples,
                  size_t rays, uint32_t seed, size_t receiver, std::vector<LampLight>& out,
                  const Progress* progress = nullptr);

// What a ray of the fan brings that met an area lamp, or left the scene.
LampLight met_lamp(const Scene& scene, const Lamps& lamps, uint32_t lamp, const Hit& hit, Vec3 direction, float cosine,
                   int samples, size_t rays);
LampLight met_sky(const Lamps& lamps, Vec3 direction, float cosine, int samples, size_t rays);

}  // namespace lambent

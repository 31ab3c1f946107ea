// Follows: radiosity, "Bilinear Basis Function": a texel's function is a tent over four texels, and every tent that
// reaches the surface takes part.
#include <lambent/receivers/atlas.h>
#include <lambent/receivers/raster.h>

namespace lambent {
namespace {

// Points on a chart's border start this far inside it, as a fraction of a texel: its edge may lie in a wall.
constexpr float border_inset = 0.05f;

}  // namespace

TexelReceivers texel_receivers(const Scene& scene, int width, int height, const std::vector<Vec2>& front,
                               const std::vector<Vec2>& back, std::vector<uint32_t> texels) {
  TexelReceivers map;
  map.width = width, map.height = height, map.texels = std::move(texels);
  map.front.resize(scene.triangles.size());
  if (!back.empty()) map.back.resize(scene.triangles.size());
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    const Vec3 n = area_normal(scene, t);
    if (!(area_length(n) > 0)) continue;
    map.front[i] = {{front[t.v[0]], front[t.v[1]], front[t.v[2]]}, t.part};
    if (!back.empty() && t.two_sided) map.back[i] = {{back[t.v[0]], back[t.v[1]], back[t.v[2]]}, t.part};
  }
  return map;
}

void place_texel(const Scene& scene, Receivers& receivers, size_t r, const TexelPlace& at, bool back, float texel,
                 float diagonal) {
  const Triangle& t = scene.triangles[at.triangle];
  const Vec3 face = unit_normal(scene, t, Vec3(0, 1, 0)) * (back ? -1.0f : 1.0f);
  Vec3 n = normalize_or(interpolate(scene.normals, t, at.u, at.v), face);
  if (dot(n, face) < 0) n = -n;
  Vec3 p = interpolate(scene.positions, t, at.u, at.v);
  const Vec3 inward = (scene.positions[t.v[0]] + scene.positions[t.v[1]] + scene.positions[t.v[2]]) / 3.0f - p;
  if (std::min({at.u, at.v, 1 - at.u - at.v}) < border_inset)
    p += inward * std::min(0.5f, border_inset * texel / std::max(length(inward), 1e-30f));
  receivers.origins[r] = p + face * receiver_lift(p, texel, diagonal);
  receivers.normals[r] = n, receivers.places[r] = at;
}

Receivers make_texel_receivers(const Scene& scene, const Atlas& atlas) {
  const size_t texels = size_t(atlas.width) * size_t(atlas.height);
  TexelReceivers map =
      texel_receivers(scene, atlas.width, atlas.height, atlas.front, atlas.back, std::vector<uint32_t>(texels, none));
  struct Nearest {
    float distance = INFINITY;
    uint32_t triangle = none;
    float u = 0, v = 0;
    bool back = false;
  };
  std::vector<Nearest> nearest(texels);
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    for (const bool back : {false, true}) {
      const TexelTriangle* own = map.find(t, !back);
      if (!own) continue;
      const std::array<Vec2, 3> corners{own->at[0], own->at[1], own->at[2]};
      each_texel(corners, 1, atlas.width, atlas.height, [&](int i, int j) {
        const ClosestPoint c = closest_point(corners, Vec2(float(i) + 0.5f, float(j) + 0.5f));
        Nearest& texel = nearest[size_t(j) * size_t(atlas.width) + size_t(i)];
        if (c.distance < texel.distance) texel = {c.distance, t, c.u, c.v, back};
      });
    }
  }

  std::vector<uint32_t> used;
  std::vector<Vec3> places;
  for (size_t k = 0; k < texels; ++k) {
    if (nearest[k].triangle == none) continue;
    used.push_back(uint32_t(k));
    places.push_back(interpolate(scene.positions, scene.triangles[nearest[k].triangle], nearest[k].u, nearest[k].v));
  }
  const Bounds box = bounds(scene);
  const float diagonal = box.diagonal(), texel_size = 1 / std::max(atlas.texels_per_unit, 1e-30f);
  Receivers r;
  r.origins.resize(used.size()), r.normals.resize(used.size()), r.places.resize(used.size());
  uint32_t next = 0;
  for (uint32_t i : curve_order(places, box)) {
    const Nearest& at = nearest[used[i]];
    map.texels[used[i]] = next;
    place_texel(scene, r, next++, {at.triangle, at.u, at.v}, at.back, texel_size, diagonal);
  }
  r.basis = std::move(map);
  return r;
}

}  // namespace lambent

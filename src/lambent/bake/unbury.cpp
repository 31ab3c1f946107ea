// Follows: radiosity, "Bilinear Basis Function" (every tent that reaches the surface takes part), so a texel may stand
// for any point of its tent.
#include <lambent/bake/gather.h>
#include <lambent/bake/unbury.h>
#include <lambent/core/parallel.h>
#include <lambent/core/ranks.h>
#include <lambent/receivers/raster.h>

namespace lambent {
namespace {

// Half sides of squares about the centre, in texels, on which points are tried, in `turns` directions; then the gap to
// the last one is halved. Points beyond the surface's border stand for the nearest on it, as texel centres do.
constexpr float radii[] = {0.3f, 0.6f, 0.99f};
constexpr int turns = 8, halvings = 3;

struct Side {
  uint32_t triangle;
  bool back;
};

// A buried texel's centre in the atlas, and the sides of triangles that its tent reaches.
struct Texel {
  uint32_t receiver;
  Vec2 centre;
  std::vector<Side> sides;
};

std::vector<Texel> buried_texels(const Scene& scene, const TexelReceivers& map, const std::vector<uint8_t>& buried) {
  std::vector<Texel> texels;
  std::vector<uint32_t> index(buried.size(), none);
  for (size_t k = 0; k < map.texels.size(); ++k) {
    const uint32_t r = map.texels[k];
    if (r == none || !buried[r]) continue;
    index[r] = uint32_t(texels.size());
    texels.push_back({r, Vec2(float(k % size_t(map.width)) + 0.5f, float(k / size_t(map.width)) + 0.5f), {}});
  }
  if (texels.empty()) return texels;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t)
    for (const bool back : {false, true}) {
      const TexelTriangle* own = map.find(t, !back);
      if (!own) continue;
      each_texel({own->at[0], own->at[1], own->at[2]}, 1, map.width, map.height, [&](int i, int j) {
        const uint32_t r = map.texels[size_t(j) * size_t(map.width) + size_t(i)];
        if (r != none && index[r] != none) texels[index[r]].sides.push_back({t, back});
      });
    }
  return texels;
}

}  // namespace

size_t move_buried_texels(const Scene& scene, const Tracer& tracer, const Atlas& atlas, Receivers& receivers,
                          Progress* progress) {
  const TexelReceivers& map = std::get<TexelReceivers>(receivers.basis);
  std::vector<uint8_t> buried(receivers.count(), 0), moved(receivers.count(), 0);
  {
    const Shares shares(receivers.count(), gather_block);
    ProgressStage stage(progress, "texels inside", shares.own());
    shares.for_own([&](size_t begin, size_t end) {
      if (stage.cancelled()) return;
      for (size_t r = begin; r < end; ++r) buried[r] = is_buried(tracer, receivers, r);
      stage.advance(end - begin);
    });
    if (!none_cancelled(progress)) return 0;
    shares.gather(buried.data());
  }

  const std::vector<Texel> texels = buried_texels(scene, map, buried);
  if (texels.empty()) return 0;
  const float texel_size = 1 / std::max(atlas.texels_per_unit, 1e-30f), diagonal = bounds(scene).diagonal();
  ProgressStage stage(progress, "moving texels", texels.size());
  parallel_for(texels.size(), 16, [&](size_t begin, size_t end) {
    if (stage.cancelled()) return;
    for (size_t i = begin; i < end && !stage.cancelled(); ++i) {
      const Texel& texel = texels[i];
      const size_t r = texel.receiver;
      const Vec3 origin = receivers.origins[r], normal = receivers.normals[r];
      const TexelPlace place = receivers.places[r];
      // Puts the receiver there; false where there is no surface, or only more of the inside.
      auto stands_clear = [&](Vec2 at) {
        ClosestPoint nearest{0, 0, INFINITY};
        Side on{};
        for (const Side& side : texel.sides) {
          const TexelTriangle& own = *map.find(side.triangle, !side.back);
          const ClosestPoint c = closest_point({own.at[0], own.at[1], own.at[2]}, at);
          const Vec2 away = abs((1 - c.u - c.v) * own.at[0] + c.u * own.at[1] + c.v * own.at[2] - texel.centre);
          if (std::max(away.x, away.y) < 1 && c.distance < nearest.distance) nearest = c, on = side;
        }
        if (!(nearest.distance < INFINITY)) return false;
        place_texel(scene, receivers, r, {on.triangle, nearest.u, nearest.v}, on.back, texel_size, diagonal);
        return !is_buried(tracer, receivers, r);
      };
      auto search = [&] {
        float last = 0;
        for (float radius : radii) {
          for (int turn = 0; turn < turns; ++turn) {
            const float angle = 2 * pi * float(turn) / turns;
            Vec2 way(std::cos(angle), std::sin(angle));
            way /= std::max(std::abs(way.x), std::abs(way.y));
            if (!stands_clear(texel.centre + radius * way)) continue;
            float in = last, out = radius;
            for (int k = 0; k < halvings; ++k) {
              const float middle = 0.5f * (in + out);
              (stands_clear(texel.centre + middle * way) ? out : in) = middle;
            }
            return stands_clear(texel.centre + out * way);
          }
          last = radius;
        }
        return false;
      };
      moved[r] = search();
      if (!moved[r]) receivers.origins[r] = origin, receivers.normals[r] = normal, receivers.places[r] = place;
    }
    stage.advance(end - begin);
  });
  size_t count = 0;
  for (uint8_t m : moved) count += m;
  return count;
}

}  // namespace lambent

#pragma once
// A lightmap's atlas: where in a picture each side of each triangle has its texels.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/receivers/receivers.h>

namespace lambent {

inline constexpr int max_atlas_side = 16384;
inline constexpr int64_t max_atlas_texels = int64_t{1} << 26;

struct AtlasOptions {
  float texels_per_unit = 0;  // texels along one scene unit; 0: as many as `width` x `height` can hold
  int width = 0, height = 0;  // 0: as large as texels_per_unit needs. One of the two ways must be given
  int padding = 2;            // free texels between charts, beyond those that bilinear look-ups reach, [1, 16]
  bool reuse = true;          // take the scene's second texture coordinates where they serve
};

struct Atlas {
  int width = 0, height = 0;
  std::vector<Vec2> front, back;  // place of each scene vertex, by side, in texels; `back` empty where all is one-sided
  float texels_per_unit = 0;
  uint32_t charts = 0;  // 0: the scene's own coordinates are used
  std::string remark;   // why the scene's own coordinates were not used, or ""
};

// Reuses TEXCOORD_1 if every triangle with an area has its own place there within [0, 1]^2; else cuts the surface into
// charts (charts.h), packs them and splits vertices where charts part. Backs of two-sided triangles get places of their
// own. Splitting changes the scene's vertices, which keep their texture coordinates. Errors: options out of range; an
// atlas too small or too large (says the size needed); cancelled.
Result<Atlas> make_atlas(Scene& scene, const AtlasOptions& options, Progress* progress = nullptr);

// A receiver for every texel whose tent reaches the surface: at its centre, or, for texels partly covered, at the
// surface's point closest to it, moved a hair inwards.
Receivers make_texel_receivers(const Scene& scene, const Atlas& atlas);

// Moves receiver `r` to a point of a triangle's side. `texel`: the length of one in the scene; `diagonal`: of the
// scene's bounds.
void place_texel(const Scene& scene, Receivers& receivers, size_t r, const TexelPlace& place, bool back, float texel,
                 float diagonal);

// Heights-first shelves: rectangles of the given sizes, none wider than `width`, placed without overlap; their corners,
// and the height needed. Time n log n.
struct Packing {
  std::vector<std::array<int, 2>> places;
  int64_t height = 0;
};
Packing pack_shelves(const std::vector<std::array<int, 2>>& sizes, int width);

}  // namespace lambent

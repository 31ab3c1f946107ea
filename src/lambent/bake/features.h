#pragma once
// Transfer as human-reconstruction data sets keep it: a vector a vertex of the mesh as it is, of direct light alone.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <cstdint>
#include <span>
#include <vector>

namespace lambent {

// What features are asked for.
struct FeatureOptions {
  int order = 3;         // bands, [1, 16]
  int samples = 1600;    // rays a vertex, [1, 2^20]
  uint32_t seed = 1;     // of their directions
  float offset = 1e-3f;  // where rays start: along the normal, times the least extent of the mesh's box; (0, 1]
};

// Normals of a mesh's vertices, weighted by the corners' angles (Thürmer and Wüthrich 1998), as trimesh makes them:
// nothing is welded, split or turned. Zero where no triangle with an area is.
std::vector<Vec3> angle_normals(std::span<const Vec3> vertices, std::span<const uint32_t> faces);

// The integral of visibility, the clamped cosine and each harmonic (basis/sh.h): pi times diffuse transfer without
// bounces, [vertex][coefficient]. Every triangle blocks, whichever side it shows. Zero where the normal is. `faces`:
// three vertices each. Errors: as scene_from_arrays(), options out of range, a box without an extent; cancelled.
Result<std::vector<float>> prt_features(std::span<const Vec3> vertices, std::span<const uint32_t> faces,
                                        std::span<const Vec3> normals, const FeatureOptions& options = {},
                                        Progress* progress = nullptr);

}  // namespace lambent

#pragma once
// Chart borders that no eye should find: along an edge that two charts share, their look-ups are made to agree.
#include <lambent/core/progress.h>
#include <lambent/receivers/receivers.h>

namespace lambent {

// Edges between triangles that lie in different places of the atlas though the surface goes on smoothly over them
// (their normals agree to `cosine`). Least squares over the texels that those look-ups touch: sum over points along the
// edges of the squared difference of the two look-ups, plus `keep` times the squared change of every texel; solved by
// conjugate gradients for all columns. values: [receiver][stride], the first `width` of each changed. Returns how many
// texels took part. Left unfinished when cancelled.
size_t smooth_seams(const Scene& scene, const TexelReceivers& texels, float* values, size_t stride, size_t width,
                    float cosine = 0.95f, float keep = 0.05f, Progress* progress = nullptr);

}  // namespace lambent

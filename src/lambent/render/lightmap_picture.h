#pragma once
// Pictures over a lightmap's atlas.
#include <lambent/image/image.h>
#include <lambent/receivers/receivers.h>
#include <lambent/relight/relight.h>

namespace lambent {

// Row `row` of every texel's value. Texels that no surface reaches take the mean of their filled neighbours, ring by
// ring, so many times over, for look-ups that stray (mip-maps); beyond that they are black.
Image lightmap_picture(const TexelReceivers& texels, const Relit& relit, int dilate = 4, int row = 0);

// The same of any values, one a receiver.
Image lightmap_picture(const TexelReceivers& texels, const std::vector<Vec3>& values, int dilate = 4);

// Albedo where each texel receives; and what textures of emission send out there, 0 where a lamp has none.
std::vector<Vec3> texel_albedo(const Scene& scene, const Receivers& receivers);
std::vector<Vec3> texel_emission(const Scene& scene, const Receivers& receivers);

}  // namespace lambent

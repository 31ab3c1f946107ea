#pragma once
// Light cannot be negative, nor can any part of it that is itself light: where the relit sum of a part is, it rings.
#include <lambent/relight/relight.h>

#include <algorithm>

namespace lambent {

// What `whole` would be without ringing; `peaks` is the part of it that comes from peaks (light/peaks.h). Both parts,
// peaks and the rest, are held at 0 or above, so that neither is farther from its truth than before: of all corrections
// the least, and continuous from place to place. Where neither is negative, `whole` to the bit.
inline float dering(float whole, float peaks) {
  const float rest = whole - peaks;
  return std::max(peaks < 0 ? rest : rest < 0 ? peaks : whole, 0.0f);
}
inline Vec3 dering(Vec3 whole, Vec3 peaks) {
  return {dering(whole.x, peaks.x), dering(whole.y, peaks.y), dering(whole.z, peaks.z)};
}

// The same of every number; rows must be of what cannot be negative (diffuse, pixels, Half-Life 2's), as many in each.
inline void dering(Relit& whole, const Relit& peaks) {
  std::transform(whole.values.begin(), whole.values.end(), peaks.values.begin(), whole.values.begin(),
                 [](float w, float p) { return dering(w, p); });
}

}  // namespace lambent

#pragma once
// Named converters from our spherical harmonics (sh.h: radiance, Condon-Shortley sign) to what other systems store. All
// keep the index l(l+1)+m and raw z as the pole, so they only scale and flip coefficients; docs/conventions.md has the
// table.
#include <lambent/core/vec.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Whose coefficients.
enum class ShConvention {
  lambent,   // also Sloan, DirectXMath, Filament radiance, pbrt, Unreal, Babylon: radiance, Condon-Shortley
  three,     // three.js LightProbe: radiance, no Condon-Shortley
  unity,     // Unity SphericalHarmonicsL2, Filament --sh-shader: irradiance x basis constant / pi, no signs; order 3
  godot,     // Godot probes: L / pi, no Condon-Shortley
  gltf_ibl,  // EXT_lights_image_based: irradiance A.L, Condon-Shortley; order 3
};

// "lambent", "three", "unity", "godot" or "gltf-ibl"; also "filament" and "directx", which have ours, and "pifu" and
// "icon", whose environments have three's signs. Nothing for others.
std::optional<ShConvention> parse_sh_convention(const std::string& name);

// Converts n^2 coefficients, n >= 1; conventions of order 3 keep the first 9 (fewer if there are fewer).
std::vector<Vec3> convert_sh(std::span<const Vec3> light, ShConvention to);

// The factor of coefficient i that convert_sh applies; 0 where the convention lacks it. Transfer that is divided by it
// goes with light that is so converted: the sum of their products stays what it was.
double sh_scale(ShConvention to, int i);

// The function mirrored in x or in z (left-handed systems): negates coefficients of odd parity in that axis. Any order.
std::vector<Vec3> mirror_sh_x(std::span<const Vec3> light);
std::vector<Vec3> mirror_sh_z(std::span<const Vec3> light);

}  // namespace lambent

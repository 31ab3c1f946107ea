#pragma once
// Directional lightmaps of harmonics (sh:2, sh:3) as other systems hold them. Both have glTF's axes, so nothing turns.
#include <lambent/transfer/directional.h>

#include <array>
#include <vector>

namespace lambent {

// three.js: coefficients of a LightProbe, 4 or 9, of which its shader makes IRRADIANCE:
//   E(n) = 0.886227 c0 + 2 0.511664 (c1 y + c2 z + c3 x) + 2 0.429043 (c4 xy + c5 yz + c7 xz) + c6 (0.743125 z^2 -
//   0.247708)
//          + 0.429043 c8 (x^2 - y^2).
// Source: three.js, src/renderers/shaders/ShaderChunk/lights_pars_begin.glsl.js, shGetIrradianceAt().
std::vector<Vec3> three_light_probe(DirectionalKind kind, std::span<const Vec3> rows);

// Godot 4.4 and later: the four layers of a texel of a directional lightmap, whose shader makes of them irradiance /
// pi:
//   E(n) / pi = l0 (1 + 4 (m1 y + m2 z + m3 x)),   m = 2 layer - 1.
// Layers 1 to 3 lie in [0, 1], clamped: light from one direction alone gives m up to 1/2. Rows of order 3 lose their
// last band. Source: Godot, servers/rendering/renderer_rd/shaders/forward_clustered/scene_forward_clustered.glsl.
std::array<Vec3, 4> godot_lightmap_layers(DirectionalKind kind, std::span<const Vec3> rows);

// Godot 4.3, whose layers are not packed and may be negative:
//   E(n) / pi = 0.282095 l0 + 0.32573 (l1 y + l2 z + l3 x).
// Source: the same shader, of 4.3.
std::array<Vec3, 4> godot_unpacked_layers(DirectionalKind kind, std::span<const Vec3> rows);

// Unity's directional lightmaps: a colour, irradiance / pi for the receiver's own normal N, and a texel (d / 2 + 1/2,
// w), of which its shader makes
//   E(n) / pi = colour (n . d / 2 + 1/2) / max(w, 1e-4).
// d is what `sh:2` has of luminance, at most of length 1, and w = N . d / 2 + 1/2. Source: DecodeDirectionalLightmap in
// Unity's shader include UnityCG.cginc. Axes are ours.
struct UnityDirection {
  Vec3 direction{0.5f};
  float balance = 0.5f;
};
UnityDirection unity_direction(DirectionalKind kind, std::span<const Vec3> rows, Vec3 normal);

}  // namespace lambent

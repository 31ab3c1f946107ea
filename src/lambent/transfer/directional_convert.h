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

}  // namespace lambent

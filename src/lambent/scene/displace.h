#pragma once
// Relief as geometry: what a transfer texture stands for (local-deformable-prt, section 6), to trace as truth.
#include <lambent/scene/scene.h>

#include <functional>

namespace lambent {

// Moves every vertex along its normal by height(uv * tile) sides of one repetition, uv its texture coordinates of set
// 0. A side is as long there as the texture is stretched: the root of the area of the faces around over what they cover
// of the tiled texture. Vertices in one place move together; normals become those of the moved faces, smooth between
// faces that were smooth. Vertices should lie closer together than the relief changes. Errors: no texture coordinates.
Result<void> displace(Scene& scene, const std::function<float(Vec2)>& height, Vec2 tile);

}  // namespace lambent

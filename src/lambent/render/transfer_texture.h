#pragma once
// Pictures of surfaces that carry a transfer texture: relief that shades itself, on any mesh, deforming or not. The mesh itself casts no
// shadow. Source: local-deformable-prt, section 5.
#include <lambent/render/render.h>
#include <lambent/transfer/zonal_texture.h>

namespace lambent {

// The frame (T, B, N) of texture directions at a point of a triangle: along +u, along -v, and the normal; orthogonal, not always
// right-handed. Triangles without texture coordinates of their own get frame_about(normal).
Mat3 texture_frame(const Scene& scene, const Triangle& triangle, Vec3 normal);

// `tile`: repetitions of the texture over the unit of texture coordinates (set 0). `light`: coefficients of radiance, as many as the
// texture's order asks for. As render() otherwise; parts of the scene without texture coordinates show the texture's first texel.
Result<Image> render_transfer_texture(const Scene& scene, const Tracer& tracer, const ZonalTexture& texture, Vec2 tile, std::span<const Vec3> light,
                                      const Camera& camera, const RenderOptions& options, Progress* progress = nullptr);

}  // namespace lambent

#pragma once
// Pictures of surfaces that carry a transfer texture: relief that shades itself, on any mesh, deforming or not. The
// mesh itself casts no shadow, unless it is known what light arrives at it. Source: local-deformable-prt, section 5.
#include <lambent/receivers/receivers.h>
#include <lambent/relight/arriving.h>
#include <lambent/relight/local_light.h>
#include <lambent/render/render.h>
#include <lambent/transfer/zonal_texture.h>

namespace lambent {

// The frame (T, B, N) of texture directions at a point of a triangle: along +u, along -v, and the normal; orthogonal,
// not always right-handed. Triangles without texture coordinates of their own get frame_about(normal).
Mat3 texture_frame(const Scene& scene, const Triangle& triangle, Vec3 normal);

// The frame of a groove at a point of a triangle, right-handed: across it, along which `tile` . (texture coordinates)
// rises, along it, and the normal.
Mat3 groove_frame(const Scene& scene, const Triangle& triangle, Vec2 tile, Vec3 normal);

// How a texture lies on a surface, over texture coordinates uv of set 0.
struct TextureUse {
  // Repetitions over the unit of uv. Of grooves: they lie side by side across the direction of `tile`, a repetition
  // each: (12, 0) makes 12 over the unit of u, which run along v.
  Vec2 tile{1.0f};
  float groove_width = 1;                 // of a repetition, (0, 1]
  float groove_depth = 1;                 // in widths
  std::function<float(Vec2)> groove_map;  // optional: what the depth is multiplied by, at uv
  // Of a pose (scene/strain.h), in the place of `tile`, [triangle], and of the depth, [vertex]; empty: as they are.
  std::vector<Vec2> pressed_tile{};
  std::vector<float> pressed_depth{};
};

// The light that arrives at a mesh, by receiver, and where those are. `peaks`: what of it comes from the light's peaks,
// by which pixels are kept from ringing (relight/dering.h); null: they are as they are.
struct ArrivingAt {
  const ArrivingLight& light;
  const CornerReceivers& corners;
  const ArrivingLight* peaks = nullptr;
};

// What leaves the relief at a hit; what it is made of must outlive it. Null `arriving`: distant light.
std::function<SurfaceShade()> transfer_texture_shade(const Scene& scene, const ZonalTexture& texture,
                                                     const TextureUse& use, const LocalLight& light,
                                                     RenderOptions::Show show, const ArrivingAt* arriving = nullptr);

// `light` has as many coefficients as the texture's order asks for. As render() otherwise; parts of the scene without
// texture coordinates show the texture's first texel, or its plane. `arriving`, where it is not null, takes the place
// of distant light; sides that receive nothing are black, and near lamps still cast no shadow of the mesh.
Result<Image> render_transfer_texture(const Scene& scene, const Tracer& tracer, const ZonalTexture& texture,
                                      const TextureUse& use, const LocalLight& light, const Camera& camera,
                                      const RenderOptions& options, Progress* progress = nullptr,
                                      const ArrivingAt* arriving = nullptr);

}  // namespace lambent

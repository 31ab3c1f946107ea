#pragma once
// Shading by zonal lobes, each receiver turned by a rotation of its own. Source: local-deformable-prt, section 5.
#include <lambent/relight/local_light.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/zonal_transfer.h>

#include <array>

namespace lambent {

// Rotations of receivers from the pose they were baked in to the one they are drawn in: [block][9][receiver in block],
// column-major.
struct ReceiverFrames {
  size_t receivers = 0;
  AlignedVector<float> values;
};
ReceiverFrames make_receiver_frames(std::span<const Mat3> rotations);
// The same into frames that are there; of as many receivers it allocates nothing.
void set_receiver_frames(ReceiverFrames& out, std::span<const Mat3> rotations);

// T . light for every row: for diffuse transfer exit radiance of white receivers, as relight() gives it for plain
// transfer. `light`: order^2 coefficients of radiance at least. `frames` may be null: as baked. Directly, by equation
// 13: also for light that differs from call to call. Sizes `out` on first use and allocates nothing after that.
void relight_zonal(const ZonalTransfer& transfer, const ReceiverFrames* frames, std::span<const Vec3> light,
                   Relit& out);

// Every receiver under a light of its own, of at least as many bands.
void relight_zonal(const ZonalTransfer& transfer, const ReceiverFrames* frames, const LightField& light, Relit& out);

// The same for one row of a receiver, given its values, turned by R: for light that varies from place to place, and for
// textures.
Vec3 shade_zonal(const ZonalTransfer& transfer, std::span<const float> values, const Mat3& R,
                 std::span<const Vec3> light);

// One light for many receivers: a table of the light's bands by direction (eq. 24), [row][column][4 bands at a time][r,
// g, b, 0][4]. Rows go from pole to pole, both included; columns once around, the first repeated at the end.
struct ZonalLight {
  static constexpr int width = 64, height = 32;
  int order = 0, exact_bands = 0;
  std::array<Vec3, 4> exact{};  // the light's first coefficients
  AlignedVector<float> texels;
  AlignedVector<float> rows;  // scratch
  int quads() const { return (order - exact_bands + 3) / 4; }
};
// Rebuilds the table; cheap enough for every frame.
void specialise_light(const ZonalTransfer& transfer, std::span<const Vec3> light, ZonalLight& out);

// As above through the table, interpolated bilinearly (eq. 25). The light must have been specialised for a transfer of
// the same order and lobes.
void relight_zonal(const ZonalTransfer& transfer, const ReceiverFrames* frames, const ZonalLight& light, Relit& out);

}  // namespace lambent

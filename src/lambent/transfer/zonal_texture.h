#pragma once
// Transfer as a texture of zonal lobes, for any surface that it is mapped onto. Source: local-deformable-prt, sections
// 5 and 6.
//
// Or as a table of grooves (section 4.2, wrinkle model): columns are places across, evenly from border to border, rows
// depths, evenly from 0.
//
// Receivers are texels, row by row from the first (v = 0); directions are in the frame (T, B, N): along +u, along -v,
// and outward. A texel (i, j) of a W x H texture is centred at u = (i + 1/2) / W, v = (j + 1/2) / H; textures repeat.
#include <lambent/core/file.h>
#include <lambent/transfer/zonal_transfer.h>

namespace lambent {

inline constexpr int max_zonal_texture_size = 4096;
inline constexpr int max_texture_views = 32;

struct ZonalTexture {
  int width = 0, height = 0;
  ZonalTransfer transfer;  // width * height receivers
  float groove_depth =
      0;  // 0: a texture; above: a table of grooves, this deep in its last row, in widths of the groove, up to 10
  // 0: the same from everywhere; else rows are of views x views directions that it is seen from, the nodes of a view
  // map (outgoing.h) in the same frame.
  int views = 0;
};

// A file of its own (.lpt): 64 bytes of header, "LMBTLPT1" and ten little-endian u32 (width, height, order, lobes,
// channels, precision: 2 or 4 bytes, 1 for grooves, their depth as a float, and zeros), then the transfer's values as
// in memory (zonal_transfer.h). Seen from views it is "LMBTLPT2", and the ninth number is how many a side.
Result<void> save_zonal_texture(const std::string& path, const ZonalTexture& texture);
// Read in place. Errors: not such a file, another version, sizes out of range, any length that does not fit.
Result<ZonalTexture> load_zonal_texture(const std::string& path);
Result<ZonalTexture> load_zonal_texture(const MappedFile& file, const std::string& path);

// Values for a point of the texture: bands that are stored as they are interpolated bilinearly, lobes from the nearest
// texel (two lobes' mean means nothing). `values` has row_values() numbers, those of one row.
void sample_zonal_texture(const ZonalTexture& texture, Vec2 uv, std::span<float> values, size_t row = 0);

// Values at x in [-1/2, 1/2] across a groove of that depth, from a table of them: bilinear in all numbers, since lobes
// correspond there; axes are brought back to length 1. Beyond the groove it is the plane, deeper than the table its
// deepest.
void sample_groove(const ZonalTexture& table, float x, float depth, std::span<float> values);

}  // namespace lambent

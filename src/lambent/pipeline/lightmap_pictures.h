#pragma once
// Pictures of a lightmap: what engines load, and what viewers without our extension show.
#include <lambent/bake/lightmap.h>
#include <lambent/baked/baked_file.h>
#include <lambent/image/image.h>

#include <optional>
#include <utility>

namespace lambent {

// Of a lightmap over texels with lamps, every row of every group (`each`) or of all together: (".lamp_1.2.exr",
// picture). With direct light apart, that and the rest, which is indirect. Empty where there are no texels or no lamps.
std::vector<std::pair<std::string, Image>> lightmap_pictures(const Lightmap& map, const Receivers& receivers,
                                                             bool each);

// The names alone, of lamps of these groups.
std::vector<std::string> lightmap_picture_names(const std::vector<std::string>& groups, DirectionalKind kind, bool each,
                                                bool direct_apart);

// What leaves every texel with all lamps on, fit for eight bits: values beyond the brightest thousandth are clamped to
// it. Nothing where there are no texels or no lamps.
Result<std::optional<ViewerLook>> lightmap_look(const Lightmap& map, const Scene& scene, const Receivers& receivers,
                                                DirectionalKind kind);

// Irradiance of every receiver for MOZ_lightmap, in as many bits, clamped alike.
Result<ViewerLook> irradiance_look(const TexelReceivers& texels, std::vector<Vec3> irradiance);
// Of a picture, texel by texel.
Result<ViewerPicture> irradiance_picture(Image irradiance);

}  // namespace lambent

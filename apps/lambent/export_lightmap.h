#pragma once
// Lightmaps as other systems take them: pictures over the atlas, of each light group; distant light stays out.
#include "commands.h"

#include <string>

namespace lambent::tool {

// three.js: PREFIX.exr, irradiance for `lightMap`; of harmonics, PREFIX.0.exr ... the coefficients of a LightProbe a
// texel; and PREFIX.three.glb, the scene with all groups together as MOZ_lightmap, of irradiance alone. Godot:
// PREFIX.0.exr ... PREFIX.3.exr, the layers of a directional lightmap; of one row, PREFIX.exr, irradiance / pi. With
// several light groups, PREFIX.GROUP....
enum class LightmapTarget { three, godot };
int export_lightmap(Context& context, const std::string& baked, LightmapTarget target, const std::string& prefix);

}  // namespace lambent::tool

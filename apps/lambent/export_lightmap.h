#pragma once
// Lightmaps as other systems take them: pictures over the atlas, of each light group; distant light stays out, but for
// sky columns.
#include "commands.h"
#include "options.h"

#include <string>

namespace lambent::tool {

// three.js: PREFIX.exr, irradiance for `lightMap`; of harmonics, PREFIX.0.exr ... the coefficients of a LightProbe a
// texel; and PREFIX.three.glb, the scene with all groups together as MOZ_lightmap, of irradiance alone; moz is that
// file alone, PREFIX being its whole name. Godot: PREFIX.0.exr ... PREFIX.3.exr, the layers of a directional lightmap;
// of one row, PREFIX.exr, irradiance / pi; and what Godot loads, export_godot.cpp. Unity: PREFIX.color.exr and, of
// harmonics, PREFIX.direction.exr, and what its script reads, export_unity.cpp. With several light groups,
// PREFIX.GROUP...., and Godot's and Unity's own files are of all of them together.
enum class LightmapTarget { three, moz, godot, unity };

struct LightmapExport {
  std::string baked, prefix;
  LightmapTarget target = LightmapTarget::three;
  bool per_object = false;   // an atlas an object: PREFIX....OBJECT.exr
  bool sky_columns = false;  // a picture for each harmonic of distant light: PREFIX.sky.K.exr
  std::string probes;        // a file that was baked with --lattice
  LightOptions light;        // of the probes and of the sky's coefficients
  std::string godot_version = "4.4";
};
int export_lightmap(Context& context, const LightmapExport& o);

}  // namespace lambent::tool

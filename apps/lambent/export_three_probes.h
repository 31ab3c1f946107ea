#pragma once
#include "lightmap_writer.h"

namespace lambent::tool {

// What three.js's LightProbeGrid keeps of a lattice (three r187, examples/jsm/lighting/LightProbeGrid.js): RGBA half
// floats, points across and down, seven groups of slices below one another. Slice t (nz + 2) + 1 + z has numbers
// 4t .. 4t + 3 of 27 of the points at z, the first and the last of a group twice.
std::vector<uint16_t> three_probe_atlas(const Probes& probes);

// PREFIX.probes.json, PREFIX.probes.bin and lambent_probes.js, which reads them: the light of a file that was baked
// with
// --lattice, under one environment. Errors: the file's, the environment's; a usage error without one.
int export_three_probes(Context& context, const std::string& baked, const std::string& prefix,
                        const LightOptions& light);

}  // namespace lambent::tool

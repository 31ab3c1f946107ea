#pragma once
// Thin surfaces that let light pass straight on, from either side alike: no refraction, no thickness. Of the light that
// meets a point
//
//     transmittance = (1 - a) + a t C
//
// goes on, a being what is covered (glTF's alpha: BLEND a share, MASK 0 or 1), t the transmission of the covered part
// and C its base colour. The covered part reflects albedo() = (1 - t) C and glows as any surface, both times a.
// Source: glTF 2.0, section 3.9.4; KHR_materials_transmission (a metal, being none of the dielectric, passes nothing).
#include <lambent/scene/scene.h>

namespace lambent {

// Share of a point that is covered, [0, 1].
float coverage(const Scene& scene, const Triangle& triangle, float u, float v);
// Of the light that meets the covered part, the share that is not reflected but passes, [0, 1], before it is coloured.
float transmission(const Scene& scene, const Triangle& triangle, float u, float v);
// Of the light that meets a point, the share that passes, [0, 1].
Vec3 transmittance(const Scene& scene, const Triangle& triangle, float u, float v);

// Whether some point of a material may let light pass; false for what is marked with an alpha mode and yet solid.
bool is_see_through(const Scene& scene, const Material& material);
// The same of each of the scene's materials; empty where none does.
std::vector<uint8_t> see_through_materials(const Scene& scene);

}  // namespace lambent

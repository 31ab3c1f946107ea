#pragma once
// Putting one scene into another, to draw them together.
#include <lambent/scene/scene.h>

namespace lambent {

// Moves and scales the scene (scale > 0) so that the middle of the bottom of its box comes to lie at `foot`.
void place_scene(Scene& scene, Vec3 foot, float scale);

// Appends b's vertices, triangles, parts, materials and textures to `a`, after its own, as parts of no document.
// Vertices without colours become white, without texture coordinates (0, 0), where the other scene has any. Textures of
// a glTF input may come without their encoded bytes, so the result is to be traced and drawn, not saved.
void append_scene(Scene& a, const Scene& b);

}  // namespace lambent

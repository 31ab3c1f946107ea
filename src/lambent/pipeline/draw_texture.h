#pragma once
#include <lambent/pipeline/draw.h>

namespace lambent {

// draw() with a transfer texture: any scene, moving or not, baked or not.
Result<Drawing> draw_texture(const DrawRequest& request, const Job& job);

}  // namespace lambent

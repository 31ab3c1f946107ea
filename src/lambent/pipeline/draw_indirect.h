#pragma once
// Drawing direct-to-indirect transport: lamps of the request light the scene, sharply at the pixel; what they send on
// is read there from surfels.
#include <lambent/pipeline/draw.h>

namespace lambent {

// draw() of such a file.
Result<Drawing> draw_indirect(const Baked& baked, const DrawRequest& request, const Job& job);

}  // namespace lambent

#pragma once
// Drawing a baked scene with rigid objects that move over it (--place, --move): relight/moving.h behind draw().
#include <lambent/pipeline/draw.h>

namespace lambent {

Result<Drawing> draw_moving(const Baked& baked, const DrawRequest& request, const Job& job);

}  // namespace lambent

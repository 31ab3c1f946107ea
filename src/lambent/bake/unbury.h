#pragma once
// Texels inside geometry: where a box stands on a floor, some of the floor's texels lie in the box, and yet their tents
// reach what is seen beside it. What they should hold is the light beside the box, not darkness and not a guess from
// further away.
#include <lambent/receivers/atlas.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// Moves every texel whose sample point is buried (most rays meet backs of one-sided surfaces) to the nearest point
// within its tent, one texel either way, from which they do not. Texels with no such point stay, and are filled from
// their neighbours after the bake (make_fill_steps); nothing that is seen looks at them. Returns how many moved.
// Left unfinished when cancelled.
size_t move_buried_texels(const Scene& scene, const Tracer& tracer, const Atlas& atlas, Receivers& receivers,
                          Progress* progress = nullptr);

}  // namespace lambent

#pragma once
// Scenes in a shell: a sky dome or a backdrop, modelled and closed, that no distant light comes through.
#include <lambent/receivers/receivers.h>
#include <lambent/trace/tracer.h>

namespace lambent {

struct Enclosure {
  std::vector<uint32_t> parts;  // around everything, most often met first; empty: there is none
  bool has_outside = false;     // its own receivers see the environment, from outside, and no other does
};

// Looks for a way out of the scene from every receiver (64 directions, cosine-distributed). Where no receiver has one,
// what the ways outwards meet last; where those of one part alone have, that part, if its box holds all others. A few
// receivers tell as a rule that there is nothing of the kind.
// Empty when cancelled.
Enclosure find_enclosure(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                         Progress* progress = nullptr);

}  // namespace lambent

#pragma once
// The rays of one fan, in pieces between which the wish to stop is looked at, so that it never waits for a fan to end
// however many rays that has. What would have come of the pieces left out keeps the values that it had.
#include <lambent/core/progress.h>
#include <lambent/trace/tracer.h>

#include <algorithm>
#include <span>

namespace lambent {

// Rays a piece: tens of milliseconds where each goes through tens of coloured surfaces.
constexpr size_t fan_piece = 4096;

// Whether what is done for each ray of a fan should end before the ray with this number; asked once a piece.
inline bool ends_fan(size_t ray, const Progress* progress) { return ray % fan_piece == 0 && is_cancelled(progress); }

// part(first, directions) for each piece, until cancelled.
template <class Part>
void in_pieces(const Directions& d, const Progress* progress, const Part& part) {
  for (size_t first = 0; first < d.count && !is_cancelled(progress); first += fan_piece)
    part(first, Directions{d.x + first, d.y + first, d.z + first, std::min(fan_piece, d.count - first)});
}

// Closest hits; no passages where all that is met is solid.
inline void trace_hits(const Tracer& tracer, Vec3 origin, const Directions& directions, Hit* hits,
                       std::span<Passage> passages, const Progress* progress) {
  in_pieces(directions, progress, [&](size_t first, const Directions& d) {
    if (!passages.empty()) tracer.closest_fan(origin, d, hits + first, passages.data() + first);
    else tracer.closest_fan(origin, d, hits + first);
  });
}

// What arrives from beyond the scene, of one channel or three; a channel is whatever has data().
template <class Channel>
void trace_visible(const Tracer& tracer, Vec3 origin, const Directions& directions, std::span<Channel> visible,
                   const Progress* progress) {
  in_pieces(directions, progress, [&](size_t first, const Directions& d) {
    auto at = [&](size_t channel) { return visible[channel].data() + first; };
    if (visible.size() == 3) tracer.visible_fan(origin, d, {at(0), at(1), at(2)});
    else tracer.visible_fan(origin, d, at(0));
  });
}

}  // namespace lambent

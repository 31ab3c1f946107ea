#pragma once
// Receivers of a diffuse bake that stand for others, some of them (thin.h) or surfels (meshless.h): they alone are
// traced and bounce light, and all have rows.
#include <lambent/bake/bake.h>
#include <lambent/bake/thin.h>

#include <span>

namespace lambent {

// Which of a bake's receivers are traced.
struct StandIns {
  Thinned thinned;
  Receivers own;    // those that are traced, as receivers of their own; empty where all are
  size_t rays = 0;  // that choosing them took
  bool all() const { return own.count() == 0; }
};

// Surfels where the options say so. Else by direct transfer in up to 4 bands, of the options' light, to a part of the
// options' error. With lobes, whose shadows harmonics do not tell of, and with fewer than twice options.thin receivers,
// all are traced. Errors: those of make_point_receivers(); cancelled.
Result<StandIns> choose_stand_ins(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                  const BakeOptions& options, Progress* progress = nullptr);

// All receivers' transfer from rows of those that are traced: rows is [traced][width], [column][channel] within.
// buried, of the traced, 1: tells nothing. guide: rows as Spread's, of `width` too.
Transfer spread_transfer(const Receivers& receivers, const StandIns& stand_ins, std::span<const uint8_t> buried,
                         const float* guide, const float* rows, size_t width, int channels, const BakeOptions& options);

}  // namespace lambent

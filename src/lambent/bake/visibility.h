#pragma once
// Scene -> Visibility: what each receiver sees, by one ray a texel of its hemisphere. Source:
// locally-adaptive-products, section 4.2.
#include <lambent/core/progress.h>
#include <lambent/receivers/receivers.h>
#include <lambent/trace/tracer.h>
#include <lambent/transfer/visibility.h>

namespace lambent {

// What a bake of visibility is asked for.
struct VisibilityOptions {
  int size = 64;  // of the cube
  // 1: binary. More: the share of a texel that is seen, in 2^bits levels, from one ray at the centre and, where a
  // texel's neighbours disagree with it, 8 x 8 in place of that one. Surfaces that let light pass count as seen by
  // their share, grey, rounded to a level.
  int bits = 1;
  size_t memory = size_t{4} << 30;  // bytes that the result may take, by an estimate made before it starts
  // The tracer's scene: with it, rays in directions where it certainly has nothing are not traced; the result is the
  // same. Null: all are.
  const Scene* scene = nullptr;
};

// What it says of itself.
struct VisibilityReport {
  size_t rays = 0, certain = 0, bytes = 0;  // certain: of the rays, those that were not traced
  double seconds = 0;
};

// Bytes that so many receivers are expected to take, from what scenes full of small shadows do.
size_t expected_visibility_bytes(size_t receivers, const VisibilityOptions& options);

// Errors: too large for memory, said before the first ray; cancelled. The uncompressed visibility of one receiver a
// thread is in memory.
Result<Visibility> bake_visibility(const Tracer& tracer, const Receivers& receivers, const VisibilityOptions& options,
                                   VisibilityReport* report = nullptr, Progress* progress = nullptr);

}  // namespace lambent

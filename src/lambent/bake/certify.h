#pragma once
// What is wrong with a field of transfer, measured on rays and at places that made no part of it.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/scene.h>

#include <functional>
#include <vector>

namespace lambent {

// The row that rays of their own give a receiver anywhere; `key` chooses them. False: that place lies inside something.
// From any thread.
using GatherAt = std::function<bool(Vec3 origin, Vec3 normal, uint64_t key, float* row)>;

// The field's row at one of its receivers. From any thread.
using FieldRow = std::function<void(uint32_t receiver, float* row)>;

// What was measured.
struct Certificate {
  // Relative RMS error of the field over all surfaces, by area: sqrt(mean |field - truth|^2 / mean |truth|^2). Noise
  // and what interpolation between receivers loses are both in it. Negative: not measured.
  double error = -1;
  double uncertain = 0;  // standard error of that
  double noise = -1;     // the same of one of its gathers: what as many rays leave before anything is denoised
  std::vector<double>
      parts;          // the same by part of the scene, relative to that part's own rows; negative: too few places
  size_t places = 0;  // that it was measured at
};

// `rows`: [receiver][width], the field's. Places are drawn evenly by area over all sides that receive, two gathers at
// each: with independent gathers a and b of a truth t, the mean of (a - s) . (b - s) is |s - t|^2, whatever their
// noise. Errors: cancelled.
Result<Certificate> certify(const Scene& scene, const Receivers& receivers, const float* rows, size_t width,
                            const GatherAt& gather, size_t places, uint32_t seed, Progress* progress = nullptr);

}  // namespace lambent

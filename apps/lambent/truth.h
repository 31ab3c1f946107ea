#pragma once
#include <lambent/image/compare.h>
#include <lambent/reference/path_tracer.h>

namespace lambent::tool {

// The mean of two independent pictures of half the paths each. Their distance from each other is twice the mean's
// distance from the truth, 6 dB, so it tells the noise: PSNR of the mean against what it tends to.
struct Truth {
  Image image;
  double noise_psnr = 0;
};
Result<Truth> trace_truth(const Scene& scene, const Environment& env, const Camera& camera, ReferenceOptions options,
                          const Display& display, Progress& progress);

}  // namespace lambent::tool

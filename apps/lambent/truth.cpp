#include "truth.h"

#include <cmath>

namespace lambent::tool {

Result<Truth> trace_truth(const Scene& scene, const Environment& env, const Camera& camera, ReferenceOptions options,
                          const Display& display, Progress& progress) {
  options.spp = std::max(1, options.spp / 2);
  auto a = path_trace(scene, env, camera, options, &progress);
  if (!a) return a.error();
  options.seed += 1;
  auto b = path_trace(scene, env, camera, options, &progress);
  if (!b) return b.error();
  auto apart = compare_images(a->image, b->image, display);
  if (!apart) return apart.error();
  return Truth{mean_of(std::move(a->image), b->image), apart->psnr + 20 * std::log10(2.0)};
}

}  // namespace lambent::tool

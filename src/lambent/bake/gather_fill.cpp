// What becomes of gathered rows: those inside something are filled, means become coefficients (receivers/project.h).
#include <lambent/bake/gather.h>
#include <lambent/core/random.h>
#include <lambent/core/ranks.h>

#include <algorithm>

namespace lambent {

std::optional<LeastSquares> least_squares_of(const Scene& scene, const Receivers& receivers, Projection projection,
                                             int samples, uint32_t seed) {
  if (projection == Projection::collocation) return std::nullopt;
  constexpr int least_place_rays = 4;
  const int places = std::clamp(samples / least_place_rays, 1, int(most_places));
  return make_least_squares(scene, receivers, size_t(places), uint32_t(hash64(seed, 0x1e57)));
}

Result<void> check_projection_ranks() {
  if (this_ranks().count() == 1) return {};
  return Error{"projection", "least squares are solved by one process: bake with one rank"};
}

std::vector<FillStep> make_fill_steps(const Scene& scene, const SpatialBasis& basis,
                                      const std::vector<uint8_t>& buried) {
  const auto edges = neighbours_of(scene, basis, buried);  // (buried receiver, neighbour)
  std::vector<FillStep> steps;
  std::vector<uint8_t> waiting = buried;
  for (bool grew = true; grew;) {  // layer by layer from the receivers that are clear
    grew = false;
    const size_t layer = steps.size();
    for (size_t begin = 0; begin < edges.size();) {
      size_t end = begin;
      const uint32_t r = edges[begin].first;
      FillStep step{r, {}};
      for (; end < edges.size() && edges[end].first == r; ++end)
        if (!waiting[edges[end].second]) step.sources.push_back(edges[end].second);
      if (waiting[r] && !step.sources.empty()) steps.push_back(std::move(step)), grew = true;
      begin = end;
    }
    for (size_t i = layer; i < steps.size(); ++i) waiting[steps[i].receiver] = 0;
  }
  return steps;
}

void fill_buried(const std::vector<FillStep>& steps, float* values, size_t stride, size_t width) {
  for (const FillStep& step : steps) {
    float* out = values + size_t(step.receiver) * stride;
    std::fill(out, out + width, 0.0f);
    for (uint32_t s : step.sources)
      for (size_t j = 0; j < width; ++j) out[j] += values[size_t(s) * stride + j] / float(step.sources.size());
  }
}

}  // namespace lambent

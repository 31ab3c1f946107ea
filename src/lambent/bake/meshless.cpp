#include <lambent/bake/meshless.h>

#include <lambent/core/parallel.h>

#include <algorithm>

namespace lambent {

ReadKernels read_kernels(const Scene& scene, const SurfelSearch& search, const Receivers& receivers) {
  ReadKernels out;
  out.kernels.resize(receivers.count());
  parallel_for(receivers.count(), 64, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) out.kernels[r] = search.kernels({receivers.origins[r], receivers.normals[r]});
  });
  std::vector<uint8_t> unread(receivers.count());
  for (size_t r = 0; r < unread.size(); ++r) unread[r] = out.kernels[r].count == 0;
  const auto pairs = neighbours_of(scene, receivers.basis, unread);
  out.buried = out.unread = size_t(std::count(unread.begin(), unread.end(), uint8_t(1)));
  for (std::vector<std::pair<uint32_t, uint32_t>> step{{}}; !step.empty();) {
    step.clear();
    for (const auto& [r, neighbour] : pairs)
      if (unread[r] && !unread[neighbour] && (step.empty() || step.back().first != r)) step.emplace_back(r, neighbour);
    for (const auto& [r, neighbour] : step) out.kernels[r] = out.kernels[neighbour], unread[r] = 0, --out.unread;
  }
  return out;
}

Result<Receivers> make_point_receivers(const Scene& scene, const Tracer& tracer, const Receivers& vertices,
                                       size_t count, uint32_t seed, Progress* progress) {
  auto surfels = make_surfels(scene, tracer, {count, seed}, progress);
  if (!surfels) return surfels.error();
  const Surfels& s = *surfels;
  const SurfelSearch search(s, tracer, uint32_t(s.levels() - 1));
  const ReadKernels read = read_kernels(scene, search, vertices);
  PointReceivers points;
  points.corners = std::get<CornerReceivers>(vertices.basis);
  for (const Kernels& k : read.kernels) {
    points.points.insert(points.points.end(), k.surfel.begin(), k.surfel.begin() + ptrdiff_t(k.count));
    points.weights.insert(points.weights.end(), k.weight.begin(), k.weight.begin() + ptrdiff_t(k.count));
    points.first.push_back(uint32_t(points.points.size()));
  }
  Receivers out;
  const float diagonal = bounds(scene).diagonal();
  for (size_t i = 0; i < s.count(); ++i)
    out.origins.push_back(s.positions[i] + s.normals[i] * receiver_lift(s.positions[i], s.spacings.back(), diagonal));
  out.normals = std::move(surfels->normals), out.basis = std::move(points);
  return out;
}

}  // namespace lambent

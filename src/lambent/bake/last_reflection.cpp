// Follows: general-prt, "Final reflection"; local-deformable-prt, eq. 14-15 (rows by singular values).
#include <lambent/bake/last_reflection.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <functional>

namespace lambent {

namespace {

// Calls f(material) on all cores, as a stage. Errors: cancelled.
Result<void> each_material(size_t count, Progress* progress, const std::function<void(size_t)>& f) {
  ProgressStage stage(progress, "last reflection", count);
  parallel_for(count, 1, [&](size_t m, size_t) {
    if (stage.cancelled()) return;
    f(m);
    stage.advance();
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return {};
}

void keep_maps(LastReflection& last, const std::vector<ViewMap>& responses, size_t J) {
  last.outgoing.maps = responses;
  std::vector<float> identity(J * J, 0.0f);
  for (size_t j = 0; j < J; ++j) identity[j * J + j] = 1;
  for (auto& h : last.h) h = {identity, identity, identity};
}

Result<void> keep_factors(LastReflection& last, const std::vector<ViewMap>& responses, int svd_rows, size_t J,
                          Progress* progress) {
  std::vector<FactoredResponse> factors(responses.size());
  auto ok = each_material(responses.size(), progress,
                          [&](size_t m) { factors[m] = factor_response(responses[m], svd_rows, 1e-4); });
  if (!ok) return ok;
  size_t rows = 1;
  for (const FactoredResponse& f : factors) rows = std::max(rows, size_t(f.rows));
  for (size_t m = 0; m < factors.size(); ++m) {  // every receiver has as many rows; the rest are zero
    FactoredResponse& f = factors[m];
    const size_t nodes = size_t(f.g.grid) * size_t(f.g.grid);
    ViewMap wide{f.g.grid, int(rows), std::vector<ViewWeights>(nodes * rows, ViewWeights(0.0f))};
    for (size_t i = 0; i < nodes; ++i)
      std::copy_n(f.g.values.begin() + ptrdiff_t(i * size_t(f.rows)), f.rows,
                  wide.values.begin() + ptrdiff_t(i * rows));
    last.outgoing.maps.push_back(std::move(wide));
    f.h.resize(rows * J, 0.0f);
    last.h[m] = {f.h, f.h, f.h};
  }
  return {};
}

void keep_phong(LastReflection& last, const ReceiverMaterials& materials, const CosineBasis& basis, size_t J) {
  last.outgoing.has_b = false;
  for (size_t m = 0; m < materials.materials.size(); ++m)
    for (size_t c = 0; c < 3; ++c) {
      last.h[m][c] = convolve_phong(materials.materials[m], basis, int(c));
      const auto b = last.h[m][c].end() - ptrdiff_t(J);
      last.outgoing.has_b |= std::any_of(b, last.h[m][c].end(), [](float x) { return x != 0; });
      if (last.h[m][c] != last.h[m][0]) last.channels = 3;
    }
}

Result<void> keep_projections(LastReflection& last, const std::vector<ViewMap>& responses, Progress* progress) {
  Outgoing& o = last.outgoing;
  std::vector<std::array<std::vector<float>, 4>> parts(responses.size());
  auto ok = each_material(responses.size(), progress,
                          [&](size_t m) { parts[m] = project_response(responses[m], o.kind, o.order, o.lobes); });
  if (!ok) return ok;
  bool coloured = false;
  o.has_b = false;
  for (const ViewMap& response : responses)
    for (const ViewWeights& w : response.values) coloured |= w.x != w.y || w.y != w.z, o.has_b |= w.w != 0;
  if (coloured) last.channels = 3;
  for (size_t m = 0; m < parts.size(); ++m)
    for (size_t c = 0; c < 3; ++c) {
      last.h[m][c] = parts[m][c];
      if (o.has_b) last.h[m][c].insert(last.h[m][c].end(), parts[m][3].begin(), parts[m][3].end());
    }
  return {};
}

}  // namespace

Result<LastReflection> make_last_reflection(const std::vector<ViewMap>& responses, const ReceiverMaterials& materials,
                                            const MatrixOptions& matrix, const CosineBasis& basis, int channels,
                                            Progress* progress) {
  const size_t J = size_t(basis.count());
  LastReflection last;
  Outgoing& o = last.outgoing;
  o.kind = matrix.outgoing, o.frames = materials.frames, o.order = matrix.incident_order;
  last.channels = channels;
  last.h.resize(materials.materials.size());
  if (o.kind == OutgoingKind::map || o.kind == OutgoingKind::svd) o.map_of = materials.of_receiver;
  Result<void> ok;
  switch (o.kind) {
    case OutgoingKind::map: keep_maps(last, responses, J); break;
    case OutgoingKind::svd: ok = keep_factors(last, responses, matrix.svd_rows, J, progress); break;
    case OutgoingKind::phong: keep_phong(last, materials, basis, J); break;
    case OutgoingKind::directional:
      o.lobes = outgoing_lobes(matrix.outgoing_lobes);
      ok = keep_projections(last, responses, progress);
      break;
    default: o.order = matrix.outgoing_order; ok = keep_projections(last, responses, progress);
  }
  if (!ok) return ok.error();
  last.rows = o.rows();
  return last;
}

void store_rows(const LastReflection& last, const ReceiverMaterials& materials, const WritableTransfer& out, size_t r,
                const float* x, size_t channels, size_t width) {
  const size_t C = out.transfer.columns(), J = last.h[materials.of_receiver[r]][0].size() / size_t(last.rows);
  std::vector<float> values(size_t(last.rows) * size_t(last.channels) * C);
  for (size_t row = 0; row < size_t(last.rows); ++row)
    for (size_t c = 0; c < size_t(last.channels); ++c) {
      const float* h = last.h[materials.of_receiver[r]][c].data() + row * J;
      float* v = values.data() + (row * size_t(last.channels) + c) * C;
      for (size_t j = 0; j < J; ++j) {
        const float* xj = x + (j * channels + std::min(c, channels - 1)) * width;
        if (h[j] != 0)
          for (size_t k = 0; k < C; ++k) v[k] += h[j] * xj[k];
      }
    }
  store_receiver(out, r, values);
}

}  // namespace lambent

// Follows: general-prt, "Final reflection"; local-deformable-prt, eq. 14-15 (rows by singular values).
#include <lambent/bake/last_reflection.h>

#include <algorithm>

namespace lambent {

LastReflection make_last_reflection(const std::vector<ViewMap>& responses, const ReceiverMaterials& materials,
                                    const MatrixOptions& matrix, const CosineBasis& basis, int channels) {
  const size_t J = size_t(basis.count());
  LastReflection last;
  Outgoing& o = last.outgoing;
  o.kind = matrix.outgoing;
  o.frames = materials.frames;
  last.channels = channels;
  last.h.resize(materials.materials.size());
  if (o.kind == OutgoingKind::map) {
    o.order = matrix.incident_order, o.maps = responses, o.map_of = materials.of_receiver;
    std::vector<float> identity(J * J, 0.0f);
    for (size_t j = 0; j < J; ++j) identity[j * J + j] = 1;
    for (auto& h : last.h) h = {identity, identity, identity};
  } else if (o.kind == OutgoingKind::svd) {
    o.order = matrix.incident_order, o.map_of = materials.of_receiver;
    std::vector<FactoredResponse> factors;
    size_t rows = 1;
    for (const ViewMap& response : responses)
      factors.push_back(factor_response(response, matrix.svd_rows, 1e-4)),
          rows = std::max(rows, size_t(factors.back().rows));
    for (size_t m = 0; m < factors.size(); ++m) {  // every receiver has as many rows; the rest are zero
      FactoredResponse& f = factors[m];
      ViewMap wide{f.g.grid, int(rows),
                   std::vector<ViewWeights>(size_t(f.g.grid) * size_t(f.g.grid) * rows, ViewWeights(0.0f))};
      for (size_t i = 0; i < size_t(f.g.grid) * size_t(f.g.grid); ++i)
        std::copy_n(f.g.values.begin() + ptrdiff_t(i * size_t(f.rows)), f.rows,
                    wide.values.begin() + ptrdiff_t(i * rows));
      o.maps.push_back(std::move(wide));
      f.h.resize(rows * J, 0.0f);
      last.h[m] = {f.h, f.h, f.h};
    }
  } else if (o.kind == OutgoingKind::phong) {
    o.order = matrix.incident_order, o.has_b = false;
    for (size_t m = 0; m < materials.materials.size(); ++m)
      for (size_t c = 0; c < 3; ++c) {
        last.h[m][c] = convolve_phong(materials.materials[m], basis, int(c));
        const auto b = last.h[m][c].end() - ptrdiff_t(J);
        o.has_b |= std::any_of(b, last.h[m][c].end(), [](float x) { return x != 0; });
        if (last.h[m][c] != last.h[m][0]) last.channels = 3;
      }
  } else {
    o.order = matrix.outgoing_order;
    std::vector<std::array<std::vector<float>, 4>> parts;
    bool coloured = false;
    o.has_b = false;
    for (const ViewMap& response : responses) {
      parts.push_back(project_response(response, o.kind, o.order));
      for (const ViewWeights& w : response.values) coloured |= w.x != w.y || w.y != w.z, o.has_b |= w.w != 0;
    }
    if (coloured) last.channels = 3;
    for (size_t m = 0; m < parts.size(); ++m)
      for (size_t c = 0; c < 3; ++c) {
        last.h[m][c] = parts[m][c];
        if (o.has_b) last.h[m][c].insert(last.h[m][c].end(), parts[m][3].begin(), parts[m][3].end());
      }
  }
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

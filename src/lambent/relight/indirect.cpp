#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/indirect.h>

#include <algorithm>

namespace lambent {
namespace {

constexpr size_t rows_a_piece = 64, leaves_a_piece = 2048, receivers_a_piece = 1024;  // the last a multiple of blocks

}  // namespace

IndirectSolve make_indirect_solve(const IndirectTransfer& t, std::span<const Vec3> albedos) {
  IndirectSolve s;
  const Surfels& f = t.surfels;
  s.albedos = f.albedos;
  if (!albedos.empty()) s.albedos.assign(albedos.begin(), albedos.end());
  s.ancestor.resize(f.count());
  for (uint32_t i = 0; i < f.count(); ++i) {
    uint32_t at = i;
    for (size_t l = f.levels() - 1; l > t.gather_level; --l) at = f.parents[f.first_parent(l) + at];
    s.ancestor[i] = at;
  }
  s.node_areas.assign(f.nodes(), 0.0f), s.nodes.resize(f.nodes());
  std::copy(f.areas.begin(), f.areas.end(), s.node_areas.begin() + ptrdiff_t(f.first_node(f.levels() - 1)));
  for (size_t l = f.levels(); l-- > 1;)
    for (size_t i = 0; i < f.counts[l]; ++i)
      s.node_areas[f.first_node(l - 1) + f.parents[f.first_parent(l) + i]] += s.node_areas[f.first_node(l) + i];
  s.x.resize(t.gathering()), s.next.resize(t.gathering());
  return s;
}

void gather_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> leaves, std::span<Vec3> y) {
  const Surfels& f = t.surfels;
  const size_t last = f.levels() - 1;
  Vec3* at_leaves = s.nodes.data() + f.first_node(last);
  parallel_for(f.count(), leaves_a_piece, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) at_leaves[i] = s.albedos[i] * leaves[i];
  });
  for (size_t l = last; l > 0; --l) {
    const uint32_t* parents = f.parents.data() + f.first_parent(l);
    const Vec3* below = s.nodes.data() + f.first_node(l);
    const float* areas = s.node_areas.data() + f.first_node(l);
    Vec3* above = s.nodes.data() + f.first_node(l - 1);
    std::fill_n(above, f.counts[l - 1], Vec3(0.0f));
    for (size_t i = 0; i < f.counts[l]; ++i) above[parents[i]] += areas[i] * below[i];
    const float* sums = s.node_areas.data() + f.first_node(l - 1);
    for (size_t i = 0; i < f.counts[l - 1]; ++i) above[i] = sums[i] > 0 ? above[i] / sums[i] : Vec3(0.0f);
  }
  parallel_for(t.gathering(), rows_a_piece, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      Vec3 sum(0.0f);
      for (size_t e = t.first[r]; e < t.first[r + 1]; ++e) sum += share(t.weights[e]) * s.nodes[t.nodes[e]];
      y[r] = t.scales[r] * sum;
    }
  });
}

void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance,
                    int most) {
  s.direct.assign(direct.begin(), direct.end());
  std::fill(s.x.begin(), s.x.end(), Vec3(0.0f));
  // Of one bounce after another: each gathers what the last one added.
  s.residual = 0, s.bounces = 0;
  double before = 0;
  while (s.bounces < most) {
    gather_indirect(t, s, s.direct, s.next);
    ++s.bounces;
    double added = 0, all = 0;
    for (size_t r = 0; r < s.x.size(); ++r) {
      s.x[r] += s.next[r];
      const Vec3 a = abs(s.next[r]), b = abs(s.x[r]);
      added += double(a.x) + a.y + a.z, all += double(b.x) + b.y + b.z;
    }
    // Terms fall like a geometric series, whose rest is known.
    const double ratio = before > 0 ? added / before : 1;
    s.residual = !(all > 0) ? 0 : ratio < 1 ? added / all * ratio / (1 - ratio) : 1;
    if (s.residual <= tolerance) return;
    before = added;
    for (size_t i = 0; i < s.direct.size(); ++i) s.direct[i] = s.next[s.ancestor[i]];
  }
}

void read_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out) {
  const size_t blocks = (t.receivers + transfer_block - 1) / transfer_block;
  out.rows = 1, out.values.resize(blocks * 3 * transfer_block);
  parallel_for(t.receivers, receivers_a_piece, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      Vec3 sum(0.0f);
      for (size_t k = r * kernel_slots; k < (r + 1) * kernel_slots; ++k)
        if (t.reader_weights[k]) sum += half_to_float(t.reader_weights[k]) * s.x[t.reader_surfels[k]];
      out.set(r, 0, max(sum, Vec3(0.0f)));
    }
  });
}

}  // namespace lambent

#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/indirect.h>

#include <algorithm>

namespace lambent {
namespace {

constexpr size_t rows_a_piece = 32, leaves_a_piece = 2048, receivers_a_piece = 1024;  // the last a multiple of blocks

// What each node of a level sends out becomes the means of the level above, and so on up to the first.
void average_upwards(const IndirectTransfer& t, IndirectSolve& s, size_t level) {
  const Surfels& f = t.surfels;
  for (size_t l = level; l > 0; --l) {
    const uint32_t* parents = f.parents.data() + f.first_parent(l);
    const float* shares = s.shares.data() + f.first_node(l);
    const float* below = s.sent.data() + 4 * f.first_node(l);
    float* above = s.sent.data() + 4 * f.first_node(l - 1);
    std::fill_n(above, 4 * size_t(f.counts[l - 1]), 0.0f);
    for (size_t i = 0; i < f.counts[l]; ++i)
      for (size_t c = 0; c < 4; ++c) above[4 * size_t(parents[i]) + c] += shares[i] * below[4 * i + c];
  }
}

// y = G of what nodes send out.
void gather_rows(const IndirectTransfer& t, const IndirectSolve& s, std::span<Vec3> y) {
  parallel_for(t.gathering(), rows_a_piece, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      // Two sums, for the latency of each.
      float a[4] = {}, b[4] = {};
      size_t e = t.first[r];
      const size_t last = t.first[r + 1];
      for (; e + 1 < last; e += 2) {
        const float *p = &s.sent[4 * size_t(t.nodes[e])], *q = &s.sent[4 * size_t(t.nodes[e + 1])];
        const float v = share(t.weights[e]), w = share(t.weights[e + 1]);
        for (size_t c = 0; c < 4; ++c) a[c] += v * p[c], b[c] += w * q[c];
      }
      if (e < last)
        for (size_t c = 0; c < 4; ++c) a[c] += share(t.weights[e]) * s.sent[4 * size_t(t.nodes[e]) + c];
      y[r] = t.scales[r] * Vec3(a[0] + b[0], a[1] + b[1], a[2] + b[2]);
    }
  });
}

void send(IndirectSolve& s, size_t node, Vec3 light) {
  const Vec3 out = s.albedos[node] * light;
  float* to = &s.sent[4 * node];
  to[0] = out.x, to[1] = out.y, to[2] = out.z;
}

// y = G P R U x: of light that gathering surfels have, and leaves below them as well.
void bounce(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> x, std::span<Vec3> y) {
  const Surfels& f = t.surfels;
  const size_t last = f.levels() - 1, leaves = f.first_node(last);
  if (last > t.gather_level)
    parallel_for(f.count(), leaves_a_piece, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) send(s, leaves + i, x[s.ancestor[i]]);
    });
  // Levels between, of files that have some, are means of the leaves.
  if (last > t.gather_level + 1) {
    average_upwards(t, s, last);
  } else {
    for (size_t i = 0; i < x.size(); ++i) send(s, f.first_node(t.gather_level) + i, x[i]);
    average_upwards(t, s, t.gather_level);
  }
  gather_rows(t, s, y);
}

Vec3 sum_of(std::span<const Vec3> x) {
  double sum[3] = {};
  for (Vec3 v : x)
    for (int c = 0; c < 3; ++c) sum[c] += double(std::abs(v[c]));
  return {float(sum[0]), float(sum[1]), float(sum[2])};
}

// The operator's entries are not negative, so that powers of it turn any light into the slowest to die away.
Vec3 spectral_radius(const IndirectTransfer& t, IndirectSolve& s) {
  constexpr int powers = 12;
  std::fill(s.x.begin(), s.x.end(), Vec3(1.0f));
  Vec3 radius(0.0f);
  for (int k = 0; k < powers; ++k) {
    bounce(t, s, s.x, s.before);
    const Vec3 was = sum_of(s.x), is = sum_of(s.before);
    for (int c = 0; c < 3; ++c) {
      radius[c] = was[c] > 0 ? std::min(is[c] / was[c], 0.999f) : 0.0f;
      for (Vec3& v : s.before) v[c] = is[c] > 0 ? v[c] / is[c] * float(s.x.size()) : 0.0f;
    }
    std::swap(s.x, s.before);
  }
  return radius;
}

}  // namespace

IndirectSolve make_indirect_solve(const IndirectTransfer& t, std::span<const Vec3> albedos) {
  IndirectSolve s;
  const Surfels& f = t.surfels;
  const size_t last = f.levels() - 1;
  s.ancestor.resize(f.count());
  for (uint32_t i = 0; i < f.count(); ++i) {
    uint32_t at = i;
    for (size_t l = last; l > t.gather_level; --l) at = f.parents[f.first_parent(l) + at];
    s.ancestor[i] = at;
  }
  std::vector<float> areas(f.nodes(), 0.0f);
  std::copy(f.areas.begin(), f.areas.end(), areas.begin() + ptrdiff_t(f.first_node(last)));
  s.albedos.assign(f.nodes(), Vec3(0.0f)), s.shares.assign(f.nodes(), 0.0f), s.sent.assign(4 * f.nodes(), 0.0f);
  if (albedos.empty()) albedos = f.albedos;
  std::copy_n(albedos.begin(), f.count(), s.albedos.begin() + ptrdiff_t(f.first_node(last)));
  for (size_t l = f.levels(); l-- > 1;) {
    const size_t below = f.first_node(l), above = f.first_node(l - 1);
    const uint32_t* parents = f.parents.data() + f.first_parent(l);
    for (size_t i = 0; i < f.counts[l]; ++i) areas[above + parents[i]] += areas[below + i];
    for (size_t i = 0; i < f.counts[l]; ++i) {
      s.shares[below + i] = areas[below + i] / areas[above + parents[i]];
      s.albedos[above + parents[i]] += s.shares[below + i] * s.albedos[below + i];
    }
  }
  s.x.resize(t.gathering()), s.before.resize(t.gathering()), s.first.resize(t.gathering());
  s.radius = spectral_radius(t, s);
  return s;
}

void gather_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> leaves, std::span<Vec3> y) {
  const Surfels& f = t.surfels;
  const size_t last = f.levels() - 1, first = f.first_node(last);
  parallel_for(f.count(), leaves_a_piece, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) send(s, first + i, leaves[i]);
  });
  average_upwards(t, s, last);
  gather_rows(t, s, y);
}

void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance,
                    int most) {
  gather_indirect(t, s, direct, s.first);
  const Vec3 sums = sum_of(s.first);
  const double light = double(sums.x) + sums.y + sums.z;
  s.x = s.first, s.residual = 0, s.bounces = 1;
  std::fill(s.before.begin(), s.before.end(), Vec3(0.0f));
  if (!(light > 0)) return;
  // x(k+1) = x(k-1) + omega (first + K x(k) - x(k-1)), for eigenvalues within [-radius, radius].
  std::vector<Vec3> bounced(s.x.size());
  Vec3 omega(2.0f);
  for (s.residual = 1; s.residual > tolerance && s.bounces < most;) {
    bounce(t, s, s.x, bounced), ++s.bounces;
    omega = each(omega * s.radius * s.radius, [](float w) { return 1 / (1 - w / 4); });
    double left = 0;
    for (size_t r = 0; r < s.x.size(); ++r) {
      const Vec3 next = s.first[r] + bounced[r], rest = abs(next - s.x[r]);
      left += double(rest.x) + rest.y + rest.z;
      s.before[r] += omega * (next - s.before[r]);
    }
    std::swap(s.x, s.before);
    s.residual = left / light;
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

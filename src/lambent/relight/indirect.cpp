#include <lambent/basis/sh.h>
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
void gather_rows(const NodeRows& t, const IndirectSolve& s, std::span<Vec3> y) {
  parallel_for(t.count(), rows_a_piece, [&](size_t begin, size_t end) {
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
  gather_rows(t.gather, s, y);
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
  gather_rows(t.gather, s, y);
}

void solve_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct, double tolerance,
                    int most, bool goes_on) {
  gather_indirect(t, s, direct, s.first);
  const Vec3 sums = sum_of(s.first);
  const double light = double(sums.x) + sums.y + sums.z;
  // x(k+1) = x(k-1) + omega (first + K x(k) - x(k-1)), for eigenvalues within [-radius, radius]; x(0) = 0, or as it
  // was.
  s.residual = 0, s.bounces = 1;
  std::vector<Vec3> bounced(s.x.size());
  if (!(light > 0) || !goes_on) {
    s.x = s.first;
    std::fill(s.before.begin(), s.before.end(), Vec3(0.0f));
  } else {
    bounce(t, s, s.x, bounced), ++s.bounces;
    std::swap(s.x, s.before);
    for (size_t r = 0; r < s.x.size(); ++r) s.x[r] = s.first[r] + bounced[r];
  }
  if (!(light > 0)) return;
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

void step_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct) {
  gather_indirect(t, s, direct, s.first);
  bounce(t, s, s.x, s.before);
  s.bounces = 1, s.residual = 0;
  const Vec3 sums = sum_of(s.first);
  double changed = 0;
  for (size_t r = 0; r < s.x.size(); ++r) {
    const Vec3 next = s.first[r] + s.before[r], rest = abs(next - s.x[r]);
    changed += double(rest.x) + rest.y + rest.z, s.before[r] = next;
  }
  std::swap(s.x, s.before);
  if (const double light = double(sums.x) + sums.y + sums.z; light > 0) s.residual = changed / light;
}

void send_indirect(const IndirectTransfer& t, IndirectSolve& s, std::span<const Vec3> direct) {
  const size_t last = t.surfels.levels() - 1, first = t.surfels.first_node(last);
  parallel_for(t.surfels.count(), leaves_a_piece, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) send(s, first + i, direct[i] + s.x[s.ancestor[i]]);
  });
  average_upwards(t, s, last);
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

namespace {

// The surfel of a node.
struct NodePlaces {
  const Surfels& surfels;
  std::vector<size_t> first;
  explicit NodePlaces(const Surfels& s) : surfels(s) {
    for (size_t l = 0; l < s.levels(); ++l) first.push_back(s.first_node(l));
  }
  Vec3 operator()(uint32_t node) const {
    size_t level = first.size() - 1;
    while (first[level] > node) --level;
    return surfels.positions[node - first[level]];
  }
};

// A node that is met stands for what lies about its middle, which may lie in the plane that it is seen from or below
// it.
constexpr float least_rise = 0.15f;
Vec3 risen(Vec3 way, Vec3 normal) {
  const Vec3 d = normalize_or(way, normal);
  const float rise = dot(d, normal);
  if (rise >= least_rise) return d;
  const Vec3 aside = d - rise * normal;
  return normalize_or(aside, normal) * std::sqrt(1 - least_rise * least_rise) + least_rise * normal;
}

}  // namespace

void read_directional_indirect(const IndirectTransfer& t, const IndirectSolve& s, DirectionalKind kind, Relit& out) {
  const size_t count = size_t(directional_rows(kind));
  const NodePlaces place(t.surfels);
  std::vector<Vec3> rows(t.gathering() * count, Vec3(0.0f));
  parallel_for(t.gathering(), rows_a_piece, [&](size_t begin, size_t end) {
    std::array<float, 9> weights{};
    for (size_t g = begin; g < end; ++g) {
      const Vec3 from = t.surfels.positions[g], normal = t.surfels.normals[g];
      const Mat3 frame = receiver_frame(normal);
      for (size_t e = t.gather.first[g]; e < t.gather.first[g + 1]; ++e) {
        const uint32_t node = t.gather.nodes[e];
        const float* sent = &s.sent[4 * size_t(node)];
        const Vec3 light = t.gather.scales[g] * share(t.gather.weights[e]) * Vec3(sent[0], sent[1], sent[2]);
        directional_weights(kind, risen(place(node) - from, normal), frame, least_rise, weights);
        for (size_t k = 0; k < count; ++k) rows[g * count + k] += weights[k] * light;
      }
    }
  });
  const size_t blocks = (t.receivers + transfer_block - 1) / transfer_block;
  out.rows = int(count), out.values.resize(blocks * count * 3 * transfer_block);
  parallel_for(t.receivers, receivers_a_piece, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r)
      for (size_t row = 0; row < count; ++row) {
        Vec3 sum(0.0f);
        for (size_t k = r * kernel_slots; k < (r + 1) * kernel_slots; ++k)
          if (t.reader_weights[k]) sum += half_to_float(t.reader_weights[k]) * rows[t.reader_surfels[k] * count + row];
        out.set(r, int(row), sum);
      }
  });
}

namespace {

// Points inside something take the mean of their neighbours along the axes, layer by layer.
void fill_invalid(const IndirectLattice& f, Relit& out) {
  const Lattice& l = f.lattice;
  std::vector<uint8_t> known = f.valid;
  for (bool grew = true; grew;) {
    grew = false;
    const std::vector<uint8_t> before = known;
    for (size_t p = 0; p < l.count(); ++p) {
      if (before[p]) continue;
      const std::array<int, 3> at = l.place(p), n{l.nx, l.ny, l.nz};
      std::vector<size_t> sources;
      for (size_t axis = 0; axis < 3; ++axis)
        for (int step : {-1, 1}) {
          std::array<int, 3> q = at;
          if ((q[axis] += step) < 0 || q[axis] >= n[axis]) continue;
          if (const size_t i = l.index(q[0], q[1], q[2]); before[i]) sources.push_back(i);
        }
      if (sources.empty()) continue;
      for (int row = 0; row < out.rows; ++row) {
        Vec3 sum(0.0f);
        for (size_t q : sources) sum += out.at(q, row);
        out.set(p, row, sum / float(sources.size()));
      }
      known[p] = 1, grew = true;
    }
  }
}

}  // namespace

void read_lattice_indirect(const IndirectTransfer& t, const IndirectSolve& s, Relit& out) {
  const IndirectLattice& f = *t.lattice;
  const size_t count = size_t(sh_count(f.order)), points = f.lattice.count();
  const NodePlaces place(t.surfels);
  const size_t blocks = (points + transfer_block - 1) / transfer_block;
  out.rows = int(count), out.values.assign(blocks * count * 3 * transfer_block, 0.0f);
  parallel_for(points, transfer_block, [&](size_t begin, size_t end) {
    std::vector<float> y(count);
    std::vector<Vec3> sum(count);
    for (size_t p = begin; p < end; ++p) {
      const Vec3 from = f.lattice.position(p);
      std::fill(sum.begin(), sum.end(), Vec3(0.0f));
      for (size_t e = f.rows.first[p]; e < f.rows.first[p + 1]; ++e) {
        const uint32_t node = f.rows.nodes[e];
        const float* sent = &s.sent[4 * size_t(node)];
        // The whole sphere is 4 pi.
        const Vec3 light = 4 * pi * f.rows.scales[p] * share(f.rows.weights[e]) * Vec3(sent[0], sent[1], sent[2]);
        evaluate_sh(f.order, normalize_or(place(node) - from, Vec3(0, 1, 0)), y);
        for (size_t k = 0; k < count; ++k) sum[k] += y[k] * light;
      }
      for (size_t k = 0; k < count; ++k) out.set(p, int(k), sum[k]);
    }
  });
  fill_invalid(f, out);
}

}  // namespace lambent

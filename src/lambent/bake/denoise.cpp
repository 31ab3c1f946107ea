// Sources: local linear regression (Cleveland, "Robust locally weighted regression", 1979); differences less the noise
// that both sides have, as in non-local means for rendering (Rousselle, Knaus and Zwicker, 2012); the choice by Stein's
// unbiased risk (Li, Wu and Chuang, "SURE-based optimization for adaptive sampling and reconstruction", 2012).
#include <lambent/bake/denoise.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/aligned.h>
#include <lambent/core/check.h>
#include <lambent/core/ranks.h>

#include <nanoflann.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>

namespace lambent {
namespace {

constexpr size_t most_neighbours = 24, looked_at = 48;    // itself among them; so many, and the fit ones of these
constexpr size_t fewest_neighbours = 5;                   // a plane has three unknowns
constexpr size_t judges = 8;                              // neighbours whose risks are added up
constexpr size_t variances = 6;                           // measured places that tell a place's variance
constexpr float alike_cosine = 0.8f, most_slope = 0.35f;  // of a neighbour on the same surface
constexpr float strengths[] = {4, 16};                    // differences beyond the noise count less, the larger

struct Cloud {
  std::span<const Vec3> points;
  size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return points[i][int(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3, uint32_t>;

// Squared difference of two rows, in a fixed order.
float difference2(const float* a, const float* b, size_t width) {
  float sums[lane_multiple] = {};
  for (size_t k = 0; k < width; k += lane_multiple)
    for (size_t l = 0; l < lane_multiple; ++l) {
      const float d = a[k + l] - b[k + l];
      sums[l] += d * d;
    }
  float sum = 0;
  for (float s : sums) sum += s;
  return sum;
}

struct Neighbours {
  std::array<uint32_t, most_neighbours> index;  // itself first, nearest first
  uint32_t count;
};

// The value at a place as a weighted mean of its neighbours'.
struct Filter {
  std::array<float, most_neighbours> share{};
  // Summed in double precision: rows that sum to others still do.
  void apply(const Neighbours& at, const float* rows, size_t width, double* sums, float* out) const {
    std::fill_n(sums, width, 0.0);
    for (size_t q = 0; q < at.count; ++q) {
      const float* row = rows + size_t(at.index[q]) * width;
      for (size_t k = 0; k < width; ++k) sums[k] += double(share[q]) * double(row[k]);
    }
    for (size_t k = 0; k < width; ++k) out[k] = float(sums[k]);
  }
};
constexpr size_t filters = std::size(strengths);

static_assert(sizeof(Neighbours) + (1 + filters) * sizeof(float) <= denoise_bytes);

struct Denoiser {
  const NoisyPlaces& noisy;
  const float* rows;
  size_t width;
  // Of own places; those of others are not touched, and take no memory.
  std::unique_ptr<Neighbours[]> neighbours = std::make_unique_for_overwrite<Neighbours[]>(noisy.places.size());
  std::vector<float> variance = std::vector<float>(noisy.places.size());
  std::vector<std::array<float, filters>> risks = std::vector<std::array<float, filters>>(noisy.places.size());

  bool is_left_out(size_t i) const { return !noisy.left_out.empty() && noisy.left_out[i]; }
  bool on_one_surface(size_t i, size_t j) const {
    if (is_left_out(j)) return false;
    if (noisy.normals.empty() || i == j) return true;
    const Vec3 d = noisy.places[j] - noisy.places[i];
    return dot(noisy.normals[i], noisy.normals[j]) >= alike_cosine &&
           std::abs(dot(noisy.normals[i], d)) <= most_slope * length(d);
  }

  void find(const Tree& tree, const Tree& measured, size_t i) {
    Neighbours& at = neighbours[i];
    uint32_t index[looked_at];
    float distance2[looked_at];
    const Vec3 p = noisy.places[i];
    const float query[3] = {p.x, p.y, p.z};
    const size_t found = tree.knnSearch(query, looked_at, index, distance2);
    at.count = 0, at.index[at.count++] = uint32_t(i);
    for (size_t q = 0; q < found && at.count < most_neighbours; ++q)
      if (index[q] != i && on_one_surface(i, index[q])) at.index[at.count++] = index[q];
    const size_t near = measured.knnSearch(query, 3 * variances, index, distance2);
    // Those that face the same way tell more; without any, all of them.
    for (const bool strict : {true, false}) {
      size_t used = 0;
      float sum = 0;
      for (size_t q = 0; q < near && used < variances; ++q) {
        const size_t j = noisy.measured[index[q]];
        if (strict && !noisy.normals.empty() && dot(noisy.normals[i], noisy.normals[j]) < 0.5f) continue;
        sum += noisy.variance[index[q]], ++used;
      }
      if (used > 0) {
        variance[i] = sum / float(used);
        break;
      }
    }
  }

  // Weighted least squares of a plane (in free space, a linear function), its value at the place itself.
  Filter regress(size_t i, const float* weights) const {
    const Neighbours& at = neighbours[i];
    const Vec3 centre = noisy.places[i];
    const float reach = length(noisy.places[at.index[at.count - 1]] - centre);
    const bool surface = !noisy.normals.empty();
    const size_t unknowns = surface ? 3 : 4;
    const Mat3 frame = surface ? frame_about(noisy.normals[i]) : Mat3(1);
    std::array<std::array<double, 4>, most_neighbours> feature{};
    double A[4][5] = {};
    for (size_t q = 0; q < at.count; ++q) {
      const Vec3 d = (noisy.places[at.index[q]] - centre) / std::max(reach, 1e-30f);
      feature[q] = {1, double(dot(d, frame[0])), double(dot(d, frame[1])), double(dot(d, frame[2]))};
      for (size_t r = 0; r < unknowns; ++r)
        for (size_t s = 0; s < unknowns; ++s) A[r][s] += double(weights[q]) * feature[q][r] * feature[q][s];
    }
    A[0][4] = 1;
    const double ridge = 1e-3 * A[0][0];  // slopes that neighbours do not tell are none
    for (size_t r = 1; r < unknowns; ++r) A[r][r] += ridge;
    for (size_t p = 0; p < unknowns; ++p)  // positive definite: no pivoting
      for (size_t r = 0; r < unknowns; ++r) {
        if (r == p) continue;
        const double factor = A[r][p] / A[p][p];
        for (size_t s = p; s < unknowns; ++s) A[r][s] -= factor * A[p][s];
        A[r][4] -= factor * A[p][4];
      }
    Filter f;
    double sum = 0;
    std::array<double, most_neighbours> share{};
    for (size_t q = 0; q < at.count; ++q) {
      for (size_t p = 0; p < unknowns; ++p) share[q] += A[p][4] / A[p][p] * feature[q][p];
      share[q] *= double(weights[q]), sum += share[q];
    }
    for (size_t q = 0; q < at.count; ++q) f.share[q] = float(share[q] / sum);  // constants stay what they are
    return f;
  }

  std::array<Filter, filters> filters_of(size_t i) const {
    const Neighbours& at = neighbours[i];
    std::array<Filter, filters> out;
    const float reach = 1.1f * length(noisy.places[at.index[at.count - 1]] - noisy.places[i]);
    float near[most_neighbours], beyond[most_neighbours], noise[most_neighbours];
    for (size_t q = 0; q < at.count; ++q) {
      const size_t j = at.index[q];
      const float d = length(noisy.places[j] - noisy.places[i]) / std::max(reach, 1e-30f);
      near[q] = (1 - d * d) * (1 - d * d);
      noise[q] = variance[i] + variance[j];
      beyond[q] = q == 0 ? 0 : std::max(0.0f, difference2(rows + i * width, rows + j * width, width) - noise[q]);
    }
    for (size_t f = 0; f < filters; ++f) {
      float weights[most_neighbours];
      for (size_t q = 0; q < at.count; ++q)
        weights[q] = near[q] * std::exp(-beyond[q] / std::max(strengths[f] * noise[q], 1e-30f));
      out[f] = regress(i, weights);
    }
    return out;
  }
  bool is_filtered(size_t i) const { return !is_left_out(i) && neighbours[i].count >= fewest_neighbours; }

  // |f - x|^2 - v + 2 share v, less that of the row as it is, v.
  void judge(size_t i, double* sums, float* filtered) {
    const std::array<Filter, filters> all = filters_of(i);
    for (size_t f = 0; f < filters; ++f) {
      all[f].apply(neighbours[i], rows, width, sums, filtered);
      risks[i][f] = difference2(filtered, rows + i * width, width) - 2 * variance[i] * (1 - all[f].share[0]);
    }
  }
  // The filter of the least risk, or none.
  const Filter* choose(size_t i, const std::array<Filter, filters>& all) const {
    const Neighbours& at = neighbours[i];
    const Filter* best = nullptr;
    float least = 0;
    for (size_t f = 0; f < filters; ++f) {
      float risk = 0;
      for (size_t q = 0; q < std::min<size_t>(judges, at.count); ++q) risk += risks[at.index[q]][f];
      if (risk < least) least = risk, best = &all[f];
    }
    return best;
  }
};

}  // namespace

Result<void> denoise(const NoisyPlaces& noisy, const float* rows, size_t width, float* out,
                     std::span<float* const> more, Progress* progress) {
  const size_t n = noisy.places.size();
  LAMBENT_CHECK(noisy.measured.size() == noisy.variance.size() && width % lane_multiple == 0);
  const Shares shares(n, denoise_grain);
  LAMBENT_CHECK(!noisy.ask || more.empty());
  if (!noisy.ask) std::copy_n(rows, n * width, out);
  else
    shares.each_stripe(shares.ranks().rank(), [&](size_t begin, size_t end) {
      std::copy(rows + begin * width, rows + end * width, out + begin * width);
    });
  if (noisy.measured.empty()) return {};
  ProgressStage stage(progress, "denoising", (3 + more.size()) * shares.own());
  std::vector<Vec3> measured_places;
  for (uint32_t r : noisy.measured) measured_places.push_back(noisy.places[r]);
  const Cloud all{noisy.places}, measured{measured_places};
  const Tree tree(3, all, {16}), measured_tree(3, measured, {16});
  Denoiser d{noisy, rows, width};
  auto each = [&](auto f) {
    shares.for_own([&](size_t begin, size_t end) {
      std::vector<double> sums(width);
      AlignedVector<float> scratch(width);
      for (size_t i = begin; i < end && !stage.cancelled(); ++i) f(i, sums.data(), scratch.data());
      if (!stage.cancelled()) stage.advance(end - begin);
    });
    return none_cancelled(progress);
  };
  const bool found = each([&](size_t i, double*, float*) { d.find(tree, measured_tree, i); });
  shares.gather(d.variance.data());
  if (noisy.ask) {
    std::vector<uint8_t> asked(n);
    shares.for_own([&](size_t begin, size_t end) {
      for (size_t i = begin; i < end && found; ++i)
        for (size_t q = 0; q < d.neighbours[i].count; ++q)
          std::atomic_ref(asked[d.neighbours[i].index[q]]).store(1, std::memory_order_relaxed);
    });
    noisy.ask(asked);
  }
  const bool judged = found && each([&](size_t i, double* sums, float* scratch) {
                        if (d.is_filtered(i)) d.judge(i, sums, scratch);
                      });
  shares.gather(d.risks.data());
  auto apply = [&](const float* from, float* to) {
    const bool all = each([&](size_t i, double* sums, float*) {
      if (!d.is_filtered(i)) return;
      const std::array<Filter, filters> filters_here = d.filters_of(i);
      if (const Filter* best = d.choose(i, filters_here))
        best->apply(d.neighbours[i], from, width, sums, to + i * width);
    });
    if (!noisy.ask) shares.gather(to, width);
    return all;
  };
  bool done = judged && apply(rows, out);
  for (size_t m = 0; m < more.size() && done; ++m) {
    const AlignedVector<float> before(more[m], more[m] + n * width);
    done = apply(before.data(), more[m]);
  }
  if (!done) return Error{"", "cancelled"};
  return {};
}

}  // namespace lambent

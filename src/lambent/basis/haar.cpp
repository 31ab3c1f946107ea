// Follows: triple-product-integrals; Ng, Ramamoorthi and Hanrahan 2004, the Haar tripling coefficient theorem and its
// evaluation in linear time.
#include <lambent/basis/haar.h>
#include <lambent/core/check.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace lambent {
namespace {

// First square of a level.
constexpr size_t level_begin(int level) { return haar_squares(level); }

size_t morton_index(size_t x, size_t y) {
  size_t out = 0;
  for (int bit = 0; bit < 16; ++bit) out |= (x >> bit & 1) << 2 * bit | (y >> bit & 1) << (2 * bit + 1);
  return out;
}

// Signs of wavelet `type` over the quarters.
constexpr int sign_of(int type, int quarter) {
  return type == 0 ? (quarter & 1 ? -1 : 1)
       : type == 1 ? (quarter & 2 ? -1 : 1)
                   : (quarter == 1 || quarter == 2 ? -1 : 1);
}

struct Square {
  int level;
  size_t index;  // along the curve of its level
  int type;
};
Square square_of(size_t coefficient) {
  const size_t square = (coefficient - 1) / 3;
  int level = 0;
  while (square >= level_begin(level + 1)) ++level;
  return {level, square - level_begin(level), int((coefficient - 1) % 3)};
}

struct TripleProduct {
  const HaarTree& a;
  const HaarTree& b;
  const HaarTree& c;
  size_t visited = 0;

  // What the squares inside this one add, given the values of all coarser functions on it.
  double inside(int level, size_t index, double pa, double pb, double pc) {
    const size_t s = level_begin(level) + index;
    if (a.occupied[s] + b.occupied[s] + c.occupied[s] < 2) return 0;
    ++visited;
    const float *x = &a.coefficients[1 + 3 * s], *y = &b.coefficients[1 + 3 * s], *z = &c.coefficients[1 + 3 * s];
    const double height = double(size_t(1) << level);
    // Two alike under a coarser third, and three that differ.
    double sum = pa * (double(y[0]) * z[0] + double(y[1]) * z[1] + double(y[2]) * z[2]) +
                 pb * (double(x[0]) * z[0] + double(x[1]) * z[1] + double(x[2]) * z[2]) +
                 pc * (double(x[0]) * y[0] + double(x[1]) * y[1] + double(x[2]) * y[2]);
    sum += height *
           (x[0] * (double(y[1]) * z[2] + double(y[2]) * z[1]) + x[1] * (double(y[0]) * z[2] + double(y[2]) * z[0]) +
            x[2] * (double(y[0]) * z[1] + double(y[1]) * z[0]));
    if (level + 1 == a.levels) return sum;
    for (int q = 0; q < 4; ++q) {
      double value[3] = {pa, pb, pc};
      for (int type = 0; type < 3; ++type) {
        const double h = height * sign_of(type, q);
        value[0] += h * x[type], value[1] += h * y[type], value[2] += h * z[type];
      }
      sum += inside(level + 1, 4 * index + size_t(q), value[0], value[1], value[2]);
    }
    return sum;
  }
};

void mark_occupied(HaarTree& t) {
  t.occupied.assign(haar_squares(t.levels), 0);
  for (int level = t.levels - 1; level >= 0; --level)
    for (size_t s = level_begin(level); s < level_begin(level + 1); ++s) {
      const float* c = &t.coefficients[1 + 3 * s];
      bool any = c[0] != 0 || c[1] != 0 || c[2] != 0;
      if (level + 1 < t.levels)
        for (size_t q = 0; q < 4; ++q)
          any |= t.occupied[level_begin(level + 1) + 4 * (s - level_begin(level)) + q] != 0;
      t.occupied[s] = any;
    }
}

}  // namespace

void haar_transform(int levels, std::span<const float> pixels, HaarTree& out) {
  const size_t side = size_t(1) << levels;
  LAMBENT_CHECK(levels >= 1 && levels <= 12 && pixels.size() >= side * side);
  out.levels = levels;
  out.coefficients.resize(haar_count(levels));
  std::vector<double> means(side * side);
  for (size_t y = 0; y < side; ++y)
    for (size_t x = 0; x < side; ++x) means[morton_index(x, y)] = double(pixels[y * side + x]);
  for (int level = levels - 1; level >= 0; --level) {
    const double scale = 0.25 / double(size_t(1) << level);
    for (size_t i = 0; i < size_t(1) << 2 * level; ++i) {
      const double *m = &means[4 * i], mean = 0.25 * (m[0] + m[1] + m[2] + m[3]);
      float* c = &out.coefficients[1 + 3 * (level_begin(level) + i)];
      c[0] = float(scale * (m[0] - m[1] + m[2] - m[3])), c[1] = float(scale * (m[0] + m[1] - m[2] - m[3])),
      c[2] = float(scale * (m[0] - m[1] - m[2] + m[3]));
      means[i] = mean;
    }
  }
  out.coefficients[0] = float(means[0]);
  mark_occupied(out);
}

std::vector<float> haar_pixels(const HaarTree& t) {
  std::vector<double> values{double(t.coefficients[0])};
  for (int level = 0; level < t.levels; ++level) {
    std::vector<double> finer(4 * values.size());
    for (size_t i = 0; i < values.size(); ++i)
      for (int q = 0; q < 4; ++q) {
        double v = values[i];
        for (int type = 0; type < 3; ++type)
          v += double(size_t(1) << level) * sign_of(type, q) *
               double(t.coefficients[1 + 3 * (level_begin(level) + i) + size_t(type)]);
        finer[4 * i + size_t(q)] = v;
      }
    values = std::move(finer);
  }
  const size_t side = size_t(1) << t.levels;
  std::vector<float> pixels(side * side);
  for (size_t y = 0; y < side; ++y)
    for (size_t x = 0; x < side; ++x) pixels[y * side + x] = float(values[morton_index(x, y)]);
  return pixels;
}

void keep_largest(std::span<HaarTree> trees, double fraction) {
  std::vector<float> sizes;
  for (const HaarTree& t : trees)
    for (float c : t.coefficients) sizes.push_back(std::abs(c));
  const size_t keep = size_t(std::ceil(fraction * double(sizes.size())));
  if (keep >= sizes.size()) return;
  std::nth_element(sizes.begin(), sizes.begin() + ptrdiff_t(keep), sizes.end(), std::greater<>());
  const float least = sizes[keep];  // the largest that goes
  for (HaarTree& t : trees) {
    for (float& c : t.coefficients)
      if (std::abs(c) <= least) c = 0;
    mark_occupied(t);
  }
}

void quantise_haar(HaarTree& tree, int bits) {
  LAMBENT_CHECK(bits >= 2 && bits <= 16);
  float most = 0;
  for (float c : tree.coefficients) most = std::max(most, std::abs(c));
  if (most == 0) return;
  const float steps = float((1 << (bits - 1)) - 1), step = most / steps;
  for (float& c : tree.coefficients) c = std::round(c / step) * step;
  mark_occupied(tree);
}

double haar_triple_product(const HaarTree& a, const HaarTree& b, const HaarTree& c, size_t* visited) {
  LAMBENT_CHECK(a.levels == b.levels && b.levels == c.levels);
  TripleProduct product{a, b, c};
  const double pa = double(a.coefficients[0]), pb = double(b.coefficients[0]), pc = double(c.coefficients[0]);
  const double sum = pa * pb * pc + product.inside(0, 0, pa, pb, pc);
  if (visited) *visited += product.visited;
  return sum;
}

double haar_tripling_coefficient(int levels, size_t i, size_t j, size_t k) {
  LAMBENT_CHECK(std::max({i, j, k}) < haar_count(levels));
  std::array<size_t, 3> order{i, j, k};
  std::sort(order.begin(), order.end());  // coarser first
  if (order[2] == 0) return 1;
  if (order[0] == 0) return order[1] == order[2] ? 1 : 0;
  const Square a = square_of(order[0]), b = square_of(order[1]), c = square_of(order[2]);
  if (b.level != c.level || b.index != c.index) return 0;
  if (a.level == b.level)
    return a.index == b.index && a.type != b.type && b.type != c.type && a.type != c.type ? double(size_t(1) << a.level)
                                                                                          : 0;
  if (b.type != c.type || b.index >> 2 * (b.level - a.level) != a.index) return 0;
  const int quarter = int(b.index >> 2 * (b.level - a.level - 1) & 3);
  return sign_of(a.type, quarter) * double(size_t(1) << a.level);
}

}  // namespace lambent

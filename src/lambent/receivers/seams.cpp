// Least-squares seams as in M. Iwanicki, "Lighting technology of The Last of Us", 2013; conjugate gradients: M.
// Hestenes and E. Stiefel, 1952.
#include <lambent/receivers/seams.h>
#include <lambent/scene/clean.h>

#include <algorithm>
#include <tuple>

namespace lambent {
namespace {

// One point of a seam: x . row must vanish. At most four texels of either look-up.
struct Row {
  std::array<uint32_t, 8> texel;  // numbers among those that take part
  std::array<float, 8> weight;
  int count = 0;
};

// Points lie half a texel apart, at most this many an edge.
constexpr float spacing = 0.5f;
constexpr int most_points = 4096;
constexpr int most_steps = 50;
constexpr double enough = 1e-4;  // of the residual's fall

struct EdgeSide {
  uint32_t a, b;  // numbers of positions, a < b
  uint32_t triangle;
  bool front;
  Vec2 at_a, at_b;
};

std::vector<EdgeSide> sorted_edges(const Scene& scene, const TexelReceivers& texels) {
  const std::vector<uint32_t> ids = number_positions(scene.positions).ids;
  std::vector<EdgeSide> edges;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i)
    for (const bool front : {true, false}) {
      const TexelTriangle* t = texels.find(i, front);
      if (!t) continue;
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t a = ids[scene.triangles[i].v[k]], b = ids[scene.triangles[i].v[(k + 1) % 3]];
        const Vec2 at_a = t->at[k], at_b = t->at[(k + 1) % 3];
        edges.push_back(a < b ? EdgeSide{a, b, i, front, at_a, at_b} : EdgeSide{b, a, i, front, at_b, at_a});
      }
    }
  std::sort(edges.begin(), edges.end(), [](const EdgeSide& x, const EdgeSide& y) {
    return std::tie(x.a, x.b, x.front, x.triangle) < std::tie(y.a, y.b, y.front, y.triangle);
  });
  return edges;
}

// Differences across seams, which are to vanish, of the receivers that take part.
struct Seams {
  std::vector<uint32_t> receivers;
  std::vector<Row> rows;
};
Seams find_seams(const Scene& scene, const TexelReceivers& texels, const std::vector<EdgeSide>& edges, float cosine) {
  Seams seams;
  std::vector<uint32_t> index;
  uint32_t receivers = 0;
  for (uint32_t r : texels.texels)
    if (r != none) receivers = std::max(receivers, r + 1);
  index.assign(receivers, none);
  auto add = [&](Row& row, Vec2 at, float sign) {
    texels.spread_at(at, [&](uint32_t r, float w) {
      if (index[r] == none) index[r] = uint32_t(seams.receivers.size()), seams.receivers.push_back(r);
      row.texel[size_t(row.count)] = index[r], row.weight[size_t(row.count)] = sign * w, ++row.count;
    });
  };
  auto normal = [&](const EdgeSide& e) { return unit_normal(scene, scene.triangles[e.triangle]); };
  for (size_t begin = 0, end; begin < edges.size(); begin = end) {
    for (end = begin; end < edges.size() && std::tie(edges[end].a, edges[end].b, edges[end].front) ==
                                                std::tie(edges[begin].a, edges[begin].b, edges[begin].front);)
      ++end;
    if (end - begin != 2) continue;
    const EdgeSide &x = edges[begin], &y = edges[begin + 1];
    if ((x.at_a == y.at_a && x.at_b == y.at_b) || dot(normal(x), normal(y)) < cosine) continue;
    const float length = std::max(distance(x.at_a, x.at_b), distance(y.at_a, y.at_b));
    const int points = std::clamp(int(length / spacing), 1, most_points);
    for (int p = 0; p <= points; ++p) {
      const float s = float(p) / float(points);
      Row row;
      add(row, x.at_a + s * (x.at_b - x.at_a), 1.0f), add(row, y.at_a + s * (y.at_b - y.at_a), -1.0f);
      seams.rows.push_back(row);
    }
  }
  return seams;
}

}  // namespace

size_t smooth_seams(const Scene& scene, const TexelReceivers& texels, float* values, size_t stride, size_t width,
                    float cosine, float keep, Progress* progress) {
  ProgressStage stage(progress, "seams", most_steps);
  const Seams seams = find_seams(scene, texels, sorted_edges(scene, texels), cosine);
  const std::vector<uint32_t>& number = seams.receivers;
  const size_t n = number.size();
  if (n == 0) return 0;

  // (S^T S + keep) d = -S^T S x0 for the change d of each column.
  auto normal_product = [&](const std::vector<double>& v, std::vector<double>& out) {
    std::fill(out.begin(), out.end(), 0.0);
    std::vector<double> sum(width);
    for (const Row& row : seams.rows) {
      std::fill(sum.begin(), sum.end(), 0.0);
      for (int k = 0; k < row.count; ++k)
        for (size_t c = 0; c < width; ++c)
          sum[c] += double(row.weight[size_t(k)]) * v[row.texel[size_t(k)] * width + c];
      for (int k = 0; k < row.count; ++k)
        for (size_t c = 0; c < width; ++c)
          out[row.texel[size_t(k)] * width + c] += double(row.weight[size_t(k)]) * sum[c];
    }
  };
  std::vector<double> x0(n * width), d(n * width, 0.0), r(n * width), p, Ap(n * width);
  for (size_t i = 0; i < n; ++i)
    for (size_t c = 0; c < width; ++c) x0[i * width + c] = double(values[size_t(number[i]) * stride + c]);
  normal_product(x0, r);
  for (double& value : r) value = -value;
  p = r;
  auto squares = [&](const std::vector<double>& a, const std::vector<double>& b) {
    std::vector<double> sum(width, 0.0);
    for (size_t i = 0; i < n * width; ++i) sum[i % width] += a[i] * b[i];
    return sum;
  };
  std::vector<double> rr = squares(r, r);
  const std::vector<double> first = rr;
  for (int step = 0; step < most_steps && !stage.cancelled(); ++step) {
    stage.advance();
    normal_product(p, Ap);
    for (size_t i = 0; i < n * width; ++i) Ap[i] += double(keep) * p[i];
    const std::vector<double> pAp = squares(p, Ap);
    std::vector<double> alpha(width, 0.0), beta(width, 0.0);
    for (size_t c = 0; c < width; ++c) alpha[c] = pAp[c] > 0 ? rr[c] / pAp[c] : 0.0;
    for (size_t i = 0; i < n * width; ++i) d[i] += alpha[i % width] * p[i], r[i] -= alpha[i % width] * Ap[i];
    const std::vector<double> next = squares(r, r);
    bool done = true;
    for (size_t c = 0; c < width; ++c)
      beta[c] = rr[c] > 0 ? next[c] / rr[c] : 0.0, done &= next[c] <= enough * enough * first[c];
    if (done) break;
    for (size_t i = 0; i < n * width; ++i) p[i] = r[i] + beta[i % width] * p[i];
    rr = next;
  }
  for (size_t i = 0; i < n; ++i)
    for (size_t c = 0; c < width; ++c)
      values[size_t(number[i]) * stride + c] = float(x0[i * width + c] + d[i * width + c]);
  return n;
}

}  // namespace lambent

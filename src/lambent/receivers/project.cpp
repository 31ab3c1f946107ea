#include <lambent/receivers/project.h>

#include <lambent/core/aligned.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/raster.h>

#include <cmath>
#include <numeric>
#include <span>

namespace lambent {
namespace {

// A tent of which the surface has less has so little to tell its value by that noise would grow in it.
constexpr double least_covered = 0.7;
// Of an error, by solve_mass().
constexpr float left_over = 3e-5f;

// A part of a receiver's function: over a triangle's side, with the integral of the function there.
struct Piece {
  uint32_t receiver, triangle;
  bool back;
  uint8_t corner;  // of hats: whose hat it is
  float u, v;      // of tents: the point
  double share;    // of the integral of B
};

// Pieces in the order of their receivers, and where each one's begin.
struct Pieces {
  std::vector<Piece> all;
  std::vector<size_t> first;
  std::vector<double> whole;  // of tents alone: the integral of all of each one, on the surface and beyond it
  double integral(size_t r) const {
    double sum = 0;
    for (size_t k = first[r]; k < first[r + 1]; ++k) sum += all[k].share;
    return sum;
  }
  bool stays(size_t r) const { return !(integral(r) > (whole.empty() ? 0 : least_covered * whole[r])); }
};

void put_in_order(Pieces& p, size_t receivers) {
  std::stable_sort(p.all.begin(), p.all.end(), [](const Piece& a, const Piece& b) { return a.receiver < b.receiver; });
  p.first.assign(receivers + 1, 0);
  for (const Piece& piece : p.all) ++p.first[piece.receiver + 1];
  std::partial_sum(p.first.begin(), p.first.end(), p.first.begin());
}

double area_of(const Scene& scene, uint32_t triangle) {
  return 0.5 * double(area_length(area_normal(scene, scene.triangles[triangle])));
}

// Calls f(triangle, back, place in the basis) for all sides that receive, with an area.
template <class Basis>
void each_side(const Scene& scene, const Basis& basis, auto f) {
  for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
    const double area = area_of(scene, t);
    if (!(area > 0)) continue;
    for (const bool back : {false, true})
      if (const auto* at = basis.find(t, !back)) f(t, back, *at, area);
  }
}

// Entries of M, merged when they are put in order.
struct Entry {
  uint32_t row, column;
  double value;
};

void collect(const Scene& scene, const PatchReceivers& basis, Pieces& pieces, std::vector<Entry>& mass) {
  each_side(scene, basis, [&](uint32_t t, bool back, const Patch& at, double area) {
    pieces.all.push_back({at.receiver, t, back, 0, 0, 0, area}), mass.push_back({at.receiver, at.receiver, area});
  });
}

void collect(const Scene& scene, const CornerReceivers& basis, Pieces& pieces, std::vector<Entry>& mass) {
  each_side(scene, basis, [&](uint32_t t, bool back, const Corners& at, double area) {
    for (size_t k = 0; k < 3; ++k) {
      pieces.all.push_back({at.receiver[k], t, back, uint8_t(k), 0, 0, area / 3});
      for (size_t j = 0; j < 3; ++j) mass.push_back({at.receiver[k], at.receiver[j], area / (j == k ? 6 : 12)});
    }
  });
}

// Four points a texel and axis.
void collect(const Scene& scene, const TexelReceivers& basis, Pieces& pieces, std::vector<Entry>& mass) {
  constexpr int fine = 4;
  for (uint32_t r : basis.texels)
    if (r != none) pieces.whole.resize(std::max(pieces.whole.size(), size_t(r) + 1), 0.0);
  each_side(scene, basis, [&](uint32_t t, bool back, const TexelTriangle& at, double area) {
    const Vec2d a(at.at[0]), ab = Vec2d(at.at[1]) - a, ac = Vec2d(at.at[2]) - a;
    const double twice = ab.x * ac.y - ab.y * ac.x;
    if (twice == 0) return;
    const double each = area / (0.5 * std::abs(twice)) / (fine * fine);
    const auto is_seen = [&](uint32_t r) { pieces.whole[r] = std::max(pieces.whole[r], each * fine * fine); };
    const float scale = float(fine);
    each_texel({scale * at.at[0], scale * at.at[1], scale * at.at[2]}, 0, fine * basis.width, fine * basis.height,
               [&](int i, int j) {
                 const Vec2 p = Vec2(float(i) + 0.5f, float(j) + 0.5f) / scale;
                 const Vec2d d = Vec2d(p) - a;
                 const float u = float(std::clamp((d.x * ac.y - d.y * ac.x) / twice, 0.0, 1.0)),
                             v = float(std::clamp((ab.x * d.y - ab.y * d.x) / twice, 0.0, 1.0 - double(u)));
                 std::array<std::pair<uint32_t, double>, 4> met;
                 size_t count = 0;
                 basis.spread_at(p, [&](uint32_t r, float w) { met[count++] = {r, double(w)}; });
                 for (size_t k = 0; k < count; ++k) {
                   pieces.all.push_back({met[k].first, t, back, 0, u, v, each * met[k].second}), is_seen(met[k].first);
                   for (size_t l = 0; l < count; ++l)
                     mass.push_back({met[k].first, met[l].first, each * met[k].second * met[l].second});
                 }
               });
  });
}

// Kernels are fitted to points, and have no places but those.
void collect(const Scene&, const PointReceivers&, Pieces&, std::vector<Entry>&) {}

MassMatrix rows_of(std::vector<Entry>& entries, const Pieces& pieces, size_t receivers) {
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.row != b.row ? a.row < b.row : a.column < b.column; });
  MassMatrix m;
  m.first.assign(1, 0);
  size_t e = 0;
  for (uint32_t r = 0; r < receivers; ++r) {
    const size_t begin = m.columns.size();
    std::vector<double> values;
    for (; e < entries.size() && entries[e].row == r; ++e) {
      if (m.columns.size() == begin || m.columns.back() != entries[e].column)
        m.columns.push_back(entries[e].column), values.push_back(0);
      values.back() += entries[e].value;
    }
    if (pieces.stays(r)) m.columns.resize(begin), m.columns.push_back(r), values = {1};
    const double sum = std::accumulate(values.begin(), values.end(), 0.0);
    for (double v : values) m.weights.push_back(float(v / sum));
    m.first.push_back(m.columns.size());
  }
  return m;
}

// A point of a piece by a point of the unit square: uniform over boxes, of hats as dense as they are high.
Vec2 point_of(const PatchReceivers&, const Piece&, Vec2 square) {
  const float root = std::sqrt(square.x);
  return {root * (1 - square.y), root * square.y};
}
Vec2 point_of(const CornerReceivers&, const Piece& piece, Vec2 square) {
  // Of density 6 h (1 - h), whose running integral is 3 h^2 - 2 h^3.
  const float high = 0.5f - std::sin(std::asin(std::clamp(1 - 2 * square.x, -1.0f, 1.0f)) / 3);
  float weight[3];
  weight[piece.corner] = high, weight[(piece.corner + 1) % 3] = (1 - high) * square.y;
  weight[(piece.corner + 2) % 3] = (1 - high) * (1 - square.y);
  return {weight[1], weight[2]};
}
Vec2 point_of(const auto&, const Piece& piece, Vec2) { return {piece.u, piece.v}; }

void place_on(const Scene& scene, const Piece& piece, Vec2 at, float diagonal, Vec3& origin, Vec3& normal) {
  const Triangle& t = scene.triangles[piece.triangle];
  const Vec3 face = unit_normal(scene, t, Vec3(0, 1, 0)) * (piece.back ? -1.0f : 1.0f);
  normal = normalize_or(interpolate(scene.normals, t, at.x, at.y), face);
  if (dot(normal, face) < 0) normal = -normal;
  float edge = INFINITY;
  for (int k = 0; k < 3; ++k)
    edge = std::min(edge, length(scene.positions[t.v[k]] - scene.positions[t.v[(k + 1) % 3]]));
  const Vec3 p = interpolate(scene.positions, t, at.x, at.y);
  origin = p + face * receiver_lift(p, edge, diagonal);
}

template <class Basis>
LeastSquares make_on(const Scene& scene, const Receivers& receivers, const Basis& basis, size_t each, uint32_t seed) {
  LeastSquares out;
  Pieces pieces;
  {
    std::vector<Entry> mass;
    collect(scene, basis, pieces, mass);
    put_in_order(pieces, receivers.count());
    out.mass = rows_of(mass, pieces, receivers.count());
    if (std::is_same_v<Basis, CornerReceivers>) out.mass.least = 0.5f, out.mass.most = 2;
    if (std::is_same_v<Basis, TexelReceivers>) out.mass.least = 0.25f, out.mass.most = 4;
  }
  const float diagonal = bounds(scene).diagonal();
  out.places.each = each;
  out.places.origins.resize(receivers.count() * each), out.places.normals.resize(receivers.count() * each);
  parallel_for(receivers.count(), 64, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      const std::span<const Piece> own(pieces.all.data() + pieces.first[r], pieces.first[r + 1] - pieces.first[r]);
      double below = 0;
      const double all = pieces.integral(r);
      const bool stays = pieces.stays(r);
      Random random(seed, r);
      for (size_t k = 0, piece = 0; k < each; ++k) {
        const size_t at = r * each + k;
        out.places.origins[at] = receivers.origins[r], out.places.normals[at] = receivers.normals[r];
        if (stays) continue;
        const double wanted = (double(k) + double(random.next())) / double(each) * all;
        while (piece + 1 < own.size() && below + own[piece].share <= wanted) below += own[piece++].share;
        const Vec2 square = sobol_owen(uint32_t(k), uint32_t(hash64(seed, r)));
        place_on(scene, own[piece], point_of(basis, own[piece], square), diagonal, out.places.origins[at],
                 out.places.normals[at]);
      }
    }
  });
  return out;
}

}  // namespace

LeastSquares make_least_squares(const Scene& scene, const Receivers& receivers, size_t places, uint32_t seed) {
  return std::visit([&](const auto& basis) { return make_on(scene, receivers, basis, places, seed); }, receivers.basis);
}

void solve_mass(const MassMatrix& m, float* x, size_t stride, size_t width) {
  if (m.is_diagonal()) return;
  const float centre = (m.most + m.least) / 2, radius = (m.most - m.least) / 2, root = std::sqrt(m.most / m.least);
  const int steps = int(std::ceil(std::log(2 / left_over) / std::log((root + 1) / (root - 1))));
  const size_t n = m.first.size() - 1;
  AlignedVector<float> b(n * width), step(n * width, 0.0f), next(n * width);
  for (size_t r = 0; r < n; ++r) std::copy_n(x + r * stride, width, b.data() + r * width);
  float rho = radius / centre;
  for (int k = 0; k < steps; ++k) {
    const float before = rho;
    if (k > 0) rho = 1 / (2 * centre / radius - before);
    const float momentum = k > 0 ? rho * before : 0, gain = k > 0 ? 2 * rho / radius : 1 / centre;
    parallel_for(n, 256, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r) {
        float* to = next.data() + r * width;
        std::copy_n(b.data() + r * width, width, to);
        float diagonal = 1;
        for (size_t e = m.first[r]; e < m.first[r + 1]; ++e) {
          const float w = m.weights[e], *from = x + size_t(m.columns[e]) * stride;
          if (m.columns[e] == r) diagonal = w;
          for (size_t j = 0; j < width; ++j) to[j] -= w * from[j];
        }
        const float *last = step.data() + r * width, part = gain / diagonal;
        for (size_t j = 0; j < width; ++j) to[j] = momentum * last[j] + part * to[j];
      }
    });
    parallel_for(n, 256, [&](size_t begin, size_t end) {
      for (size_t r = begin; r < end; ++r)
        for (size_t j = 0; j < width; ++j) x[r * stride + j] += next[r * width + j];
    });
    std::swap(step, next);
  }
}

}  // namespace lambent

// Source: local regression (Cleveland and Devlin, "Locally weighted regression", 1988).
#include <lambent/bake/spread.h>
#include <lambent/core/ranks.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lambent {
namespace {

constexpr float alike_cosine = 0.8f, most_slope = 0.35f;  // of places on the same surface
constexpr size_t looked_at = 40;
constexpr size_t piece = 64;

double area_of(const Scene& scene, const Triangle& t) {
  const Vec3d a(scene.positions[t.v[0]]), b(scene.positions[t.v[1]]), c(scene.positions[t.v[2]]);
  return 0.5 * length(cross(b - a, c - a));
}

// Rows on the two sides of a wall's foot, or of a sharp shadow, are not.
bool are_alike(const float* rows, size_t width, size_t i, size_t j) {
  constexpr float most = 0.25f;  // of the greater one's square
  const float *a = rows + i * width, *b = rows + j * width;
  float difference = 0, first = 0, second = 0;
  for (size_t k = 0; k < width; ++k)
    difference += (a[k] - b[k]) * (a[k] - b[k]), first += a[k] * a[k], second += b[k] * b[k];
  return difference <= most * std::max(first, second);
}

}  // namespace

bool on_one_surface(const Receivers& r, size_t i, size_t j) {
  if (dot(r.normals[i], r.normals[j]) < alike_cosine) return false;
  const Vec3 d = r.origins[j] - r.origins[i];
  return std::abs(dot(r.normals[i], d)) <= most_slope * length(d);
}

size_t find_neighbours(const PointTree& tree, const Receivers& r, std::span<const uint32_t> which, size_t i,
                       size_t skip, size_t most, uint32_t* out) {
  uint32_t index[looked_at];
  float distance2[looked_at];
  const Vec3 p = r.origins[i];
  const float query[3] = {p.x, p.y, p.z};
  const size_t found = tree.knnSearch(query, looked_at, index, distance2);
  size_t count = 0;
  for (size_t q = 0; q < found && count < most; ++q)
    if (which[index[q]] != skip && (which[index[q]] == i || on_one_surface(r, i, which[index[q]])))
      out[count++] = index[q];
  return count;
}

namespace {

constexpr size_t most_unknowns = 8;

// By so many of the unknowns. False: the place lies so far out of its neighbours that they would be told to shout.
bool regress_by(size_t unknowns, const Receivers& r, size_t i, const uint32_t* of, size_t count, float* share) {
  constexpr double most_said = 2;  // sum of what they say, either way
  const Vec3 centre = r.origins[i], n = r.normals[i];
  const Mat3 frame = frame_about(n);
  float reach = 0;
  for (size_t q = 0; q < count; ++q) reach = std::max(reach, length(r.origins[of[q]] - centre));
  reach = std::max(1.1f * reach, 1e-30f);
  double feature[Spread::most][most_unknowns], weight[Spread::most], A[most_unknowns][most_unknowns + 1] = {};
  for (size_t q = 0; q < count; ++q) {
    const Vec3 d = (r.origins[of[q]] - centre) / reach, tilt = r.normals[of[q]];
    const double x = double(dot(d, frame[0])), y = double(dot(d, frame[1])), far2 = double(dot(d, d));
    weight[q] = (1 - far2) * (1 - far2) + 1e-6;
    const double f[most_unknowns] = {1,     x,     y,    double(dot(tilt, frame[0])), double(dot(tilt, frame[1])),
                                     x * x, x * y, y * y};
    std::copy_n(f, most_unknowns, feature[q]);
    for (size_t a = 0; a < unknowns; ++a)
      for (size_t b = 0; b <= a; ++b) A[a][b] += weight[q] * f[a] * f[b];
  }
  for (size_t a = 0; a < unknowns; ++a)
    for (size_t b = a + 1; b < unknowns; ++b) A[a][b] = A[b][a];
  const double all = A[0][0];
  // What neighbours do not tell is none: slopes, tilts, and most of all curvature.
  const double ridge[most_unknowns] = {0, 1e-4, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3};
  for (size_t a = 1; a < unknowns; ++a) A[a][a] += ridge[a] * all;
  A[0][most_unknowns] = 1;
  for (size_t p = 0; p < unknowns; ++p)  // positive definite: no pivoting
    for (size_t a = 0; a < unknowns; ++a) {
      if (a == p) continue;
      const double factor = A[a][p] / A[p][p];
      for (size_t b = p; b < unknowns; ++b) A[a][b] -= factor * A[p][b];
      A[a][most_unknowns] -= factor * A[p][most_unknowns];
    }
  double sum = 0, shares[Spread::most] = {};
  for (size_t q = 0; q < count; ++q) {
    for (size_t p = 0; p < unknowns; ++p) shares[q] += A[p][most_unknowns] / A[p][p] * feature[q][p];
    shares[q] *= weight[q], sum += shares[q];
  }
  double said = 0;
  for (size_t q = 0; q < count; ++q) {
    share[q] = float(shares[q] / sum);  // constants stay what they are
    said += std::abs(shares[q] / sum);
  }
  return said <= most_said;
}

}  // namespace

void regress(const Receivers& r, size_t i, const uint32_t* of, size_t count, float* share) {
  if (count >= 12 && regress_by(8, r, i, of, count, share)) return;
  if (count >= fewest_neighbours && regress_by(3, r, i, of, count, share)) return;
  regress_by(1, r, i, of, count, share);
}

Thinned keep_all(size_t receivers) {
  Thinned out;
  out.chosen.resize(receivers), out.of.resize(receivers);
  std::iota(out.chosen.begin(), out.chosen.end(), 0u), std::iota(out.of.begin(), out.of.end(), 0u);
  return out;
}

std::vector<float> receiver_areas(const Scene& scene, const Receivers& receivers) {
  std::vector<double> areas(receivers.count(), 0.0);
  double texels = 0;
  for (uint32_t t = 0; t < scene.triangles.size(); ++t)
    for (const bool front : {true, false})
      std::visit(
          [&](const auto& basis) {
            const auto* at = basis.find(t, front);
            if (!at) return;
            const double area = area_of(scene, scene.triangles[t]);
            if constexpr (std::is_same_v<std::decay_t<decltype(basis)>, TexelReceivers>) texels += area;
            else
              for (const Vec2 corner : {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)})
                basis.spread(*at, corner.x, corner.y,
                             [&](uint32_t r, float weight) { areas[r] += double(weight) * area / 3; });
          },
          receivers.basis);
  std::vector<float> out(areas.size());
  for (size_t i = 0; i < areas.size(); ++i) out[i] = float(texels > 0 ? texels / double(areas.size()) : areas[i]);
  return out;
}

Receivers thinned_receivers(const Receivers& receivers, const Thinned& thinned) {
  Receivers out;
  for (uint32_t c : thinned.chosen) {
    out.origins.push_back(receivers.origins[c]), out.normals.push_back(receivers.normals[c]);
    if (!receivers.places.empty()) out.places.push_back(receivers.places[c]);
  }
  out.basis = receivers.basis;
  auto moved = [&](uint32_t& r) {
    if (r != none) r = thinned.of[r];
  };
  if (auto* corners = std::get_if<CornerReceivers>(&out.basis)) {
    for (auto* side : {&corners->front, &corners->back})
      for (Corners& c : *side)
        for (uint32_t& r : c.receiver) moved(r);
  } else if (auto* texels = std::get_if<TexelReceivers>(&out.basis)) {
    for (uint32_t& r : texels->texels) moved(r);
  } else if (auto* points = std::get_if<PointReceivers>(&out.basis)) {
    for (uint32_t& r : points->points) moved(r);
  } else {
    auto& patches = std::get<PatchReceivers>(out.basis);
    for (auto* side : {&patches.front, &patches.back})
      for (Patch& p : *side) moved(p.receiver);
  }
  return out;
}

Spread::Spread(const Receivers& receivers, const Thinned& thinned, std::span<const uint8_t> left_out,
               const float* guide, size_t width)
    : receivers_(receivers), thinned_(thinned) {
  if (thinned.all()) return;
  near_.resize(thinned.chosen.size());
  std::vector<uint32_t> open, members(thinned.chosen.size(), 0);
  for (uint32_t c : thinned.of) ++members[c];
  std::vector<uint32_t> index;
  for (uint32_t c = 0; c < thinned.chosen.size(); ++c)
    if (left_out.empty() || !left_out[c]) open.push_back(thinned.chosen[c]), index.push_back(c);
  const PointCloud cloud{receivers.origins, open};
  const PointTree tree(3, cloud, {16});
  const lambent::Shares own(near_.size(), piece);
  own.for_own([&](size_t begin, size_t end) {
    for (size_t c = begin; c < end; ++c) {
      if (members[c] < 2) continue;
      Near& at = near_[c];
      at.count = uint32_t(find_neighbours(tree, receivers, open, thinned.chosen[c], SIZE_MAX, most, at.index.data()));
      size_t alike = 0;
      for (size_t q = 0; q < at.count; ++q)
        if (const uint32_t other = index[at.index[q]]; !guide || are_alike(guide, width, c, other))
          at.index[alike++] = other;
      at.count = uint32_t(alike);
    }
  });
  own.gather(near_.data());
}

Spread::Shares Spread::shares(size_t receiver) const {
  Shares out;
  const uint32_t c = thinned_.of[receiver];
  if (thinned_.chosen[c] == receiver || near_[c].count == 0) {
    out.count = 1, out.index[0] = c, out.share[0] = 1;
    return out;
  }
  const Near& at = near_[c];
  uint32_t places[most];
  for (size_t q = 0; q < at.count; ++q) places[q] = thinned_.chosen[at.index[q]];
  out.count = at.count, out.index = at.index;
  regress(receivers_, receiver, places, at.count, out.share.data());
  return out;
}

void Spread::row(size_t receiver, const float* rows, size_t width, float* out) const {
  const Shares s = shares(receiver);
  std::fill_n(out, width, 0.0f);
  for (size_t q = 0; q < s.count; ++q) {
    const float* from = rows + size_t(s.index[q]) * width;
    for (size_t k = 0; k < width; ++k) out[k] += s.share[q] * from[k];
  }
}

}  // namespace lambent

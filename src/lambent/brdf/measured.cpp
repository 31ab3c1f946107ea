// Look-up is trilinear between cell centres and periodic in phi_d, so it is reciprocal as the parametrisation is. Half
// the draws follow the cosine and half a lobe of half vectors: for microfacets f = D F G / (4 cos cos), so the mean of
// 4 f cos cos over the difference angles, times the cosine of h, is in proportion to the density of their normals.
#include <lambent/brdf/lobes.h>
#include <lambent/brdf/measured.h>
#include <lambent/core/check.h>
#include <lambent/core/sampling.h>

namespace lambent {
namespace {

constexpr float cosine_share = 0.5f;

// Fraction of the way through the cells of theta_h, [0, 1].
float half_fraction(float theta_h) { return std::sqrt(std::min(theta_h * (2 / pi), 1.0f)); }

// Two neighbours and the share of the second; clamped at the ends, or periodic.
struct Tap {
  int first, second;
  float share;
};
Tap tap(float fraction, int cells, bool periodic) {
  const float x = fraction * float(cells) - 0.5f, whole = std::floor(x);
  int i = int(whole), j = i + 1;
  if (periodic) i = (i + cells) % cells, j = j % cells;
  else i = std::clamp(i, 0, cells - 1), j = std::clamp(j, 0, cells - 1);
  return {i, j, x - whole};
}

Vec3 read_table(const MeasuredTable& t, const HalfDifference& a) {
  const Tap h = tap(half_fraction(a.theta_h), t.theta_h, false),
            d = tap(std::min(a.theta_d * (2 / pi), 1.0f), t.theta_d, false);
  const Tap p = tap(std::min(a.phi_d / pi, 1.0f), t.phi_d, true);
  auto along_phi = [&](int hi, int di) {
    return mix(t.f[t.index(hi, di, p.first)], t.f[t.index(hi, di, p.second)], p.share);
  };
  auto along_d = [&](int hi) { return mix(along_phi(hi, d.first), along_phi(hi, d.second), d.share); };
  return mix(along_d(h.first), along_d(h.second), h.share);
}

// 1 - cos(theta_h) at the edge between cells i - 1 and i of n. It keeps its digits near 0, where the cosine would lose
// them.
double edge_drop(int i, int n) {
  const double fraction = double(i) / n, s = std::sin(std::numbers::pi / 4 * fraction * fraction);
  return 2 * s * s;
}

int half_cell(const MeasuredTable& t, float theta_h) {
  return std::min(int(half_fraction(theta_h) * float(t.theta_h)), t.theta_h - 1);
}

}  // namespace

HalfDifference half_difference(Vec3 wi, Vec3 wo) {
  const Vec3 sum = wi + wo, difference = wi - wo;  // difference is square to h
  const Vec3 h = sum / length(sum);
  const float s = std::hypot(h.x, h.y);
  // Frame about h: `along` is where theta_h grows, `across` is square to it and level.
  const Vec3 along = s > 0 ? Vec3(h.x * h.z, h.y * h.z, -s * s) / s : Vec3(1, 0, 0);
  const Vec3 across = s > 0 ? Vec3(-h.y, h.x, 0) / s : Vec3(0, 1, 0);
  float x = dot(difference, along), y = dot(difference, across);
  if (y < 0 || (y == 0 && x < 0)) x = -x, y = -y;  // swapping wi and wo changes both signs
  return {std::atan2(s, h.z), std::atan2(length(difference), length(sum)), std::atan2(y, x)};
}

DirectionPair directions(const HalfDifference& a) {
  const Vec3 along(std::cos(a.theta_h), 0, -std::sin(a.theta_h)), across(0, 1, 0),
      h(std::sin(a.theta_h), 0, std::cos(a.theta_h));
  const Vec3 aside = std::sin(a.theta_d) * (std::cos(a.phi_d) * along + std::sin(a.phi_d) * across);
  return {std::cos(a.theta_d) * h + aside, std::cos(a.theta_d) * h - aside};
}

HalfDifference cell_angles(const MeasuredTable& t, int h, int d, int p) {
  const float fraction = (float(h) + 0.5f) / float(t.theta_h);
  return {pi / 2 * fraction * fraction, pi / 2 * (float(d) + 0.5f) / float(t.theta_d),
          pi * (float(p) + 0.5f) / float(t.phi_d)};
}

void prepare_sampling(MeasuredTable& t) {
  LAMBENT_CHECK(t.theta_h >= 1 && t.theta_d >= 1 && t.phi_d >= 1);
  LAMBENT_CHECK(t.f.size() == size_t(t.theta_h) * size_t(t.theta_d) * size_t(t.phi_d));
  constexpr float grazing = 0.02f;  // directions below are left out: measurements there are extrapolated
  std::vector<double> weight(size_t(t.theta_h)), share(size_t(t.theta_h));
  double total = 0;
  for (int h = 0; h < t.theta_h; ++h) {
    double sum = 0;
    int count = 0;
    for (int d = 0; d < t.theta_d; ++d)
      for (int p = 0; p < t.phi_d; ++p) {
        const DirectionPair pair = directions(cell_angles(t, h, d, p));
        if (std::min(pair.wi.z, pair.wo.z) < grazing) continue;
        sum += double(luminance(t.f[t.index(h, d, p)])) * double(4 * pair.wi.z * pair.wo.z), ++count;
      }
    const double top = edge_drop(h, t.theta_h), bottom = edge_drop(h + 1, t.theta_h);
    weight[size_t(h)] = count ? sum / count * (1 - (top + bottom) / 2) : 0;
    share[size_t(h)] = 2 * std::numbers::pi * (bottom - top);
    total += weight[size_t(h)] * share[size_t(h)];
  }
  t.lobe.resize(size_t(t.theta_h)), t.cumulative.resize(size_t(t.theta_h) + 1);
  double running = 0;
  for (size_t h = 0; h < t.lobe.size(); ++h) {
    const double density = total > 0 ? weight[h] / total : 1 / (2 * std::numbers::pi);
    t.lobe[h] = float(density), t.cumulative[h] = std::min(float(running), 1.0f);
    running += density * share[h];
  }
  t.cumulative.back() = 1;
}

BrdfValue value_above(const Measured& b, Vec3 wi, Vec3 wo) {
  const MeasuredTable& t = *b.table;
  const HalfDifference a = half_difference(wi, wo);
  const float lobe = t.lobe[size_t(half_cell(t, a.theta_h))] / (2 * length(wi + wo));  // |wi + wo| = 2 cos(theta_d)
  return {read_table(t, a), cosine_share * wi.z / pi + (1 - cosine_share) * lobe};
}

Vec3 draw(const Measured& b, Vec3 wo, Vec2 u) {
  if (take_first(cosine_share, u)) return square_to_cosine_hemisphere(u);
  const MeasuredTable& t = *b.table;
  const size_t after = size_t(std::upper_bound(t.cumulative.begin(), t.cumulative.end(), u.x) - t.cumulative.begin());
  const size_t cell = std::clamp(after, size_t{1}, t.lobe.size()) - 1;
  const float part = std::min((u.x - t.cumulative[cell]) / (t.cumulative[cell + 1] - t.cumulative[cell]), 1.0f);
  const float from = float(edge_drop(int(cell), t.theta_h)), to = float(edge_drop(int(cell) + 1, t.theta_h));
  const float down = from + part * (to - from), s = std::sqrt(std::max(0.0f, down * (2 - down))), phi = 2 * pi * u.y;
  return reflect_about(Vec3(s * std::cos(phi), s * std::sin(phi), 1 - down), wo);
}

}  // namespace lambent

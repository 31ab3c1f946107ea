// Follows: general-prt, "Final reflection": view-dependent vectors O_j(wo) looked up in a map, or a basis of the
// outgoing radiance.
#include <lambent/basis/hemispherical.h>
#include <lambent/core/check.h>
#include <lambent/transfer/outgoing.h>
#include <lambent/transfer/view_mix.h>

namespace lambent {

const char* const outgoing_names[7] = {"map", "svd", "sh", "hemisphere", "hsh", "phong", "directional"};

Vec3 view_map_direction(int grid, int x, int y) {
  const Vec2 disk = square_to_disk({float(x) / float(grid - 1), float(y) / float(grid - 1)});
  constexpr float lowest = 2e-3f;  // the horizon itself reflects nothing that could be measured
  const float z = std::max(1 - dot(disk, disk), lowest), r = std::sqrt(1 - z * z);
  const Vec2 flat(normalize_or(Vec3(disk, 0), Vec3(0)));
  return {flat * r, z};
}

void look_up(const ViewMap& map, Vec3 wo, std::span<ViewWeights> out) {
  LAMBENT_CHECK(map.grid >= 2 && out.size() >= size_t(map.rows));
  const ViewMix mix = mix_views(map.grid, wo);
  const auto& w = mix.weights;
  const ViewWeights* p = map.values.data() + mix.nodes[0] * size_t(map.rows);
  const ViewWeights* q = map.values.data() + mix.nodes[2] * size_t(map.rows);
  for (int r = 0; r < map.rows; ++r)
    out[size_t(r)] = w[0] * p[r] + w[1] * p[map.rows + r] + w[2] * q[r] + w[3] * q[map.rows + r];
}

std::vector<Lobe> outgoing_lobes(int count) {
  LAMBENT_CHECK(count >= 4);
  // The first of even ones from the pole on, to nearly a spacing below the horizon, without which the fit there is half
  // as good.
  const double below = std::min(1.0, 0.8 * std::sqrt(2 * std::numbers::pi / count));
  const int all = int(std::lround(2 * count / (1 + below)));
  std::vector<Lobe> lobes;
  for (Vec3 axis : even_directions(all)) lobes.push_back({axis, std::max(1.5f, 0.15f * float(all))});
  lobes.resize(size_t(count));
  return lobes;
}

int Outgoing::rows() const {
  if (kind == OutgoingKind::map || kind == OutgoingKind::svd) return maps.empty() ? 0 : maps[0].rows;
  if (kind == OutgoingKind::phong) return sh_count(order) + 1 + has_b;
  if (kind == OutgoingKind::directional) return int(lobes.size()) * (has_b ? 2 : 1);
  return sh_count(order) * (has_b ? 2 : 1);
}

void evaluate_outgoing(const Outgoing& o, size_t receiver, Vec3 view, std::span<ViewWeights> out) {
  Vec3 wo = view * o.frames[receiver];
  if (wo.z < 0) wo = normalize_or(Vec3(wo.x, wo.y, 0), Vec3(0, 0, 1));
  if (o.kind == OutgoingKind::map || o.kind == OutgoingKind::svd) return look_up(o.maps[o.map_of[receiver]], wo, out);
  if (o.kind == OutgoingKind::directional) {
    for (size_t k = 0; k < o.lobes.size(); ++k) {
      const float y = float(lobe_value(LobeKind::compact, o.lobes[k].sharpness, double(dot(o.lobes[k].axis, wo))));
      out[k] = ViewWeights(y, y, y, 0);
      if (o.has_b) out[o.lobes.size() + k] = ViewWeights(0, 0, 0, y);
    }
    return;
  }
  float y[sh_count(max_sh_order)];
  const size_t n = size_t(sh_count(o.order));
  if (o.kind == OutgoingKind::phong) {
    evaluate_sh(o.order, Vec3(-wo.x, -wo.y, wo.z), {y, n});
    for (size_t k = 0; k < n; ++k) out[k] = ViewWeights(y[k], y[k], y[k], 0);
    out[n] = ViewWeights(1, 1, 1, 0);
    if (o.has_b) out[n + 1] = ViewWeights(0, 0, 0, 1);
    return;
  }
  if (o.kind == OutgoingKind::hsh) evaluate_hsh(o.order, wo, {y, n});
  else evaluate_sh(o.order, wo, {y, n});
  for (size_t k = 0; k < n; ++k) {
    out[k] = ViewWeights(y[k], y[k], y[k], 0);
    if (o.has_b) out[n + k] = ViewWeights(0, 0, 0, y[k]);
  }
}

std::vector<float> row_weights(const Outgoing& o) {
  std::vector<float> weights(size_t(o.rows()), 1.0f);
  for (size_t k = 0; k < o.lobes.size(); ++k) {  // its square over the sphere
    const double s = o.lobes[k].sharpness, scale = lobe_scale(LobeKind::compact, s);
    weights[k] = float(1 / (scale * scale));
    if (o.has_b) weights[o.lobes.size() + k] = weights[k];
  }
  if (o.maps.empty()) return weights;
  std::vector<double> sum(weights.size());
  double total = 0;
  for (const ViewMap& map : o.maps) {
    const ViewWeights* w = map.values.data();
    for (int y = 0; y < map.grid; ++y)
      for (int x = 0; x < map.grid; ++x) {
        const double seen = view_map_direction(map.grid, x, y).z;  // the map has equal areas
        total += seen;
        for (double& s : sum) s += seen * dot(*w, *w), ++w;
      }
  }
  for (size_t r = 0; r < sum.size(); ++r) weights[r] = float(sum[r] / total);
  return weights;
}

Outgoing turn_outgoing(const Outgoing& o, std::span<const Mat3> rotations) {
  LAMBENT_CHECK(rotations.size() == o.frames.size());
  Outgoing out = o;
  for (size_t r = 0; r < rotations.size(); ++r) out.frames[r] = rotations[r] * o.frames[r];
  return out;
}

}  // namespace lambent

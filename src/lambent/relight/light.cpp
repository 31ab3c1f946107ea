#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/light/project.h>
#include <lambent/relight/light.h>

namespace lambent {

namespace {

// Of integrals against the basis' functions solved for coefficients: harmonics first, those beyond them left 0.
LightProjection of_coefficients(std::vector<Vec3> light, DirectionalBasis basis, const LightBasis& columns,
                                ShWindow window) {
  LightProjection result;
  result.light.assign(columns.count(), Vec3(0.0f)), result.basis = std::move(basis);
  const int order = result.basis.sh_order;
  const size_t harmonics = size_t(sh_count(order));
  if (order > 0) result.window = apply_sh_window(window, std::span(light).first(harmonics));
  std::copy_n(light.begin(), harmonics, result.light.begin());
  std::copy(light.begin() + ptrdiff_t(harmonics), light.end(), result.light.begin() + sh_count(columns.order));
  if (order < columns.order) result.basis = make_directional_basis(columns.order, columns.lobe_kind, columns.lobes);
  return result;
}

}  // namespace

bool is_within_bands(const LightBasis& basis) {
  return basis.lobes.empty() ? basis.order > 0 : basis.order == 0 && basis.lobe_kind == LobeKind::band_limited;
}

LightProjection project_light(const Environment& env, const LightBasis& columns, const Mat3& rotation, int order,
                              ShWindow window) {
  if (order == 0 || order > columns.order) order = columns.order;
  if (order == 0 && columns.lobes.empty()) return {std::vector<Vec3>(columns.count(), Vec3(0.0f)), {}, {}};
  DirectionalBasis basis = make_directional_basis(order, columns.lobe_kind, columns.lobes);
  std::vector<Vec3> light = project_environment(env, basis, rotation);
  return of_coefficients(std::move(light), std::move(basis), columns, window);
}

LightProjection project_light(std::span<const Vec3> harmonics, const LightBasis& columns, const Mat3& rotation,
                              ShWindow window) {
  const int order = sh_order(harmonics.size());
  LAMBENT_CHECK(is_within_bands(columns) && order > 0 && (!columns.lobes.empty() || order <= columns.order));
  DirectionalBasis basis = make_directional_basis(columns.lobes.empty() ? order : 0, columns.lobe_kind, columns.lobes);
  std::vector<Vec3> light = project_harmonics(rotate_sh(make_sh_rotation(order, rotation), harmonics), basis);
  return of_coefficients(std::move(light), std::move(basis), columns, window);
}

double squared_radiance(const LightProjection& projection) {
  const DirectionalBasis& basis = projection.basis;
  double sum = 0;
  for (size_t i = 0; i < basis.count(); ++i)
    for (size_t j = 0; j < basis.count(); ++j)
      sum += basis.gram[i * basis.count() + j] * dot(Vec3d(projection.light[i]), Vec3d(projection.light[j]));
  return sum;
}

MovedLight move_light(const LightProjection& still, const LightBasis& columns, const Mat3& rotation,
                      std::span<const Vec3> axes, int order, ShWindow window) {
  if (order == 0 || order > columns.order) order = columns.order;
  DirectionalBasis basis = make_directional_basis(order, columns.lobe_kind, columns.lobes);
  const size_t harmonics = size_t(sh_count(order)), before = size_t(sh_count(columns.order)) - harmonics;
  std::vector<Vec3> light(basis.count());
  MovedLight out;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> channel(light.size());
    for (size_t i = 0; i < light.size(); ++i) channel[i] = double(still.light[i < harmonics ? i : i + before][c]);
    const MovedCoefficients moved = move_directional(basis, channel, rotation, axes);
    for (size_t i = 0; i < light.size(); ++i) light[i][c] = float(moved.coefficients[i]);
    out.lost += moved.lost, out.whole += moved.whole;
  }
  out.projection = of_coefficients(std::move(light), std::move(basis), columns, window);
  return out;
}

}  // namespace lambent

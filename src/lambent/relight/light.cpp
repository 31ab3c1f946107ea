#include <lambent/light/project.h>
#include <lambent/relight/light.h>

namespace lambent {

LightProjection project_light(const Environment& env, const LightBasis& columns, const Mat3& rotation, int order,
                              ShWindow window) {
  LightProjection result;
  result.light.assign(columns.count(), Vec3(0.0f));
  if (order == 0 || order > columns.order) order = columns.order;
  if (order == 0 && columns.lobes.empty()) return result;
  result.basis = make_directional_basis(order, columns.lobe_kind, columns.lobes);
  std::vector<Vec3> light = project_environment(env, result.basis, rotation);
  const size_t harmonics = size_t(sh_count(order));
  if (order > 0) result.window = apply_sh_window(window, std::span(light).first(harmonics));
  std::copy_n(light.begin(), harmonics, result.light.begin());
  std::copy(light.begin() + ptrdiff_t(harmonics), light.end(), result.light.begin() + sh_count(columns.order));
  if (order < columns.order) result.basis = make_directional_basis(columns.order, columns.lobe_kind, columns.lobes);
  return result;
}

}  // namespace lambent

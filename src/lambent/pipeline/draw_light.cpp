#include <lambent/pipeline/draw_light.h>

#include <lambent/light/lamps.h>
#include <lambent/light/peaks.h>
#include <lambent/light/project.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/relight/light.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace lambent {

Result<Surroundings> surroundings_of(const DrawRequest& request, const Job& job) {
  auto rotation = parse_rotation(request.env_rotate, "--env-rotate");
  if (!rotation) return rotation.error();
  Surroundings around{.env = {}, .rotation = *rotation, .seen = request.background == "env"};
  if (request.env.empty()) return around;
  auto env = request.environment ? Result<Environment>(*request.environment) : load_environment(request.env);
  if (!env) return env.error();
  for (const std::string& warning : env->warnings) job.warn(warning);
  around.env = std::make_shared<const Environment>(std::move(*env));
  if (around.seen && !request.env_rotate.empty()) around.turned = rotated(*around.env, around.rotation);
  return around;
}

namespace {

// What the scene's own lamps are scaled by: as they are unless told otherwise.
Result<std::vector<Vec3>> lamps_of(const DrawRequest& request, const LightBasis& basis) {
  std::vector<Vec3> lamps(basis.groups.size(), Vec3(1.0f));
  for (const std::string& text : request.lamp) {
    auto lamp = parse_named_color(text, "--lamp");
    if (!lamp) return lamp.error();
    const auto group = std::find(basis.groups.begin(), basis.groups.end(), lamp->name);
    if (group == basis.groups.end())
      return Error{"--lamp",
                   "the file has no group \"" + lamp->name + "\"; it has " +
                       (basis.groups.empty() ? "none" : fmt::format("{}", fmt::join(basis.groups, ", "))),
                   true};
    lamps[size_t(group - basis.groups.begin())] = lamp->color;
  }
  return lamps;
}

// With less of all light in them, peaks ring too little to be seen.
constexpr double least_sharp = 0.05;

// Bands that all columns of distant light lie in, but for those that are left out; 0: lobes that hold more are there.
int bands_of(const DrawRequest& request, const LightBasis& basis) {
  if (!is_within_bands(basis)) return 0;
  const int bands = basis.lobes.empty() ? basis.order : int(basis.lobes[0].sharpness);
  return request.light_order ? std::min(request.light_order, bands) : bands;
}

// Bands of harmonics that lobes stand beside; else 0.
int bands_beside_lobes(const DrawRequest& request, const LightBasis& basis) {
  if (basis.lobes.empty() || basis.order == 0) return 0;
  return request.light_order ? std::min(request.light_order, basis.order) : basis.order;
}

double sharp_share(const KnownHarmonics& known) {
  const double light = luminance(known.all[0]);
  return light > 0 ? luminance(known.all[0] - known.rest[0]) / light : 0;
}

// --window auto.
void find_peaks(const KnownHarmonics& known, const Surroundings& around, const LightBasis& basis, ColumnLight& out) {
  out.sharp = sharp_share(known), out.lamps_found = known.lamps;
  if (!(out.sharp > least_sharp)) return void(out.sharp = 0);
  const std::vector<Vec3> rest = project_light(known.rest, basis, around.rotation).light;
  for (size_t k = 0; k < rest.size(); ++k) out.peaks.push_back(out.projection.light[k] - rest[k]);
}

// The integral of a light over the sphere, as band 0 has it: of its harmonics and lobes.
double whole_light(const LightProjection& all) {
  double light = luminance(all.light[0]);
  for (size_t k = size_t(sh_count(all.basis.sh_order)); k < all.basis.count(); ++k)
    light += all.basis.gram[k] * luminance(all.light[k]);
  return light;
}

// The same of lobes beside harmonics, `peaks` as all columns hold them: lobes do not ring, but what of the peaks they
// leave to the harmonics does.
void keep_peaks(LightProjection peaks, ColumnLight& out) {
  const double all = whole_light(out.projection), left = std::abs(luminance(peaks.light[0]));
  out.sharp = all > 0 ? left / all : 0;
  if (!(out.sharp > least_sharp)) return void(out.sharp = 0), out.peaks.clear();
  out.in_lobes = left < 0.5 * whole_light(peaks);
  out.peaks = std::move(peaks.light);
}

// Onto lobes that stand, and harmonics beside them: what they hold of the light is counted before the window.
// `sharp`: its peaks, or null where nobody asks.
void project_on_lobes(const DrawRequest& request, const Surroundings& around, const LightBasis& basis, ShWindow window,
                      const Environment* sharp, ColumnLight& out) {
  const bool moves = moves_lobes(request, basis);
  out.projection = project_light(*around.env, basis, moves ? Mat3(1.0f) : around.rotation, request.light_order);
  if (moves) out.still = out.projection;
  if (sharp) {
    LightProjection peaks = project_light(*sharp, basis, moves ? Mat3(1.0f) : around.rotation, request.light_order);
    if (moves) out.still_peaks = peaks;
    keep_peaks(std::move(peaks), out);
  }
  if (const double all = squared_radiance(*around.env); all > 0)
    out.held = std::min(squared_radiance(out.projection) / all, 1.0);
  const size_t bands = out.projection.window.size();
  if (bands > 0) out.projection.window = apply_sh_window(window, std::span(out.projection.light).first(bands * bands));
}

}  // namespace

std::shared_ptr<const KnownHarmonics> know_harmonics(const Environment& env, const DrawRequest& request,
                                                     const LightBasis& basis, bool peaks) {
  const int order = bands_of(request, basis);
  if (const int beside = bands_beside_lobes(request, basis); beside > 0 && peaks) {
    Environment sharp = without_peaks(env, beside);
    for (size_t i = 0; i < sharp.image.rgb.size(); ++i) sharp.image.rgb[i] = env.image.rgb[i] - sharp.image.rgb[i];
    return std::make_shared<const KnownHarmonics>(
        KnownHarmonics{beside, {}, {}, 0, std::make_shared<const Environment>(std::move(sharp))});
  }
  if (order == 0) return nullptr;
  KnownHarmonics out{order, project_environment(env, order), {}, 0};
  if (peaks) out.rest = project_environment(without_peaks(env, order), order);
  if (peaks && sharp_share(out) > least_sharp) out.lamps = int(find_lamps(env, 8).size());
  return std::make_shared<const KnownHarmonics>(std::move(out));
}

void soften_peaks(ColumnLight& light) {
  if (light.in_lobes) return;
  const std::vector<float> w = sh_window(ShWindow::lanczos, int(light.projection.window.size()));
  const int order = light.projection.basis.sh_order;  // lobes beside harmonics do not ring
  for (size_t k = 0; k < (order > 0 ? std::min(light.peaks.size(), size_t(sh_count(order))) : light.peaks.size());
       ++k) {
    const size_t l = size_t(sh_band(int(k)));
    const Vec3 softened = light.peaks[k] * (l < w.size() ? w[l] : 0.0f);
    light.projection.light[k] += softened - light.peaks[k], light.peaks[k] = softened;
  }
}

Result<ColumnLight> column_light(const DrawRequest& request, const Surroundings& around, const LightBasis& basis,
                                 Vec3d origin, bool knows_shadows) {
  auto window = parse_window(request.window);
  if (!window) return window.error();
  auto near = parse_sphere_lamps(request.sphere_lamp, origin);
  if (!near) return near.error();
  auto lamps = lamps_of(request, basis);
  if (!lamps) return lamps.error();
  ColumnLight out{std::move(*lamps), {}, std::move(*near)};
  if (around.env) {
    knows_shadows = knows_shadows && *window == ShWindow::automatic;
    const ShWindow applied = knows_shadows ? ShWindow::none : *window;
    const int bands = bands_of(request, basis), beside = bands_beside_lobes(request, basis);
    auto known = around.known;
    if (!known || known->order != std::max(bands, beside) || (knows_shadows && known->rest.empty() && !known->sharp))
      known = know_harmonics(*around.env, request, basis, knows_shadows);
    if (!basis.lobes.empty() && bands == 0)
      project_on_lobes(request, around, basis, applied, known ? known->sharp.get() : nullptr, out);
    else
      out.projection = known ? project_light(known->all, basis, around.rotation, applied)
                             : project_light(*around.env, basis, around.rotation, request.light_order, applied);
    if (known && bands > 0 && knows_shadows) find_peaks(*known, around, basis, out);
  } else {
    out.projection.light.assign(basis.count(), Vec3(0.0f));
    const int order = request.light_order ? std::min(request.light_order, basis.order) : basis.order;
    out.projection.window = sh_window(*window, order);
  }
  std::copy(out.lamps.begin(), out.lamps.end(), out.projection.light.end() - ptrdiff_t(out.lamps.size()));
  return out;
}

bool moves_lobes(const DrawRequest& request, const LightBasis& basis) {
  return !request.move.empty() && request.place.empty() && basis.order > 0 && !basis.lobes.empty();
}

Result<void> move_lamps(const DrawRequest& request, const Mat3& rotation, const LightBasis& basis, double time,
                        ColumnLight& light) {
  auto window = parse_window(request.window);
  if (!window) return window.error();
  const size_t first = size_t(sh_count(basis.order));
  std::vector<Vec3> axes;
  for (const Lobe& lobe : basis.lobes) axes.push_back(normalize(rotation * lobe.axis));
  light.moved.clear();
  for (const std::string& text : request.move) {
    auto arc = parse_lamp_arc(text, axes.size());
    if (!arc) return arc.error();
    axes[arc->lamp] = direction_at(*arc, time);
  }
  const ShWindow applied = *window == ShWindow::automatic ? ShWindow::none : *window;
  auto moved = move_light(light.still, basis, rotation, axes, request.light_order, applied);
  for (size_t k = 0; k < axes.size(); ++k) {
    const Vec3d was = normalize(Vec3d(basis.lobes[k].axis)), is(axes[k]);
    const double angle = std::atan2(length(cross(was, is)), dot(was, is)) * 180 / std::numbers::pi;
    if (angle < 1e-3) continue;
    LightProjection alone;
    alone.light.assign(basis.count(), Vec3(0.0f)), alone.light[first + k] = Vec3(1.0f);
    const MovedLight one = move_light(alone, basis, rotation, axes, request.light_order);
    light.moved.push_back({k, angle, 1 - one.lost / one.whole});
  }
  light.lost = moved.whole > 0 ? std::sqrt(moved.lost / moved.whole) : 0;
  std::copy(light.projection.light.end() - ptrdiff_t(light.lamps.size()), light.projection.light.end(),
            moved.projection.light.end() - ptrdiff_t(light.lamps.size()));
  light.projection = std::move(moved.projection);
  if (!light.still_peaks.light.empty())
    keep_peaks(move_light(light.still_peaks, basis, rotation, axes, request.light_order).projection, light);
  return {};
}

std::vector<Vec3> seen_emission(const Scene& scene, const LightBasis& basis, const std::vector<Vec3>& lamps) {
  std::vector<Vec3> emission;
  if (basis.groups.empty()) return emission;
  const bool one = basis.groups.size() == 1 && basis.groups[0] == std::string("all");
  for (const Material& m : scene.materials) {
    const auto group = one ? basis.groups.begin() : std::find(basis.groups.begin(), basis.groups.end(), m.name);
    emission.push_back(group == basis.groups.end() ? Vec3(0)
                                                   : m.emissive * lamps[size_t(group - basis.groups.begin())]);
  }
  return emission;
}

}  // namespace lambent

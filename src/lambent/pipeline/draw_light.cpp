#include <lambent/pipeline/draw_light.h>

#include <lambent/light/lamps.h>
#include <lambent/light/peaks.h>
#include <lambent/light/project.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

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

// What is known of the environment's first `order` bands; null: nothing.
const KnownHarmonics* harmonics_for(const Surroundings& around, int order) {
  return around.known && around.known->order == order ? around.known.get() : nullptr;
}

// --window auto. Lobes that stand still hold the lamps already; turned copies of one ring as the bands do that they
// span.
void find_peaks(const DrawRequest& request, const Surroundings& around, const LightBasis& basis, ColumnLight& out) {
  const bool copies = basis.order == 0 && !basis.lobes.empty() && basis.lobe_kind == LobeKind::band_limited;
  if (!copies && (!basis.lobes.empty() || basis.order == 0)) return;
  const int bands = copies ? int(basis.lobes[0].sharpness) : basis.order;
  const int order = request.light_order ? std::min(request.light_order, bands) : bands;
  const std::vector<Vec3>& all = out.projection.light;
  const KnownHarmonics* known = copies ? nullptr : harmonics_for(around, order);
  if (known && known->rest.empty()) known = nullptr;
  const std::vector<Vec3> rest =
      known ? project_light(known->rest, basis, around.rotation).light
            : project_light(without_peaks(*around.env, order), basis, around.rotation, copies ? 0 : order).light;
  // As much as is proportional to all light: that of the first harmonic, or of all copies, which are of one integral.
  const auto luminance_of = [&](const std::vector<Vec3>& light) {
    return luminance(
        std::accumulate(light.begin(), light.begin() + (copies ? ptrdiff_t(basis.lobes.size()) : 1), Vec3(0.0f)));
  };
  const double light = luminance_of(all), sharp = light - luminance_of(rest);
  if (!(sharp > least_sharp * light)) return;
  out.sharp = sharp / light, out.lamps_found = known ? known->lamps : int(find_lamps(*around.env, 8).size());
  for (size_t k = 0; k < all.size(); ++k) out.peaks.push_back(all[k] - rest[k]);
}

}  // namespace

KnownHarmonics know_harmonics(const Environment& env, int order, bool peaks) {
  KnownHarmonics out{order, project_environment(env, order), {}, 0};
  if (peaks) out.rest = project_environment(without_peaks(env, order), order);
  if (peaks) out.lamps = int(find_lamps(env, 8).size());
  return out;
}

void soften_peaks(ColumnLight& light) {
  const std::vector<float> w = sh_window(ShWindow::lanczos, int(light.projection.window.size()));
  for (size_t k = 0; k < light.peaks.size(); ++k) {
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
    const int order = request.light_order ? std::min(request.light_order, basis.order) : basis.order;
    const KnownHarmonics* known = basis.lobes.empty() ? harmonics_for(around, order) : nullptr;
    out.projection = known ? project_light(known->all, basis, around.rotation, applied)
                           : project_light(*around.env, basis, around.rotation, order, applied);
    if (knows_shadows) find_peaks(request, around, basis, out);
  } else {
    out.projection.light.assign(basis.count(), Vec3(0.0f));
    const int order = request.light_order ? std::min(request.light_order, basis.order) : basis.order;
    out.projection.window = sh_window(*window, order);
  }
  std::copy(out.lamps.begin(), out.lamps.end(), out.projection.light.end() - ptrdiff_t(out.lamps.size()));
  return out;
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

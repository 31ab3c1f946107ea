#include <lambent/pipeline/bake_parse.h>

#include <lambent/brdf/parse_brdf.h>
#include <lambent/light/lamps.h>
#include <lambent/pipeline/bake_lightmap.h>
#include <lambent/pipeline/parse.h>
#include <lambent/scene/exclude.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/lights.h>
#include <lambent/scene/load.h>
#include <lambent/scene/pose.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <charconv>
#include <map>
#include <set>

namespace lambent {
namespace {

constexpr double least_error = 1e-4;

constexpr int max_lamps = 64, max_directional = 256;
constexpr const char* light_syntax =
    "sh:BANDS, sh:BANDS+lamps:COUNT@ENV, directional:COUNT, compact:COUNT, steerable:BANDS, or "
    "haar:SIZE[,error=ERROR|,keep=FRACTION]";

// KIND or KIND:N, where N is the number of rows (svd), bands (sh, hemisphere, hsh) or lobes (directional).
Result<void> parse_outgoing(const std::string& text, MatrixOptions& matrix) {
  const size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const auto kind = std::find(std::begin(outgoing_names), std::end(outgoing_names), name);
  if (kind == std::end(outgoing_names))
    return Error{"--outgoing",
                 "must be map, phong, svd:ROWS, sh:BANDS, hemisphere:BANDS, hsh:BANDS or directional:COUNT, not \"" +
                     text + "\"",
                 true};
  matrix.outgoing = OutgoingKind(kind - std::begin(outgoing_names));
  // Fewer rows than the default where incident light has no more.
  matrix.svd_rows = std::min(matrix.svd_rows, sh_count(matrix.incident_order));
  if (colon == std::string::npos) return {};
  if (matrix.outgoing == OutgoingKind::map || matrix.outgoing == OutgoingKind::phong)
    return Error{"--outgoing", name + " takes no number: --incident-order says how many rows it has", true};
  auto number = parse_numbers(text.substr(colon + 1), 1, "--outgoing");
  if (!number) return number.error();
  const float n = (*number)[0];
  if (matrix.outgoing == OutgoingKind::directional) {
    if (n != std::floor(n) || n < 4 || n > float(max_outgoing_lobes))
      return Error{
          "--outgoing",
          fmt::format("expects a whole number from 4 to {} after directional:, not \"{}\"", max_outgoing_lobes, text),
          true};
    matrix.outgoing_lobes = int(n);
    return {};
  }
  if (n != std::floor(n) || n < 1 || n > 64)
    return Error{"--outgoing", "expects a whole number from 1 to 64 after the colon, not \"" + text + "\"", true};
  (matrix.outgoing == OutgoingKind::svd ? matrix.svd_rows : matrix.outgoing_order) = int(n);
  return {};
}

Result<int> parse_whole(const std::string& text, int least, int most, const std::string& what) {
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || value < least || value > most)
    return Error{"--light", fmt::format("{} must be a whole number from {} to {}, not \"{}\"", what, least, most, text),
                 true};
  return value;
}

// lamps:COUNT@ENV, added to the lobes; a lamp that has a lobe already is left out.
Result<void> parse_lamps(const std::string& term, BakeOptions& bake, const Job& job) {
  constexpr double nearly_one = 0.99;
  const size_t at = term.find('@');
  if (!term.starts_with("lamps:") || at == std::string::npos || at + 1 == term.size())
    return Error{"--light", "expects lamps:COUNT@ENV after the plus sign, not \"" + term + "\"", true};
  auto count = parse_whole(term.substr(6, at - 6), 1, max_lamps, "the count after lamps:");
  if (!count) return count.error();
  const std::string path = term.substr(at + 1);
  auto env = load_environment(path);
  if (!env) return env.error();
  for (const std::string& w : env->warnings) job.warn(w);
  const std::vector<Lobe> found = find_lamps(*env, *count);
  if (found.size() < size_t(*count))
    job.warn(fmt::format("{}: has {}{} out, not {}", path, found.size(),
                         found.size() == 1 ? " lamp that stands" : " lamps that stand", *count));
  for (const Lobe& lamp : found)
    if (std::none_of(bake.lobes.begin(), bake.lobes.end(),
                     [&](const Lobe& known) { return lobe_overlap(bake.lobe_kind, known, lamp) > nearly_one; }))
      bake.lobes.push_back(lamp);
  return {};
}

// Sets the columns of light that `text` asks for; loads the environment it names, if any.
Result<void> parse_light(const std::string& text, BakeOptions& bake, const Job& job) {
  const std::string name = text.substr(0, text.find(':'));
  if (name == "directional" || name == "compact" || name == "steerable") {
    if (name.size() == text.size()) return Error{"--light", "expects a number after " + name + ":", true};
    const bool bands = name == "steerable", compact = name == "compact";
    auto count = parse_whole(text.substr(name.size() + 1),
                             bands     ? 1
                             : compact ? 10
                                       : 4,
                             bands ? max_sh_order : max_directional,
                             std::string(bands ? "the bands" : "the count") + " after " + name + ":");
    if (!count) return count.error();
    bake.order = 0;
    bake.lobe_kind = bands ? LobeKind::band_limited : compact ? LobeKind::compact : LobeKind::von_mises_fisher;
    bake.lobes = bands ? steerable_lobes(*count) : even_lobes(*count, bake.lobe_kind);
    return {};
  }
  if (text.starts_with("haar:")) return Error{"--light", "haar is of diffuse transfer: leave --transfer out", true};
  if (!text.starts_with("sh:"))
    return Error{"--light", "must be " + std::string(light_syntax) + ", not \"" + text + "\"", true};
  const size_t plus = text.find('+');
  auto order =
      parse_whole(text.substr(3, plus == std::string::npos ? plus : plus - 3), 1, max_sh_order, "the bands after sh:");
  if (!order) return order.error();
  bake.order = *order;
  if (plus == std::string::npos) return {};
  for (size_t from = plus + 1; from != std::string::npos;) {
    const size_t next = text.find("+lamps:", from);
    const std::string term = text.substr(from, next == std::string::npos ? next : next - from);
    if (auto ok = parse_lamps(term, bake, job); !ok) return ok;
    from = next == std::string::npos ? next : next + 1;
  }
  if (bake.lobes.size() > size_t(max_lamps))
    return Error{"--light", fmt::format("has {} lamps in all, more than {}", bake.lobes.size(), max_lamps), true};
  return {};
}

// "haar:SIZE", with what is kept after a comma.
Result<void> parse_haar(const std::string& text, BakePlan& plan) {
  const size_t comma = text.find(',');
  auto size = parse_whole(text.substr(5, comma == std::string::npos ? comma : comma - 5), 16, max_cube_size,
                          "the size after haar:");
  if (!size) return size.error();
  if ((*size & (*size - 1)) != 0) return Error{"--light", "haar takes a cube of 16, 32, 64, 128 or 256 texels", true};
  plan.visibility.size = *size, plan.haar = {.error = 0.02};
  if (comma == std::string::npos) return {};
  const std::string kept = text.substr(comma + 1);
  const bool share = kept.starts_with("keep=");
  if (share || kept.starts_with("error="))
    if (auto n = parse_numbers(kept.substr(kept.find('=') + 1), 1, "--light"); n && (*n)[0] >= 0 && (*n)[0] < 1) {
      (share ? plan.haar.keep : plan.haar.error) = double((*n)[0]);
      if (!share || plan.haar.keep > 0) return {};
    }
  return Error{"--light", "expects error=ERROR or keep=FRACTION below 1 after the comma, not \"" + kept + "\"", true};
}

// "k" or "converge:EPS".
Result<void> parse_bounces(const std::string& text, int& count, double& converge) {
  const std::string prefix = "converge:";
  if (text.starts_with(prefix)) {
    auto n = parse_numbers(text.substr(prefix.size()), 1, "--bounces");
    if (!n) return n.error();
    converge = double((*n)[0]);
    if (converge > 0 && converge < 1) return {};
    return Error{"--bounces", "converge needs a residual between 0 and 1, not " + text.substr(prefix.size()), true};
  }
  const char* end = text.data() + text.size();
  const auto [stop, status] = std::from_chars(text.data(), end, count);
  if (status != std::errc() || stop != end || count < 0 || count > 64)
    return Error{"--bounces", "expects a number from 0 to 64, or converge:EPS, not \"" + text + "\"", true};
  return {};
}

// "2%" or "0.02".
Result<double> parse_error(const std::string& text) {
  const bool percent = text.ends_with("%");
  const auto number = parse_numbers(percent ? text.substr(0, text.size() - 1) : text, 1, "--error");
  const double error = number ? double((*number)[0]) / (percent ? 100 : 1) : 0;
  if (error >= least_error && error <= 1) return error;
  return Error{"--error", "must lie between 0.01% and 100%, not \"" + text + "\"", true};
}

constexpr size_t fewest_traced = 6'000;

struct Quality {
  double error;
  float shortest;         // edges, as parts of the diagonal
  double triangles_more;  // at most, of those that there are,
  size_t triangles;       // and so many
  double lightmap_error;
  size_t texels;  // of a lightmap, at most
};
const std::map<std::string, Quality> qualities{{"preview", {0.1, 2e-3f, 0.5, 30'000, 0.1, 60'000}},
                                               {"good", {0.025, 5e-4f, 1, 150'000, 0.02, 2'500'000}},
                                               {"final", {0.01, 1.25e-4f, 3, 1'000'000, 0.01, 8'000'000}}};

// How well: rays and mesh.
Result<void> plan_error(const BakeRequest& r, BakePlan& plan) {
  const Quality& q = qualities.at(r.quality);
  double error = plan.kind == BakeKind::lightmap ? q.lightmap_error : q.error;
  if (!r.error.empty()) {
    auto parsed = parse_error(r.error);
    if (!parsed) return parsed.error();
    error = *parsed;
  }
  if (r.samples == 0) plan.bake.error = error;
  plan.bake.seconds = r.time;
  plan.adapts = plan.kind == BakeKind::diffuse && r.receivers == "vertices" && r.shadows == "on" &&
                r.subsurface.empty() && r.rooms.empty() &&
                (r.adapt == "on" || (r.adapt == "auto" && r.samples == 0 && r.max_edge == 0));
  // A mesh that the request makes as fine as it wants may be finer than light is.
  if (plan.kind == BakeKind::diffuse && r.receivers == "vertices" && r.subsurface.empty() && r.rooms.empty() &&
      r.adapt != "off")
    plan.bake.thin = fewest_traced;
  plan.adapt.error = 0.8 * error, plan.adapt.shortest = q.shortest, plan.adapt.seed = r.seed;
  if (r.time >= 0) plan.adapt.seconds = 0.4 * r.time;  // the rest is for the bake
  plan.most_texels = q.texels;
  plan.adapt.more = q.triangles_more, plan.adapt.triangles = q.triangles;
  return {};
}

Result<int> parse_visibility(const std::string& text) {
  if (text == "binary") return 1;
  int bits = 0;
  const char* end = text.data() + text.size();
  if (text.starts_with("bits:"))
    if (const auto [stop, status] = std::from_chars(text.data() + 5, end, bits);
        status == std::errc() && stop == end && bits >= 2 && bits <= max_visibility_bits)
      return bits;
  return Error{"--visibility",
               fmt::format("must be binary, or bits:N with N from 2 to {}, not \"{}\"", max_visibility_bits, text),
               true};
}

LightmapOptions lightmap_options(const BakeRequest& r, const BakeOptions& bake, double converge) {
  LightmapOptions o;
  o.order = r.order, o.samples = std::max(r.samples, 1), o.lamp_samples = r.lamp_samples, o.bounces = bake.bounces;
  o.converge = converge, o.solver = solver_names.at(r.solver), o.directional = *directional_kind(r.directional);
  o.memory = r.memory, o.gather = r.gather == "hemicube" ? GatherKind::hemicube : GatherKind::rays;
  o.seed = r.seed, o.precision = bake.precision, o.keep_terms = r.terms, o.projection = bake.projection;
  o.error = r.samples == 0 ? bake.error : 0, o.seconds = r.time, o.denoise = r.denoise == "on";
  return o;
}

// Limits that only several options together have.
Result<void> check_orders(const BakePlan& plan, const BakeRequest& r) {
  const bool glossy = plan.kind == BakeKind::matrix || plan.kind == BakeKind::glossy_zonal;
  const int order = plan.bake.order;
  if (plan.kind == BakeKind::factors) {
    if (!plan.bake.lobes.empty()) return Error{"--light", "--factors multiplies harmonics: leave lobes out", true};
    if (order + r.incident_order - 1 > max_sh_order)
      return Error{"--factors",
                   fmt::format("needs the bands of the light and of incident light, less one, and {} is "
                               "all there are",
                               max_sh_order),
                   true};
  }
  if (glossy && plan.matrix.outgoing == OutgoingKind::svd && plan.matrix.svd_rows > sh_count(r.incident_order))
    return Error{"--outgoing",
                 fmt::format("svd:{} is more rows than the {} that --incident-order {} has", plan.matrix.svd_rows,
                             sh_count(r.incident_order), r.incident_order),
                 true};
  if (glossy && order == 0)
    return Error{"--light", "lobes without harmonics cannot be baked with --transfer matrix", true};
  if (glossy && order + r.incident_order > max_sh_order + 1)
    return Error{"--incident-order", fmt::format("and the bands of the light may be {} together", max_sh_order + 1),
                 true};
  if (!plan.bake.lobes.empty() && plan.matrix.simulate_paths && plan.bake.bounces > 0)
    return Error{"--light", "lobes do not bounce along --simulate paths: leave it out, or bake with --bounces 0", true};
  if (!r.lattice.empty() && order + r.lattice_order > max_sh_order + 1)
    return Error{"--lattice-order", fmt::format("and the bands of the light may be {} together", max_sh_order + 1),
                 true};
  return {};
}

}  // namespace

const std::map<std::string, Solver> solver_names{{"jacobi", Solver::jacobi},
                                                 {"gauss-seidel", Solver::gauss_seidel},
                                                 {"southwell", Solver::southwell},
                                                 {"gmres", Solver::gmres}};

Result<BakePlan> plan_of(const BakeRequest& r, const Job& job) {
  BakePlan plan;
  plan.kind = kind_of(r);
  BakeOptions& b = plan.bake;
  b.samples = std::max(r.samples, 1), b.memory = r.memory, b.seed = r.seed, b.shadows = r.shadows == "on";
  b.projection = r.projection == "least-squares" ? Projection::least_squares : Projection::collocation;
  if (r.receivers == "meshless") b.meshless = size_t(r.surfels);
  b.keep_terms = r.terms, b.denoise = r.denoise == "on" && b.projection == Projection::collocation;
  if (auto ok = plan_error(r, plan); !ok) return ok.error();
  const Precision precision = r.precision == "half" ? Precision::half : Precision::single;
  const bool lobes = plan.kind == BakeKind::zonal || plan.kind == BakeKind::glossy_zonal;
  b.precision = lobes ? Precision::single : precision;  // lobes are rounded once, when they are fitted
  double converge = 0;
  if (auto ok = parse_bounces(r.bounces, b.bounces, converge); !ok) return ok.error();
  b.order = r.order;
  if (!r.light.empty() && plan.kind != BakeKind::wavelets)
    if (auto ok = parse_light(r.light, b, job); !ok) return ok.error();
  plan.matrix.incident_order = r.incident_order, plan.matrix.grid = r.view_map;
  plan.matrix.simulate_paths = r.simulate == "paths";
  if (auto ok = parse_outgoing(r.outgoing, plan.matrix); !ok) return ok.error();
  plan.zonal.lobes = r.lobes, plan.zonal.precision = precision;
  plan.lattice = {r.lattice_order, r.samples > 0 ? r.samples : 1024, r.memory, r.seed, precision};
  if (!r.compress.empty())
    if (auto ok = parse_cpca(r.compress, plan.cpca); !ok) return ok.error();
  if (!r.subsurface.empty()) {
    auto medium = parse_medium(r.subsurface);
    if (!medium) return Error{"--subsurface", medium.error().text(), true};
    plan.subsurface.medium = *medium;
  }
  auto reflection = parse_reflection(r.brdf);
  if (!reflection) return reflection.error();
  plan.reflection = std::move(*reflection);
  plan.lightmap = lightmap_options(r, b, converge);
  auto bits = parse_visibility(r.visibility);
  if (!bits) return bits.error();
  plan.visibility = {r.cube, *bits, r.memory};
  if (plan.kind == BakeKind::wavelets)
    if (auto ok = parse_haar(r.light, plan); !ok) return ok.error();
  plan.indirect.surfels = size_t(r.surfels), plan.indirect.samples = b.samples, plan.indirect.seed = r.seed;
  plan.indirect.directional = *directional_kind(r.directional), plan.indirect.all_gather = r.gatherers == "all";
  if (auto ok = check_orders(plan, r); !ok) return ok.error();
  return plan;
}

namespace {

const std::map<std::string, LightUnits> unit_names{
    {"lumen", LightUnits::lumen}, {"watt", LightUnits::watt}, {"raw", LightUnits::raw}};

std::string generator_of(const Scene& scene) {
  if (!scene.document) return {};
  const auto& asset = scene.document->json["asset"];
  const auto generator = asset.find("generator");
  return generator != asset.end() && generator->is_string() ? generator->get<std::string>() : std::string();
}

// As --light-units says; a guess is told.
Result<void> set_light_units(Scene& scene, const std::string& text, const Job& job) {
  if (text != "auto" && scene.lights.empty())
    return Error{"--light-units", "has nothing to convert: the scene has no lamps (KHR_lights_punctual)", true};
  if (scene.lights.empty()) return {};
  const std::string generator = generator_of(scene);
  const LightUnits units = text == "auto" ? guess_light_units(generator) : unit_names.at(text);
  convert_lights(scene.lights, units);
  if (text == "auto" && units != LightUnits::lumen)
    job.warn(fmt::format("{} lamp{} taken as \"{}\" writes them, {}; --light-units lumen takes them as they are",
                         scene.lights.size(), scene.lights.size() == 1 ? " is" : "s are", generator,
                         units == LightUnits::watt ? "at 683 lumens a watt, and divided by that to go with emission"
                                                   : "in watts, and those of points and spots divided by 4 pi"));
  return {};
}

// As --lamp says, but for the sky.
Result<void> scale_lamps(Scene& scene, const BakeRequest& r) {
  for (const std::string& text : r.lamp) {
    auto scale = parse_named_color(text, "--lamp");
    if (!scale) return scale.error();
    bool found = !r.sky.empty() && scale->name == sky_name;
    for (PunctualLight& light : scene.lights)
      if (light.name == scale->name) light.intensity *= scale->color, found = true;
    for (Material& m : scene.materials)
      if (m.name == scale->name && m.emissive != Vec3(0)) m.emissive *= scale->color, found = true;
    if (!found) return Error{"--lamp", "the scene has no lamp \"" + scale->name + "\"", true};
  }
  return {};
}

// Viewers show them as they are; transfer knows surfaces that are lit.
void warn_of_unlit(const Scene& scene, const Job& job) {
  std::set<uint32_t> unlit;
  for (const Part& part : scene.parts)
    if (scene.materials[part.material].unlit) unlit.insert(part.material);
  if (!unlit.empty())
    job.warn(std::to_string(unlit.size()) + (unlit.size() == 1
                                                 ? " unlit material is lit: a matte surface of its colour"
                                                 : " unlit materials are lit: matte surfaces of their colour"));
}

}  // namespace

Result<Scene> load_scene_of(const BakeRequest& r, const Job& job) {
  auto scene = r.loaded ? Result<Scene>(*r.loaded) : load_scene(r.scene);
  if (!scene) return scene;
  const std::vector<std::string> unknown = exclude_parts(*scene, r.exclude);
  if (!unknown.empty())
    return Error{"--exclude",
                 unknown[0] == unlit_word ? "the scene has no unlit material"
                                          : "the scene has no part or material \"" + unknown[0] + "\"",
                 true};
  if (scene->triangles.empty()) return Error{"--exclude", "leaves no triangle", true};
  for (const std::string& text : r.emit) {
    auto lamp = parse_named_color(text, "--emit");
    if (!lamp) return lamp.error();
    bool found = false;
    for (Material& m : scene->materials)
      if (m.name == lamp->name) m.emissive = lamp->color, m.emissive_texture = -1, found = true;
    if (!found) return Error{"--emit", "the scene has no material \"" + lamp->name + "\"", true};
  }
  if (r.transfer == "lightmap") {  // no other kind knows lamps
    if (auto ok = set_light_units(*scene, r.light_units, job); !ok) return ok.error();
    if (auto ok = scale_lamps(*scene, r); !ok) return ok.error();
  }
  for (Material& m : scene->materials) m.base_color = min(m.base_color, Vec3(r.max_albedo));
  if (r.ground) add_ground(*scene);
  if (r.max_edge > 0)
    if (auto ok = split_long_edges(*scene, r.max_edge); !ok) return ok.error();
  for (const std::string& w : scene->warnings) job.warn(w);
  warn_of_unlit(*scene, job);
  return scene;
}

Result<std::optional<AdaptReport>> adapt_scene(Scene& scene, const BakeRequest& request, const BakePlan& plan,
                                               const Job& job) {
  if (!plan.adapts) return std::optional<AdaptReport>();
  const auto animations = list_animations(scene);
  const bool moves = scene.document && (scene.document->json.contains("skins") || (animations && !animations->empty()));
  if (moves) {
    if (request.adapt == "on")
      return Error{"--adapt", "splits no mesh that moves: the scene has bones or an animation", true};
    return std::optional<AdaptReport>();
  }
  auto report = adapt(scene, plan.adapt, job.progress);
  if (!report) return report.error();
  return std::optional(*report);
}

Result<Lattice> lattice_of_request(const BakeRequest& r, const Scene& scene) {
  auto counts = parse_numbers(r.lattice, 3, "--lattice");
  if (!counts) return counts.error();
  for (float n : *counts)
    if (n != std::floor(n) || n < 1 || n > float(max_lattice_points))
      return Error{"--lattice",
                   fmt::format("expects three whole numbers from 1 to {}, not \"{}\"", max_lattice_points, r.lattice),
                   true};
  const int nx = int((*counts)[0]), ny = int((*counts)[1]), nz = int((*counts)[2]);
  Bounds box = default_lattice_box(scene, nx, ny, nz);
  if (!r.lattice_box.empty()) {
    auto b = parse_numbers(r.lattice_box, 6, "--lattice-box");
    if (!b) return b.error();
    box.min = {(*b)[0], (*b)[1], (*b)[2]}, box.max = {(*b)[3], (*b)[4], (*b)[5]};
    if (!all_at_most(box.min, box.max))
      return Error{"--lattice-box", "expects the lower corner first, then the upper", true};
    if (!all_at_most(max(abs(box.min), abs(box.max)), Vec3(1e9f)))
      return Error{"--lattice-box", "lies beyond 1e9", true};
  }
  return Lattice{box.min, box.max, nx, ny, nz};
}

Result<std::vector<float>> membrane_alphas(const std::string& text, const Scene& scene, const Receivers& receivers) {
  if (auto number = parse_numbers(text, 1, "--membrane")) {
    if (!((*number)[0] >= 0 && (*number)[0] <= 1))
      return Error{"--membrane", "lets through a share from 0 to 1, not " + text, true};
    return std::vector<float>(receivers.count(), (*number)[0]);
  }
  auto picture = load_image(text);
  if (!picture) return picture.error();
  if (scene.texcoords[0].empty())
    return Error{scene.path, "has no texture coordinates to look the membrane's picture up by"};
  std::vector<float> alphas(receivers.count());
  for (const auto* map : {&receivers.front, &receivers.back})
    for (size_t v = 0; v < map->size(); ++v) {
      if ((*map)[v] == none) continue;
      const Vec2 uv = scene.texcoords[0][v] - floor(scene.texcoords[0][v]);
      const int x = std::min(int(uv.x * float(picture->width)), picture->width - 1);
      const int y = std::min(int(uv.y * float(picture->height)), picture->height - 1);
      const float alpha = luminance(picture->at(x, y));
      alphas[(*map)[v]] = std::isfinite(alpha) ? std::clamp(alpha, 0.0f, 1.0f) : 0.0f;
    }
  return alphas;
}

}  // namespace lambent

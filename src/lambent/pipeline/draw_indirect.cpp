#include <lambent/pipeline/draw_indirect.h>

#include <lambent/core/clock.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/pipeline/text.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/append.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace lambent {
namespace {

constexpr uint64_t near_seed = 0x6ea7;

}  // namespace

bool StillLight::shines() const {
  return std::any_of(scales.begin(), scales.end(), [](Vec3 s) { return largest(s) > 0; });
}

Vec3 StillLight::scale_of(const std::string& name) const {
  const auto group = std::find(lamps.names.begin(), lamps.names.end(), name);
  return group == lamps.names.end() ? Vec3(1.0f) : scales[size_t(group - lamps.names.begin())];
}

IndirectQuality quality_of(const DrawRequest& request) {
  IndirectQuality quality;
  quality.near_samples = request.near_rays;
  return quality;
}

Result<void> repaint(const DrawRequest& request, Scene& scene, const Surfels& surfels, std::vector<Vec3>& albedos) {
  for (const std::string& text : request.albedo) {
    auto named = parse_named_color(text, "--albedo");
    if (!named) return named.error();
    if (!(largest(named->color) <= 1)) return Error{"--albedo", "a colour may be 1 at most", true};
    bool found = false;
    for (size_t i = 0; i < surfels.count(); ++i)
      if (surfels.names[surfels.materials[i]] == named->name) albedos[i] = named->color, found = true;
    for (size_t m = 0; m < scene.materials.size(); ++m) {
      Material& material = scene.materials[m];
      if (material.name != named->name) continue;
      found = true, material.base_color = named->color, material.base_color_texture = -1;
      for (const Part& part : scene.parts)
        if (part.material == m && !scene.colors.empty())
          std::fill_n(scene.colors.begin() + part.first_vertex, part.vertex_count, Vec3(1.0f));
    }
    if (!found) return Error{"--albedo", "the file has no material \"" + named->name + "\"", true};
  }
  return {};
}

Result<void> make_places(IndirectDrawing& d) {
  auto tracer = Tracer::build(d.scene, d.job.progress);
  if (!tracer) return tracer.error();
  d.tracer = std::move(*tracer), d.diagonal = bounds(d.scene).diagonal();
  d.search = std::make_unique<const SurfelSearch>(d.transfer.surfels, d.tracer, d.transfer.gather_level);
  const size_t leaves = d.transfer.surfels.count();
  d.places.resize(leaves), d.near_places.assign(leaves, {}), d.direct.assign(leaves, Vec3(0.0f));
  ProgressStage stage(d.job.progress, "places", leaves);
  parallel_for(leaves, 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end && !stage.cancelled(); ++i, stage.advance())
      d.places[i] =
          places_of_leaf(d.scene, d.tracer, d.transfer.surfels, *d.search, uint32_t(i), IndirectQuality().places);
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  return {};
}

void read_receivers(IndirectDrawing& d, DirectionalKind directional) {
  const bool directed = directional != DirectionalKind::none;
  if (directed || !d.objects.made.empty()) send_indirect(d.transfer, d.solve, d.direct);
  if (directed) read_directional_indirect(d.transfer, d.solve, directional, d.relit);
  else read_indirect(d.transfer, d.solve, d.relit);
}

namespace {

// All direct light at leaves: of lamps that stand where they stood it is known, and their lights add up.
void light_lamps(IndirectDrawing& d) {
  const size_t leaves = d.direct.size(), most = size_t(d.request.frame_leaves);
  d.lit.resize(d.lamps.size()), d.evaluated = d.leaves_lit = 0;
  for (size_t k = 0; k < d.lamps.size(); ++k) {
    LitLamp& lit = d.lit[k];
    const bool first = lit.at_leaves.empty();
    if (!first && lit.behind == 0 && is_same(lit.lamp, d.lamps[k])) continue;
    lit.lamp = d.lamps[k], ++d.evaluated;
    if (first || most == 0) {
      lit.at_leaves.resize(leaves), light_lamp(d, k, 0, leaves, {}), d.leaves_lit += leaves;
      if (most > 0) lit.found = lit.at_leaves, lit.from.assign(leaves, lit.lamp.light.position);
    } else {
      d.leaves_lit += follow_lamp(d, k, most);
    }
  }
  sum_direct(d);
}

// Direct light at surfels, and the bounces that follow, from where the frame before had come; fastest times are kept.
void light_surfels(IndirectDrawing& d, DirectionalKind directional, bool first) {
  auto start = Clock::now();
  light_lamps(d);
  d.ray_seconds = std::min(d.ray_seconds, seconds_since(start)), start = Clock::now();
  if (d.request.frame_bounces == 0) solve_indirect(d.transfer, d.solve, d.direct, 1e-3, 64, !first);
  else if (first) std::fill(d.solve.x.begin(), d.solve.x.end(), Vec3(0.0f));
  for (int k = 0; k < d.request.frame_bounces; ++k) step_indirect(d.transfer, d.solve, d.direct);
  d.solve_seconds = std::min(d.solve_seconds, seconds_since(start)), start = Clock::now();
  if (const size_t left = part_near_light(d); left > 0 && first)
    d.job.warn(
        fmt::format("what {} lamps light near themselves is read off surfels, as softly as those lie apart: the "
                    "first 64 alone are looked at more closely",
                    left));
  d.near_seconds = std::min(d.near_seconds, seconds_since(start)), start = Clock::now();
  read_receivers(d, directional);
  d.read_seconds = std::min(d.read_seconds, seconds_since(start));
}

void warn_of_dark_lamps(const IndirectDrawing& d) {
  for (size_t k = 0; k < d.lit.size(); ++k)
    if (std::all_of(d.lit[k].at_leaves.begin(), d.lit[k].at_leaves.end(), [](Vec3 l) { return !(largest(l) > 0); }))
      d.job.warn(fmt::format("lamp {} lights no surface: it is black, inside something, or turned away", k + 1));
}

// Objects of --insert, each baked alone; the scene knows nothing of them but what the eye and shadow rays see.
Result<void> make_objects(IndirectDrawing& d) {
  for (const std::string& text : d.request.insert) {
    auto insertion = parse_insertion(text, d.scene.origin);
    if (!insertion) return insertion.error();
    const IndirectLattice& f = *d.transfer.lattice;
    auto made = make_inserted(*insertion, f.lattice, f.order, d.job);
    if (!made) return made.error();
    d.objects.made.push_back(std::move(*made));
  }
  ObjectsInScene& o = d.objects;
  if (o.made.empty()) return {};
  o.scene = d.scene, o.first = d.scene.triangles.size();
  for (const auto& object : o.made) append_scene(o.scene, object->scene);
  auto tracer = Tracer::build(o.scene, d.job.progress);
  if (!tracer) return tracer.error();
  o.tracer = std::move(*tracer);
  if (!d.still.lamps.of_triangle.empty()) d.still.lamps.of_triangle.resize(o.scene.triangles.size(), none);
  return {};
}

Result<void> light_objects(IndirectDrawing& d) {
  ObjectsInScene& o = d.objects;
  if (o.made.empty()) return {};
  Relit free_space;
  read_lattice_indirect(d.transfer, d.solve, free_space);
  o.lit = RelitScene{};
  for (const auto& object : o.made)
    if (auto ok = insert_object(o.lit, object->scene, object->receivers, object->transfer, d.transfer.lattice->lattice,
                                free_space);
        !ok)
      return ok;
  o.basis = corner_receivers(o.lit.scene, o.lit.front, o.lit.back);
  return {};
}

Vec3 read_surfels(const IndirectDrawing& d, const Kernels& k) {
  Vec3 light(0.0f);
  for (size_t i = 0; i < k.count; ++i) light += k.weight[i] * d.solve.x[k.surfel[i]];
  return light;
}

// A lamp that the eye sees before anything else: its radiance.
std::optional<Vec3> seen_lamp(const IndirectDrawing& d, Vec3 eye, Vec3 direction, float distance) {
  std::optional<Vec3> seen;
  for (const MovingLamp& lamp : d.lamps) {
    if (lamp.kind != MovingLamp::Kind::sphere) continue;
    const Vec3 way = lamp.centre - eye;
    const float along = dot(way, direction), beside2 = dot(way, way) - along * along,
                deep2 = lamp.radius * lamp.radius - beside2;
    if (!(deep2 >= 0) || dot(way, way) <= lamp.radius * lamp.radius) continue;
    const float there = along - std::sqrt(deep2);
    if (there > 0 && there < distance) distance = there, seen = lamp.radiance;
  }
  return seen;
}

// What the surface sends out by itself.
Vec3 glow(const IndirectDrawing& d, const Hit& hit) {
  if (d.still.lamps.of_triangle.empty()) return Vec3(0.0f);
  const uint32_t lamp = d.still.lamps.of_triangle[hit.triangle];
  const Triangle& triangle = d.drawn().triangles[hit.triangle];
  if (lamp == none || !emits(d.drawn(), triangle, hit.front)) return Vec3(0.0f);
  return d.still.scales[d.still.lamps.area[lamp].group] * emission(d.drawn(), triangle, hit.u, hit.v);
}

}  // namespace

Kernels kernels_at(const IndirectDrawing& d, const Hit& hit) { return d.search->kernels(surface_place(d.scene, hit)); }

namespace {

// Direct light of the lamps in their order, and of what stands still.
Vec3 direct_at_pixel(const IndirectDrawing& d, const IndirectQuality& quality, Vec3 origin, Vec3 normal, uint64_t key,
                     std::span<Vec3> known) {
  const auto once = [&](size_t k, auto light) {
    if (known.empty()) return light();
    if (std::isnan(known[k].x)) known[k] = light();
    return known[k];
  };
  Vec3 sum(0.0f);
  for (size_t k = 0; k < d.lamps.size(); ++k)
    sum += once(
        k, [&] { return direct_light(d.sight(), d.lamps[k], origin, normal, quality.pixel_samples, hash64(key, k)); });
  return sum + once(d.lamps.size(), [&] {
           return scaled_sum(d.still,
                             still_light(d, d.drawn(), d.sight(), origin, normal, quality.still_pixel_samples, key));
         });
}

}  // namespace

Vec3 shade_indirect(const IndirectDrawing& d, Vec3 eye, const IndirectQuality& quality, const Hit& hit, Vec3 direction,
                    const KnownPlace& known, const IndirectShade& bounced) {
  using Colour = RenderOptions::Show;
  const bool shows_direct = d.show.part != Show::Part::indirect, shows_indirect = d.show.part != Show::Part::direct;
  const Scene& scene = d.drawn();
  const Triangle& triangle = scene.triangles[hit.triangle];
  if (d.show.colour == Colour::albedo) return albedo(scene, triangle, hit.u, hit.v);
  if (shows_direct)
    if (const auto lamp = seen_lamp(d, eye, direction, hit.distance)) return *lamp;
  const SurfacePlace at = surface_place(scene, hit);
  const Vec3 face = (hit.front ? 1.0f : -1.0f) * unit_normal(scene, triangle, at.normal);
  const Vec3 origin = at.position + face * receiver_lift(at.position, 0, d.diagonal);
  const uint64_t key =
      hash64(uint64_t(std::bit_cast<uint32_t>(hit.u)) << 32 | std::bit_cast<uint32_t>(hit.v), hit.triangle);
  Vec3 light(0.0f);
  if (shows_indirect && bounced) {
    light += bounced(hit, direction, at);
  } else if (shows_indirect) {
    const Kernels kernels = known.kernels ? *known.kernels : d.search->kernels(at);
    light = read_surfels(d, kernels) +
            near_bounce(d, origin, at.normal, face, kernels, quality.near_samples, hash64(key, near_seed));
    light = max(light, Vec3(0.0f));
  }
  if (shows_direct) light += direct_at_pixel(d, quality, origin, at.normal, key, known.lights);
  if (d.show.colour != Colour::product) return light;
  const Vec3 sent = shows_direct ? glow(d, hit) : Vec3(0.0f);
  return albedo(scene, triangle, hit.u, hit.v) * light + sent;
}

IndirectShade bounced_light(const IndirectDrawing& d, const Baked& baked, const RenderOptions& on_objects,
                            const RenderOptions& in_file) {
  const SurfaceShade at_objects =
      d.objects.tracer ? relit_shade(d.objects.lit.scene, d.objects.basis, d.objects.lit.relit, on_objects)()
                       : SurfaceShade();
  const SurfaceShade at_receivers = d.request.at == "receivers" ? relit_shade(d.scene, baked.basis, d.relit, in_file)()
                                                                : SurfaceShade();
  if (!at_objects && !at_receivers) return {};
  return [&d, at_receivers, at_objects](const Hit& hit, Vec3 direction, const SurfacePlace& at) {
    if (at_objects && hit.triangle >= d.objects.first) {
      Hit own = hit;
      own.triangle -= uint32_t(d.objects.first);
      return at_objects(own, direction);
    }
    return at_receivers ? at_receivers(hit, direction) : max(read_surfels(d, d.search->kernels(at)), Vec3(0.0f));
  };
}

void set_sky(IndirectDrawing& d, std::optional<Environment> turned) {
  d.still.sky = std::move(turned), d.still.at_leaves.clear();
  d.still.lamps = make_lamps(d.scene, d.still.sky ? &*d.still.sky : nullptr, true);
}

Result<void> read_lamps(IndirectDrawing& d) {
  StillLight& still = d.still;
  std::vector<Vec3> scales(still.lamps.groups(), Vec3(1.0f));
  std::vector<std::string> moving;
  for (const std::string& text : d.request.lamp) {
    if (names_moving_lamp(text)) {
      moving.push_back(text);
      continue;
    }
    auto named = parse_named_color(text, "--lamp");
    if (!named) return named.error();
    const auto group = std::find(still.lamps.names.begin(), still.lamps.names.end(), named->name);
    if (group == still.lamps.names.end())
      return Error{"--lamp",
                   "the scene has no lamp \"" + named->name + "\"; it has " +
                       (still.lamps.names.empty() ? "none" : fmt::format("{}", fmt::join(still.lamps.names, ", "))) +
                       "; or it is " + moving_lamp_syntax,
                   true};
    scales[size_t(group - still.lamps.names.begin())] = named->color;
  }
  auto lamps = parse_moving_lamps(moving, d.scene.origin);
  if (!lamps) return lamps.error();
  if (lamps->empty() && still.lamps.groups() == 0 && d.show.colour != RenderOptions::Show::albedo)
    return Error{"--lamp", "or --env is needed to light the scene, which has no lamp of its own: e.g. point@0,2,0=10",
                 true};
  std::vector<LampPath> paths;
  for (const std::string& text : d.request.move) {
    auto path = parse_lamp_path(text, *lamps, d.scene.origin);
    if (!path) return path.error();
    paths.push_back(std::move(*path));
  }
  still.scales = std::move(scales), d.lamps = std::move(*lamps), d.paths = std::move(paths);
  return {};
}

Scene scene_with_lamps(const IndirectDrawing& d) {
  Scene scene = d.scene;
  for (Material& m : scene.materials) m.emissive = d.still.scale_of(m.name) * m.emissive;
  for (PunctualLight& l : scene.lights) l.intensity = d.still.scale_of(l.name) * l.intensity;
  add_lamps(scene, d.lamps);
  return scene;
}

Result<Drawing> draw_indirect(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto show = parse_show(request.show);
  if (!show) return show.error();
  const DirectionalKind directional = directional_of(baked.surface);
  IndirectDrawing d{request, job, std::get<IndirectTransfer>(baked.surface.store), *show};
  d.scene = baked.scene;
  auto around = surroundings_of(request, job);
  if (!around) return around.error();
  std::optional<Environment> sky;
  if (around->env) sky = request.env_rotate.empty() ? *around->env : rotated(*around->env, around->rotation);
  set_sky(d, std::move(sky));
  if (auto ok = read_lamps(d); !ok) return ok.error();
  std::vector<double> times{request.time};
  if (!request.frames.empty()) {
    auto given = parse_frames(request.frames);
    if (!given) return given.error();
    times = *given;
  }
  auto view = parse_view(request.camera, request.size, d.scene);
  if (!view) return view.error();
  std::vector<Vec3> albedos = d.transfer.surfels.albedos;
  if (auto ok = repaint(request, d.scene, d.transfer.surfels, albedos); !ok) return ok.error();
  if (auto ok = make_places(d); !ok) return ok.error();
  if (d.tracer.lets_pass() && request.near_rays != DrawRequest().near_rays)
    job.warn("--near-rays is left aside: the scene lets light pass, and all bounces are read off surfels");
  const size_t leaves = d.transfer.surfels.count();
  {
    ProgressStage stage(job.progress, "lighting", leaves);
    light_leaves(d, 0, leaves, {}, &stage);
  }
  if (is_cancelled(job.progress)) return Error{"", "cancelled"};
  d.solve = make_indirect_solve(d.transfer, albedos);
  if (auto ok = make_objects(d); !ok) return ok.error();
  const RenderOptions options{view->width, view->height, request.spp, around->background(), show->colour};
  RenderOptions on_objects = options;  // light alone, which what is met multiplies by its colour
  on_objects.show = RenderOptions::Show::radiosity;
  RenderOptions in_file = on_objects;
  in_file.directional = directional;
  Drawing drawing;
  for (double time : times) {
    for (const LampPath& path : d.paths) move_lamp(d.lamps, path, time);
    light_surfels(d, directional, drawing.frames.empty());
    if (auto ok = light_objects(d); !ok) return ok.error();
    if (drawing.frames.empty()) warn_of_dark_lamps(d);
    auto image = render_surfaces(
        d.drawn(), d.sight(), view->camera, options,
        [&]() -> SurfaceShade {
          return [&, bounced = bounced_light(d, baked, on_objects, in_file)](const Hit& hit, Vec3 direction) {
            return shade_indirect(d, view->camera.eye, quality_of(request), hit, direction, {}, bounced);
          };
        },
        job.progress);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  const size_t receivers = d.transfer.receivers;
  drawing.summary.json = {
      {"receivers", receivers},           {"surfels", d.transfer.surfels.count()},
      {"frames", drawing.frames.size()},  {"bounces", d.solve.bounces},
      {"lamps_evaluated", d.evaluated},   {"leaves_lit", d.leaves_lit},
      {"residual", d.solve.residual},     {"shadow_ray_seconds", d.ray_seconds},
      {"solve_seconds", d.solve_seconds}, {"read_seconds", d.read_seconds},
      {"near_seconds", d.near_seconds},   {"relight_seconds", d.ray_seconds + d.solve_seconds + d.read_seconds}};
  drawing.summary.lines.emplace_back(
      "relit",
      fmt::format("shadow rays of {} surfels in {:.2f} ms, {} bounces in {:.2f} ms, {} receivers read in {:.2f} "
                  "ms",
                  human_count(d.transfer.surfels.count()), 1e3 * d.ray_seconds, d.solve.bounces, 1e3 * d.solve_seconds,
                  human_count(receivers), 1e3 * d.read_seconds));
  return drawing;
}

}  // namespace lambent

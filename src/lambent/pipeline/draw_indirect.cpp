#include <lambent/pipeline/draw_indirect.h>

#include <lambent/bake/surfels.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/pipeline/text.h>
#include <lambent/receivers/receivers.h>
#include <lambent/relight/indirect.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>

namespace lambent {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

constexpr int lamp_samples = 8, pixel_samples = 2;  // of a sphere: at a surfel; at a ray of a pixel

// Repaints walls: the scene that is seen, and the albedos of surfels.
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

struct IndirectDrawing {
  const DrawRequest& request;
  const Job& job;
  const IndirectTransfer& transfer;
  Show show;
  Scene scene{};  // repainted
  Tracer tracer{};
  float diagonal = 0;
  std::vector<MovingLamp> lamps{};
  std::vector<LampPath> paths{};
  IndirectSolve solve{};
  std::vector<Vec3> direct{};  // at surfels
  double ray_seconds = 1e9, solve_seconds = 1e9, read_seconds = 1e9;
};

// Direct light at surfels, and the bounces that follow; fastest times are kept.
void light_surfels(IndirectDrawing& d) {
  const Surfels& s = d.transfer.surfels;
  auto start = Clock::now();
  d.direct.resize(s.count());
  parallel_for(s.count(), 128, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3 origin = s.positions[i] + s.normals[i] * receiver_lift(s.positions[i], 0, d.diagonal);
      d.direct[i] = direct_light(d.tracer, d.lamps, origin, s.normals[i], lamp_samples, i);
    }
  });
  d.ray_seconds = std::min(d.ray_seconds, seconds_since(start)), start = Clock::now();
  solve_indirect(d.transfer, d.solve, d.direct);
  d.solve_seconds = std::min(d.solve_seconds, seconds_since(start)), start = Clock::now();
  Relit relit;
  read_indirect(d.transfer, d.solve, relit);
  d.read_seconds = std::min(d.read_seconds, seconds_since(start));
}

void warn_of_dark_lamps(const IndirectDrawing& d) {
  const Surfels& s = d.transfer.surfels;
  for (size_t k = 0; k < d.lamps.size(); ++k) {
    std::atomic<bool> lights = false;
    parallel_for(s.count(), 128, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end && !lights; ++i) {
        const Vec3 origin = s.positions[i] + s.normals[i] * receiver_lift(s.positions[i], 0, d.diagonal);
        if (largest(direct_light(d.tracer, {d.lamps[k]}, origin, s.normals[i], lamp_samples, i)) > 0) lights = true;
      }
    });
    if (!lights)
      d.job.warn(fmt::format("lamp {} lights no surface: it is black, inside something, or turned away", k + 1));
  }
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

Result<Image> shade(const IndirectDrawing& d, const SurfelSearch& search, const View& view) {
  RenderOptions options{view.width, view.height, d.request.spp, nullptr, d.show.colour};
  const bool shows_direct = d.show.part != Show::Part::indirect, shows_indirect = d.show.part != Show::Part::direct;
  return render_surfaces(
      d.scene, d.tracer, view.camera, options,
      [&]() -> SurfaceShade {
        return [&](const Hit& hit, Vec3 direction) {
          const Triangle& triangle = d.scene.triangles[hit.triangle];
          if (options.show == RenderOptions::Show::albedo) return albedo(d.scene, triangle, hit.u, hit.v);
          if (shows_direct)
            if (const auto lamp = seen_lamp(d, view.camera.eye, direction, hit.distance)) return *lamp;
          const SurfacePlace at = surface_place(d.scene, hit);
          Vec3 light(0.0f);
          if (shows_indirect) {
            const Kernels k = search.kernels(at);
            for (size_t i = 0; i < k.count; ++i) light += k.weight[i] * d.solve.x[k.surfel[i]];
            light = max(light, Vec3(0.0f));
          }
          if (shows_direct) {
            const Vec3 face = unit_normal(d.scene, triangle, at.normal);
            const Vec3 origin = at.position + (hit.front ? face : -face) * receiver_lift(at.position, 0, d.diagonal);
            const uint64_t key =
                hash64(uint64_t(std::bit_cast<uint32_t>(hit.u)) << 32 | std::bit_cast<uint32_t>(hit.v), hit.triangle);
            light += direct_light(d.tracer, d.lamps, origin, at.normal, pixel_samples, key);
          }
          return options.show == RenderOptions::Show::product ? albedo(d.scene, triangle, hit.u, hit.v) * light : light;
        };
      },
      d.job.progress);
}

Result<void> read_lamps(IndirectDrawing& d) {
  auto lamps = parse_moving_lamps(d.request.lamp, d.scene.origin);
  if (!lamps) return lamps.error();
  d.lamps = std::move(*lamps);
  for (const std::string& text : d.request.move) {
    auto path = parse_lamp_path(text, d.lamps, d.scene.origin);
    if (!path) return path.error();
    d.paths.push_back(std::move(*path));
  }
  return {};
}

}  // namespace

Result<Drawing> draw_indirect(const Baked& baked, const DrawRequest& request, const Job& job) {
  auto show = parse_show(request.show);
  if (!show) return show.error();
  IndirectDrawing d{request, job, std::get<IndirectTransfer>(baked.surface.store), *show};
  d.scene = baked.scene, d.diagonal = bounds(d.scene).diagonal();
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
  auto tracer = Tracer::build(d.scene, job.progress);
  if (!tracer) return tracer.error();
  d.tracer = std::move(*tracer);
  const SurfelSearch search(d.transfer.surfels, d.tracer, d.transfer.gather_level);
  d.solve = make_indirect_solve(d.transfer, albedos);
  Drawing drawing;
  for (double time : times) {
    for (const LampPath& path : d.paths) move_lamp(d.lamps, path, time);
    light_surfels(d);
    if (drawing.frames.empty()) warn_of_dark_lamps(d);
    auto image = shade(d, search, *view);
    if (!image) return image.error();
    drawing.frames.push_back(std::move(*image));
  }
  const size_t receivers = d.transfer.receivers;
  drawing.summary.json = {{"receivers", receivers},
                          {"surfels", d.transfer.surfels.count()},
                          {"frames", drawing.frames.size()},
                          {"bounces", d.solve.bounces},
                          {"residual", d.solve.residual},
                          {"shadow_ray_seconds", d.ray_seconds},
                          {"solve_seconds", d.solve_seconds},
                          {"read_seconds", d.read_seconds},
                          {"relight_seconds", d.ray_seconds + d.solve_seconds + d.read_seconds}};
  drawing.summary.lines.emplace_back(
      "relit",
      fmt::format("shadow rays of {} surfels in {:.2f} ms, {} bounces in {:.2f} ms, {} receivers read in {:.2f} "
                  "ms",
                  human_count(d.transfer.surfels.count()), 1e3 * d.ray_seconds, d.solve.bounces, 1e3 * d.solve_seconds,
                  human_count(receivers), 1e3 * d.read_seconds));
  return drawing;
}

}  // namespace lambent

// The window's frames, without a window: from a turn of the light, or of the camera, to the next picture
// (pipeline/live.h), 640 x 480, one ray a pixel; showing it is a texture's upload more. A vertex of blocks is timed by
// the processor time of one thread, so that other work on the machine makes little difference, beside our SIMD sum over
// the whole standard basis.
#include "bench.h"

#include <lambent/core/parallel.h>
#include <lambent/light/cube_light.h>
#include <lambent/pipeline/draw_blocks.h>
#include <lambent/pipeline/live.h>
#include <lambent/render/products.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <chrono>

namespace lambent::bench {
namespace {

struct Frames {
  double seconds = 0;  // a frame
  LiveTimes times;     // of the last
};

// Turns the light (or goes around the scene), `count` frames; each is whole but for its further samples.
Frames play(LivePicture& picture, int count, bool light, bool hurry) {
  DrawRequest request = picture.request();
  const Camera start = picture.view().camera;
  Frames out;
  const auto begin = std::chrono::steady_clock::now();
  for (int frame = 0; frame < count; ++frame) {
    const float degrees = 3.0f * float(frame + 1);
    if (light) {
      request.env_rotate = fmt::format("{},0,0", degrees);
    } else {
      const Vec3 eye = start.target + rotation_from_yaw_pitch_roll({degrees, 0, 0}) * (start.eye - start.target);
      request.camera = fmt::format("{},{},{},{},{},{},{}", eye.x, eye.y, eye.z, start.target.x, start.target.y,
                                   start.target.z, start.fov);
    }
    if (auto ok = picture.ask(request); !ok) return fmt::print(stderr, "skipped: {}\n", ok.error().text()), Frames{};
    if (auto ok = picture.work(hurry); !ok) return fmt::print(stderr, "skipped: {}\n", ok.error().text()), Frames{};
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / count;
  out.times = picture.times();
  return out;
}

// On two cores, as the aims are.
void window_case(const std::string& name, const Baked& baked, const std::string& brdf, double wanted) {
  const ThreadLimit two(2);
  DrawRequest request{.baked = name, .env = "sky:elevation=35,azimuth=45,turbidity=3", .size = "640x480"};
  request.brdf = brdf;
  auto picture = LivePicture::make(baked, request);
  if (!picture) return fmt::print(stderr, "skipped: {}\n", picture.error().text());
  (void)picture->work();
  for (const bool hurry : {false, true}) {
    const Frames light = play(*picture, 20, true, hurry), view = play(*picture, 20, false, hurry);
    const LiveTimes& t = light.times;
    report(fmt::format("window, {}, sun turned{}", name, hurry ? ", in a hurry" : ""), 1 / light.seconds,
           hurry ? 30 : wanted, "frames a second", "aim",
           {{"camera_moved", 1 / view.seconds},
            {"project_ms", t.project},
            {"relight_ms", t.relight},
            {"shade_ms", t.shade},
            {"trace_ms", view.times.trace},
            {"receivers", t.shaded}});
  }
}

// Bytes a second of a thread that reads memory which no cache holds, once through.
double read_bandwidth() {
  const std::vector<uint64_t> memory(size_t{1} << 25, 1);  // 256 MB
  uint64_t sum = 0;
  const double seconds = least_thread_seconds(4, [&] {
    for (uint64_t v : memory) sum += v;
  });
  if (sum == 1) fmt::print(stderr, "\n");  // it is wanted
  return double(memory.size() * sizeof(uint64_t)) / seconds;
}

// Nanoseconds of one thread for each receiver of `seen`, least of `runs`.
double vertex_ns(Relighter& relighter, std::span<const uint32_t> seen, Vec3 eye, int samples, int runs,
                 Breakdown* breakdown) {
  const ThreadLimit one(1);
  Relit out;
  double least = 1e300;
  for (int run = 0; run < runs; ++run) {
    if (breakdown) *breakdown = {};
    const double start = thread_seconds();
    if (!relighter.relight({.eye = eye, .most_samples = samples, .seen = seen, .breakdown = breakdown}, out)) return 0;
    least = std::min(least, thread_seconds() - start);
  }
  return 1e9 * least / double(seen.size());
}

// A vertex of blocks: against the aim and our standard basis, with what of memory is read for it at least.
void vertex_case(const std::string& name, const Baked& baked, const std::string& brdf, double aim, double times_aim,
                 double bandwidth) {
  DrawRequest request{.baked = name, .size = "640x480"};
  request.brdf = brdf;
  auto ours = make_block_shading(baked, request);
  request.method = "standard";
  auto standard = make_block_shading(baked, request);
  auto view = parse_view(request.camera, request.size, baked.scene);
  auto env = load_environment("sky:elevation=35,azimuth=45,turbidity=3");
  auto skip = [](const auto& result) {
    if (!result) fmt::print(stderr, "skipped: {}\n", result.error().text());
    return !result;
  };
  if (skip(ours) || skip(standard) || skip(view) || skip(env)) return;
  const Environment light = reduced(*env, 512);
  if (skip(set_environment(*ours, light, Mat3(1.0f))) || skip(set_environment(*standard, light, Mat3(1.0f)))) return;
  const VertexPlacement& at = std::get<VertexPlacement>(baked.surface.where);
  const auto& visibility = std::get<Visibility>(baked.surface.store);
  std::vector<uint32_t> all = seen_receivers(baked.scene, at.front, at.back, visibility.receivers, view->camera,
                                             view->width, view->height),
                        some;
  for (size_t i = 0; i < all.size(); i += 16) some.push_back(all[i]);
  double bytes = 0;
  for (uint32_t r : all) bytes += double(visibility.begin[r + 1] - visibility.begin[r]);
  Breakdown breakdown, coarse;
  const Vec3 eye = view->camera.eye;
  const double ns = vertex_ns(ours->relighter, all, eye, 256, 5, &breakdown),
               hurried = vertex_ns(ours->relighter, all, eye, 16, 5, &coarse),
               simd = vertex_ns(standard->relighter, some, eye, 256, 3, nullptr);
  report(fmt::format("window, {}, a vertex", name), ns, aim, "ns of a thread", "aim",
         {{"seen", all.size()},
          {"standard_simd_ns", simd},
          {"times_faster", simd / ns},
          {"times_faster_aim", times_aim},
          {"bytes_of_visibility", bytes / double(all.size())},
          {"visibility_gigabytes_a_second", bytes / double(all.size()) / ns},
          {"of_read_bandwidth", 1e9 * bytes / double(all.size()) / ns / bandwidth},
          {"sixteen_samples_ns", hurried},
          {"sixteen_samples_error", coarse.error()},
          {"sixteen_samples_largest_off", coarse.largest_off},
          {"breakdown", describe(breakdown)}});
}

// A new environment on the cube, and its three forms, by one thread's processor time.
void light_case(int size, double aim) {
  auto env = load_environment("sky:elevation=35,azimuth=45,turbidity=3");
  if (!env) return;
  const Environment light = reduced(*env, 8 * size);
  const ThreadLimit one(1);
  double project = 1e300, forms = 1e300;
  CubeLight cube;
  BlockLight block;
  for (int run = 0; run < 5; ++run) {
    const double start = thread_seconds();
    cube = cube_light(light, size, rotation_from_yaw_pitch_roll({31, 7, 3}));
    const double middle = thread_seconds();
    set_light(block, cube);
    if (run == 0) continue;  // allocates
    project = std::min(project, middle - start), forms = std::min(forms, thread_seconds() - middle);
  }
  report(fmt::format("window, a new environment, {} x {}", size, size), 1e3 * (project + forms) / 2, aim,
         "ms, on two threads", "aim",
         {{"project_ms_of_a_thread", 1e3 * project}, {"forms_ms_of_a_thread", 1e3 * forms}});
}

}  // namespace

void bench_window() {
  light_case(64, 5);
  light_case(128, 20);
  if (auto bunny = data_scene("bunny.obj", true)) {
    BakeRequest request{.transfer = "blocks"};
    request.loaded = std::make_shared<const Scene>(std::move(*bunny));
    if (auto baked = bake(request)) {
      const double bandwidth = read_bandwidth();
      report("window, memory read by a thread", 1e-9 * bandwidth, 1e-9 * bandwidth, "GB a second", "itself");
      const std::string on = "bunny with floor, blocks, ", ward = "ward:ax=0.2,ay=0.2,diffuse=0.5,specular=0.5";
      vertex_case(on + "diffuse", *baked, "", 250, 15, bandwidth);
      vertex_case(on + "Phong 10", *baked, "phong:exponent=10,diffuse=0.3,specular=0.4", 1500, 12, bandwidth);
      vertex_case(on + "Phong 50", *baked, "phong:exponent=50,diffuse=0.5,specular=0.5", 1500, 12, bandwidth);
      vertex_case(on + "Phong 200", *baked, "phong:exponent=200,diffuse=0.3,specular=0.4", 1500, 12, bandwidth);
      vertex_case(on + "Ward", *baked, ward, 3000, 12, bandwidth);
      window_case(on + "diffuse", *baked, "", 15);
      window_case(on + "Phong 50", *baked, "phong:exponent=50,diffuse=0.5,specular=0.5", 8);
      window_case(on + "Ward", *baked, ward, 4);
    }
  }
  if (auto bunny = refined(data_scene("bunny.obj", true), 140000)) {
    BakeRequest request{.transfer = "blocks"};
    request.loaded = std::make_shared<const Scene>(std::move(*bunny));
    if (auto baked = bake(request)) {
      const std::string on = "bunny with floor, finer, blocks, ";
      window_case(on + "diffuse", *baked, "", 15);
      window_case(on + "Phong 50", *baked, "phong:exponent=50,diffuse=0.5,specular=0.5", 8);
    }
  }
  each_product_scene(
      0.3f, [](const std::string&) { return true; },
      [](const std::string& name, const Scene& scene) {
        BakeRequest request{.transfer = "blocks"};
        request.loaded = std::make_shared<const Scene>(scene);
        const auto baked = bake(request);
        if (!baked) return;
        const double bandwidth = read_bandwidth();
        vertex_case(name + ", diffuse", *baked, "", 250, 15, bandwidth);
        vertex_case(name + ", Phong 10", *baked, "phong:exponent=10,diffuse=0.3,specular=0.4", 1500, 12, bandwidth);
        vertex_case(name + ", Phong 200", *baked, "phong:exponent=200,diffuse=0.3,specular=0.4", 1500, 12, bandwidth);
      });
  BakeRequest request{.bounces = "0"};
  request.samples = 16, request.denoise = "off";
  Scene scene = make_courtyard();
  for (float edge = 0.1f; scene.positions.size() < 1000000; edge *= 0.8f)
    if (auto ok = split_long_edges(scene, edge); !ok) return fmt::print(stderr, "skipped: {}\n", ok.error().text());
  request.loaded = std::make_shared<const Scene>(std::move(scene));
  auto baked = bake(request);
  if (baked) window_case("order 6, a million receivers", *baked, "", 60);
}

}  // namespace lambent::bench

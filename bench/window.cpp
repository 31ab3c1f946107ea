// The window's frames, without a window: from a turn of the light, or of the camera, to the next picture
// (pipeline/live.h), 640 x 480, one ray a pixel; showing it is a texture's upload more. The limits are what
// locally-adaptive-products' machine took a vertex, and, of columns, 60 frames a second.
#include "bench.h"

#include <lambent/core/parallel.h>
#include <lambent/pipeline/live.h>
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

void window_case(const std::string& name, const Baked& baked, const std::string& brdf, double wanted,
                 double ns_a_vertex) {
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
    if (!hurry && ns_a_vertex > 0 && t.shaded > 0)
      report(fmt::format("window, {}, a vertex and core", name), 1e6 * t.relight * thread_count() / double(t.shaded),
             ns_a_vertex, "ns", "aim");
  }
}

}  // namespace

void bench_window() {
  if (auto bunny = data_scene("bunny.obj", true)) {
    BakeRequest request{.transfer = "blocks"};
    request.loaded = std::make_shared<const Scene>(std::move(*bunny));
    if (auto baked = bake(request)) {
      window_case("bunny with floor, blocks, diffuse", *baked, "", 15, 250);
      window_case("bunny with floor, blocks, Phong 50", *baked, "phong:exponent=50,diffuse=0.5,specular=0.5", 8, 1500);
      window_case("bunny with floor, blocks, Ward", *baked, "ward:ax=0.2,ay=0.2,diffuse=0.5,specular=0.5", 4, 3000);
    }
  }
  BakeRequest request{.bounces = "0"};
  request.samples = 16, request.denoise = "off";
  Scene scene = make_courtyard();
  for (float edge = 0.1f; scene.positions.size() < 1000000; edge *= 0.8f)
    if (auto ok = split_long_edges(scene, edge); !ok) return fmt::print(stderr, "skipped: {}\n", ok.error().text());
  request.loaded = std::make_shared<const Scene>(std::move(scene));
  auto baked = bake(request);
  if (baked) window_case("order 6, a million receivers", *baked, "", 60, 0);
}

}  // namespace lambent::bench

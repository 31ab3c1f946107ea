// Whether certificates are honest: what a bake says of its error over the error that it has, over scenes and seeds. The
// truth is a mesh refined twice with 2,048 rays a receiver, not denoised, at its vertices, weighed by area: no code but
// the rays' is shared with what is measured.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <vector>

namespace lambent::bench {
namespace {

constexpr int true_samples = 2048;
constexpr BakeOptions common{.order = 4, .bounces = 2};

struct Truth {
  Scene fine;
  Receivers at;
  std::optional<Transfer> rows;
  std::vector<double> area;
};

Truth make_truth(const Scene& scene) {
  Truth t{scene, {}, {}, {}};
  for (int k = 0; k < 2; ++k) split_edges(t.fine, [](Vec3, Vec3) { return true; });
  auto tracer = Tracer::build(t.fine);
  t.at = make_vertex_receivers(t.fine);
  BakeOptions many = common;
  many.samples = true_samples, many.seed = 77, many.denoise = many.certify = false;
  t.rows = *bake(t.fine, *tracer, t.at, many);
  t.area.assign(t.at.count(), 0.0);
  const auto& corners = std::get<CornerReceivers>(t.at.basis);
  for (uint32_t i = 0; i < t.fine.triangles.size(); ++i)
    if (const Corners* c = corners.find(i, true)) {
      const double share = double(area_length(area_normal(t.fine, t.fine.triangles[i]))) / 6;
      for (uint32_t r : c->receiver) t.area[r] += share;
    }
  return t;
}

double true_error(const Scene& coarse, const Receivers& receivers, const Transfer& stored, const Truth& t) {
  auto tracer = Tracer::build(coarse);
  const auto& basis = std::get<CornerReceivers>(receivers.basis);
  double error2 = 0, truth2 = 0;
  for (size_t r = 0; r < t.at.count(); ++r) {
    const Hit hit = tracer->closest(t.at.origins[r] + 0.01f * t.at.normals[r], -t.at.normals[r]);
    const Corners* c = hit.triangle == none ? nullptr : basis.find(hit.triangle, hit.front);
    if (!c || hit.distance > 0.02f) continue;
    const std::vector<float> exact = load_receiver(*t.rows, r);
    std::vector<float> value(exact.size(), 0.0f);
    basis.spread(*c, hit.u, hit.v, [&](uint32_t receiver, float w) {
      const std::vector<float> row = load_receiver(stored, receiver);
      for (size_t k = 0; k < row.size(); ++k) value[k] += w * row[k];
    });
    for (size_t k = 0; k < exact.size(); ++k)
      error2 += t.area[r] * double(value[k] - exact[k]) * double(value[k] - exact[k]),
          truth2 += t.area[r] * double(exact[k]) * double(exact[k]);
  }
  return std::sqrt(error2 / truth2);
}

Scene boxes(int cells, bool room, float albedo) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(albedo)),
                 red = add_material(scene, "red", Vec3(0.7f, 0.2f, 0.1f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 2 * cells, 2 * cells);
  if (room) {
    add_quad(scene, red, "left", Vec3(-2, 0, -2), Vec3(0, 2, 0), Vec3(0, 0, 4), cells, 2 * cells);
    add_quad(scene, grey, "back", Vec3(-2, 0, -2), Vec3(4, 0, 0), Vec3(0, 2, 0), 2 * cells, cells);
  }
  add_box(scene, red, "low", Vec3(-0.9f, 0.001f, -0.8f), Vec3(0.1f, 0.5f, 0.3f), cells);
  add_box(scene, grey, "high", Vec3(0.5f, 0.001f, 0.2f), Vec3(1.1f, 1.4f, 0.7f), cells);
  return scene;
}
Scene ball(int levels) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 24, 24);
  add_sphere(scene, grey, "ball", Vec3(0, 0.8f, 0), 0.7f, levels);
  return scene;
}

}  // namespace

void bench_certificate() {
  struct Named {
    const char* name;
    std::function<Scene()> make;
  };
  const Named scenes[] = {{"courtyard 0.12", [] { return make_courtyard(0.12f); }},
                          {"boxes, coarse", [] { return boxes(6, false, 0.5f); }},
                          {"corner of a room, albedo 0.8", [] { return boxes(8, true, 0.8f); }},
                          {"ball", [] { return ball(3); }},
                          {"boxes, fine", [] { return boxes(14, false, 0.3f); }}};
  double worst = 0, least = INFINITY;
  for (const Named& s : scenes) {
    const Scene scene = s.make();
    const Truth truth = make_truth(scene);
    auto tracer = Tracer::build(scene);
    const Receivers receivers = make_vertex_receivers(scene);
    for (const uint32_t seed : {1u, 2u, 3u, 4u}) {
      BakeOptions options = common;
      options.seed = seed;
      if (seed == 4) options.error = 0.05;  // receivers and rays chosen
      else options.samples = seed == 1 ? 32 : seed == 2 ? 128 : 512;
      BakeReport r;
      auto stored = bake(scene, *tracer, receivers, options, &r);
      const double is = true_error(scene, receivers, *stored, truth);
      report(fmt::format("certificate {}, {}", s.name,
                         options.error > 0 ? "to 5 %" : fmt::format("{} rays", options.samples)),
             r.error, is, "relative RMS", "that of 2,048 rays on a mesh refined twice",
             {{"uncertain", r.certificate.uncertain}, {"receivers", receivers.count()}, {"traced", r.traced}});
      worst = std::max(worst, r.error / is), least = std::min(least, r.error / is);
    }
  }
  report("certificate, all", worst, least, "said over true, greatest", "the least");
}

}  // namespace lambent::bench

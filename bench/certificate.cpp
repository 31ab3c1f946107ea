// Whether certificates are honest: what a bake says of its error over the error that it has, over scenes and seeds. The
// truth is a mesh refined twice, at its vertices, weighed by area, by two bakes with rays of their own and without
// denoising: the mean of their products has no noise in it. Of lightmaps it is texels half as wide, in two bakes of
// every texel.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/gather.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/unbury.h>
#include <lambent/core/random.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace lambent::bench {
namespace {

// Of each of the two: with 1,024, true errors were the same to four digits.
constexpr int true_samples = 256;

// Receivers of a truth, their rows twice, and the area of each.
struct Truth {
  Receivers at;
  std::optional<Transfer> rows[2];
  std::vector<double> area;
};

// What lies inside something has its neighbours' light, and nobody sees it.
void leave_out_buried(Truth& t, const Tracer& tracer) {
  for (size_t r = 0; r < t.at.count(); ++r)
    if (is_buried(tracer, t.at, r)) t.area[r] = 0;
}

Truth make_truth(const Scene& scene, const BakeOptions& common, int refined) {
  Truth t;
  Scene fine = scene;
  for (int k = 0; k < refined; ++k) split_edges(fine, [](Vec3, Vec3) { return true; });
  auto tracer = Tracer::build(fine);
  t.at = make_vertex_receivers(fine);
  for (uint32_t k = 0; k < 2; ++k) {
    BakeOptions many = common;
    many.samples = true_samples, many.seed = 77 + k, many.denoise = many.certify = false, many.error = 0;
    t.rows[k] = *bake(fine, *tracer, t.at, many);
  }
  t.area.assign(t.at.count(), 0.0);
  const auto& corners = std::get<CornerReceivers>(t.at.basis);
  for (uint32_t i = 0; i < fine.triangles.size(); ++i)
    for (const bool front : {true, false})
      if (const Corners* c = corners.find(i, front)) {
        const double share = double(area_length(area_normal(fine, fine.triangles[i]))) / 6;
        for (uint32_t r : c->receiver) t.area[r] += share;
      }
  leave_out_buried(t, *tracer);
  return t;
}

double true_error(const Scene& coarse, const Receivers& receivers, const Transfer& stored, const Truth& t) {
  auto tracer = Tracer::build(coarse);
  const float step = 1e-4f * bounds(coarse).diagonal();
  double error2 = 0, truth2 = 0;
  auto compare = [&](const auto& basis) {
    for (size_t r = 0; r < t.at.count(); ++r) {
      if (!(t.area[r] > 0)) continue;
      const Hit hit = tracer->closest(t.at.origins[r] + step * t.at.normals[r], -t.at.normals[r]);
      const auto* c = hit.triangle == none ? nullptr : basis.find(hit.triangle, hit.front);
      if (!c || hit.distance > 4 * step) continue;
      const std::vector<float> a = load_receiver(*t.rows[0], r), b = load_receiver(*t.rows[1], r);
      std::vector<float> value(a.size(), 0.0f);
      basis.spread(*c, hit.u, hit.v, [&](uint32_t receiver, float w) {
        const std::vector<float> row = load_receiver(stored, receiver);
        for (size_t k = 0; k < row.size(); ++k) value[k] += w * row[k];
      });
      for (size_t k = 0; k < a.size(); ++k)
        error2 += t.area[r] * double(value[k] - a[k]) * double(value[k] - b[k]),
            truth2 += t.area[r] * double(a[k]) * double(b[k]);
    }
  };
  std::visit(compare, receivers.basis);
  return std::sqrt(std::max(0.0, error2) / truth2);
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
// Slats over a floor: a shadow of many edges.
Scene slats(int cells) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 3 * cells, 3 * cells);
  for (int k = 0; k < 5; ++k) {
    const float x = -1.6f + 0.8f * float(k);
    add_box(scene, grey, "slat", Vec3(x, 0.6f, -1.8f), Vec3(x + 0.3f, 0.7f, 1.8f), cells);
  }
  return scene;
}
// Steps between two walls.
Scene steps(int cells) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f)),
                 red = add_material(scene, "red", Vec3(0.7f, 0.2f, 0.1f));
  for (int k = 0; k < 4; ++k)
    add_box(scene, grey, "step", Vec3(-1, 0, 0.4f * float(k)),
            Vec3(1, 0.3f * float(k + 1), 0.4f * float(k + 1) - 0.002f), cells);
  add_quad(scene, red, "left", Vec3(-1.002f, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 1.6f), 2 * cells, 2 * cells);
  add_quad(scene, grey, "right", Vec3(1.002f, 0, 0), Vec3(0, 0, 1.6f), Vec3(0, 2, 0), 2 * cells, 2 * cells);
  return scene;
}
// A plate that hardly leaves the floor under it any light.
Scene gap(int cells) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.7f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 3 * cells, 3 * cells);
  add_box(scene, grey, "plate", Vec3(-1.1f, 0.12f, -0.9f), Vec3(0.9f, 0.2f, 1.1f), 2 * cells);
  return scene;
}
// A room of four walls without a roof, over `height`: little but what bounces reaches its floor.
Scene shaft(int cells, float height, float albedo) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(albedo)),
                 red = add_material(scene, "red", Vec3(0.7f, 0.2f, 0.1f));
  const Vec3 up(0, height, 0), x(2, 0, 0), z(0, 0, 2);
  add_quad(scene, grey, "floor", Vec3(-1, 0, -1), z, x, 2 * cells, 2 * cells);
  add_quad(scene, red, "left", Vec3(-1, 0, -1), up, z, 2 * cells, 2 * cells);
  add_quad(scene, grey, "right", Vec3(1, 0, -1), z, up, 2 * cells, 2 * cells);
  add_quad(scene, grey, "back", Vec3(-1, 0, -1), x, up, 2 * cells, 2 * cells);
  add_quad(scene, grey, "front", Vec3(-1, 0, 1), up, x, 2 * cells, 2 * cells);
  return scene;
}
// A lamp in a room with boxes, for lightmaps.
Scene lit(Scene scene) {
  const uint32_t lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(20);
  add_box(scene, lamp, "lamp", Vec3(-1.6f, 1.6f, -1.2f), Vec3(-1.2f, 1.7f, -0.6f), 1);
  return scene;
}

struct Said {
  std::vector<double> over_true;
  void add(const std::string& name, double said, double is, double uncertain, size_t receivers) {
    report("certificate " + name, said, is, "relative RMS", "the true one",
           {{"uncertain", uncertain}, {"receivers", receivers}});
    over_true.push_back(said / is);
  }
};

void of_vertices(const std::string& name, const Scene& scene, Said& said) {
  const BakeOptions common{.order = 4, .bounces = 2};
  const Truth truth = make_truth(scene, common, 2);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  for (const uint32_t seed : {1u, 2u, 3u, 4u}) {
    BakeOptions options = common;
    options.seed = seed;
    if (seed == 4) options.error = 0.05;
    else options.samples = seed == 1 ? 32 : seed == 2 ? 128 : 512;
    BakeReport r;
    auto stored = bake(scene, *tracer, receivers, options, &r);
    said.add(fmt::format("{}, {}", name, seed == 4 ? "to 5 %" : fmt::format("{} rays", options.samples)), r.error,
             true_error(scene, receivers, *stored, truth), r.certificate.uncertain, receivers.count());
  }
}

// Where some receivers stand for others.
void of_stand_ins(const std::string& name, const Scene& scene, Said& said) {
  const BakeOptions common{.order = 4, .bounces = 2};
  const Truth truth = make_truth(scene, common, 2);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  for (const uint32_t seed : {1u, 2u, 3u}) {
    BakeOptions options = common;
    options.seed = seed, options.thin = 600, options.error = seed == 3 ? 0.06 : 0.03;
    BakeReport r;
    auto stored = bake(scene, *tracer, receivers, options, &r);
    said.add(fmt::format("{}, {} of {} traced, to {:g} %", name, r.traced, r.receivers, 100 * options.error), r.error,
             true_error(scene, receivers, *stored, truth), r.certificate.uncertain, receivers.count());
  }
}

struct Texels {
  Scene scene;
  Atlas atlas;
  std::optional<Tracer> tracer;
  Receivers receivers;
};
Texels texels(const Scene& scene, float density) {
  Texels t{scene, {}, std::nullopt, {}};
  t.atlas = *make_atlas(t.scene, {.texels_per_unit = density, .reuse = false});
  t.receivers = make_texel_receivers(t.scene, t.atlas);
  t.tracer = *Tracer::build(t.scene);
  move_buried_texels(t.scene, *t.tracer, t.atlas, t.receivers);
  return t;
}

// The part of the surface that each texel's tent has: few of those at a chart's border.
std::vector<double> texel_areas(const Texels& t) {
  std::vector<double> areas(t.receivers.count(), 0.0);
  const auto& basis = std::get<TexelReceivers>(t.receivers.basis);
  const double density = double(t.atlas.texels_per_unit);
  Random random(1, 2);
  for (uint32_t i = 0; i < t.scene.triangles.size(); ++i)
    for (const bool front : {true, false}) {
      const auto* at = basis.find(i, front);
      if (!at) continue;
      const double area = 0.5 * double(area_length(area_normal(t.scene, t.scene.triangles[i])));
      const size_t count = 1 + size_t(16 * area * density * density);
      for (size_t k = 0; k < count; ++k) {
        const Vec2 r = random.next2();
        const float root = std::sqrt(r.x);
        basis.spread(*at, root * (1 - r.y), root * r.y,
                     [&](uint32_t texel, float w) { areas[texel] += double(w) * area / double(count); });
      }
    }
  return areas;
}

void of_lightmaps(const std::string& name, const Scene& scene, float density, Said& said) {
  const Environment sky = make_environment("sky", 32, 16, [](Vec3 d) { return Vec3(0.3f + std::max(0.0f, d.y)); });
  const Texels fine = texels(scene, 2 * density), coarse = texels(scene, density);
  Truth truth;
  truth.at = fine.receivers, truth.area = texel_areas(fine);
  leave_out_buried(truth, *fine.tracer);
  for (uint32_t k = 0; k < 2; ++k) {
    const LightmapOptions many{.samples = 256, .lamp_samples = 128, .bounces = 2, .seed = 77 + k};
    const Lamps lamps = make_lamps(fine.scene, &sky, false);
    truth.rows[k] = bake_lightmap(fine.scene, *fine.tracer, fine.receivers, lamps, many, false)->all;
  }
  for (const uint32_t seed : {1u, 2u, 3u}) {
    LightmapOptions options{.bounces = 2, .seed = seed};
    options.error = seed == 3 ? 0.05 : 0.02;
    LightmapReport r;
    const Lamps lamps = make_lamps(coarse.scene, &sky, false);
    auto map = bake_lightmap(coarse.scene, *coarse.tracer, coarse.receivers, lamps, options, false, &r);
    said.add(fmt::format("lightmap of {}, seed {}, to {:g} %", name, seed, 100 * options.error), r.certificate.error,
             true_error(coarse.scene, coarse.receivers, map->all, truth), r.certificate.uncertain,
             coarse.receivers.count());
  }
}

}  // namespace

void bench_certificate() {
  Said said;
  // LAMBENT_CERTIFICATE: scenes whose kind and name contain it alone.
  const char* only = std::getenv("LAMBENT_CERTIFICATE");
  auto wanted = [&](const std::string& name) { return !only || name.find(only) != std::string::npos; };
  const std::pair<const char*, std::function<Scene()>> vertices[] = {
      {"courtyard 0.12", [] { return make_courtyard(0.12f); }},
      {"boxes, coarse", [] { return boxes(6, false, 0.5f); }},
      {"boxes, fine", [] { return boxes(14, false, 0.3f); }},
      {"boxes, albedo 0.8", [] { return boxes(8, false, 0.8f); }},
      {"corner of a room, albedo 0.8", [] { return boxes(8, true, 0.8f); }},
      {"corner of a room, albedo 0.3", [] { return boxes(6, true, 0.3f); }},
      {"ball", [] { return ball(3); }},
      {"slats", [] { return slats(5); }},
      {"steps", [] { return steps(5); }},
      {"gap", [] { return gap(6); }},
      {"shaft", [] { return shaft(7, 2, 0.5f); }},
      {"deep shaft, albedo 0.8", [] { return shaft(7, 5, 0.8f); }}};
  for (const auto& [name, make] : vertices)
    if (wanted(std::string("vertices ") + name)) of_vertices(name, make(), said);
  if (wanted("vertices cornell_box_rounded"))
    if (auto scene = data_scene("cornell_box_rounded.glb", false)) of_vertices("cornell_box_rounded", *scene, said);
  const std::pair<const char*, std::function<Scene()>> finest[] = {
      {"boxes", [] { return boxes(16, false, 0.3f); }},
      {"corner of a room", [] { return boxes(16, true, 0.8f); }},
      {"shaft", [] { return shaft(12, 2, 0.5f); }}};
  for (const auto& [name, make] : finest)
    if (wanted(std::string("stand-ins ") + name)) of_stand_ins(name, make(), said);
  const std::tuple<const char*, std::function<Scene()>, float> maps[] = {
      {"boxes", [] { return lit(boxes(1, false, 0.5f)); }, 16.0f},
      {"a room's corner", [] { return lit(boxes(1, true, 0.8f)); }, 14.0f},
      {"slats", [] { return lit(slats(1)); }, 12.0f}};
  for (const auto& [name, make, density] : maps)
    if (wanted(std::string("lightmap ") + name)) of_lightmaps(name, make(), density, said);
  if (wanted("lightmap room"))
    if (auto scene = data_scene("room.glb", false)) of_lightmaps("room", *scene, 5, said);
  if (said.over_true.empty()) return;
  const auto [least, most] = std::minmax_element(said.over_true.begin(), said.over_true.end());
  // The true one within a fifth of what was said.
  const auto off = std::count_if(said.over_true.begin(), said.over_true.end(),
                                 [](double ratio) { return ratio < 1 / 1.2 || ratio > 1 / 0.8; });
  report("certificate, all", *most, *least, "said over true, greatest", "the least",
         {{"bakes", said.over_true.size()}, {"beyond_a_fifth", off}});
}

}  // namespace lambent::bench

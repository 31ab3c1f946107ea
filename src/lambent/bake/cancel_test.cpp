// Every stage of long work says how far it is, and ends soon after it is told to: counted in further reports, each of
// which is a piece of work, and not in seconds.
#include <lambent/bake/lattice.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/subsurface.h>
#include <lambent/bake/unbury.h>
#include <lambent/bake/visibility.h>
#include <lambent/compress/cpca.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/parallel.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

constexpr int threads = 2;
// What each thread was at when it was told, that stage's end, and a stage that begins only to end.
constexpr size_t most_further = threads + 4;

struct Stage {
  std::string name;
  size_t reports = 0;
  double last = 0;
};

// Runs `work` to its end, and again and again, cancelled after so many reports.
void walk_stages(const std::string& what, size_t least_reports, const std::function<bool(Progress*)>& work) {
  ThreadLimit limit(threads);
  std::vector<Stage> stages;
  size_t reports = 0, last_advance = 0;
  Progress whole([&](const std::string& stage, double share) {
    ++reports;
    if (stages.empty() || (share == 0.0 && (stages.back().name != stage || stages.back().last == 1.0)))
      stages.push_back({stage});
    ASSERT_FALSE(stages.empty());
    Stage& s = stages.back();
    EXPECT_EQ(s.name, stage) << what;
    EXPECT_GE(share, s.last) << what << ", " << stage;
    EXPECT_LE(share, 1.0) << what << ", " << stage;
    if (share < 1.0) last_advance = reports;
    ++s.reports, s.last = share;
  });
  EXPECT_TRUE(work(&whole)) << what;
  size_t moves = 0;
  for (const Stage& s : stages) {
    EXPECT_EQ(s.last, 1.0) << what << ", " << s.name;
    EXPECT_FALSE(s.name.empty());
    moves += s.reports - 2;  // beside its begin and its end
  }
  EXPECT_GE(moves, least_reports) << what;

  for (size_t share = 0; share < 8; ++share) {
    const size_t at = 1 + share * (last_advance - 1) / 7;
    size_t seen = 0;
    Progress stopped;
    Progress* self = &stopped;
    Progress counting([&](const std::string&, double) {
      if (++seen == at) self->cancel();
    });
    self = &counting;
    EXPECT_FALSE(work(&counting)) << what << " cancelled at report " << at << " of " << reports;
    EXPECT_LE(seen, at + most_further) << what << " cancelled at report " << at << " of " << reports;
  }
}

// Closed but for a hole, coloured, with a lamp and a buried box.
Scene room() {
  Scene scene;
  const uint32_t wall = add_material(scene, "wall", Vec3(0.7f, 0.5f, 0.4f)),
                 lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(4);
  add_quad(scene, wall, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 20, 20);
  add_quad(scene, wall, "wall", Vec3(-2, 0, -2), Vec3(4, 0, 0), Vec3(0, 3, 0), 20, 20);
  add_box(scene, wall, "box", Vec3(-0.6f, -0.2f, -0.6f), Vec3(0.5f, 0.9f, 0.4f), 10);
  add_box(scene, lamp, "lamp", Vec3(1), Vec3(1.3f), 1);
  return scene;
}

struct World {
  Scene scene = room();
  Tracer tracer = *Tracer::build(scene);
  Receivers receivers = make_vertex_receivers(scene);
  Lamps lamps = make_lamps(scene, nullptr, false);
};

TEST(Cancel, DiffuseBakes) {
  const World w;
  const BakeOptions options{.order = 3, .samples = 16, .bounces = 2};
  auto with = [&](BakeOptions o) {
    return [&w, o](Progress* p) { return bool(bake(w.scene, w.tracer, w.receivers, o, nullptr, p)); };
  };
  walk_stages("bounced", 40, with(options));
  BakeOptions other = options;
  other.bounces = 0;
  walk_stages("direct", 15, with(other));
  other = options, other.keep_terms = true;
  walk_stages("terms", 60, with(other));
  other = options, other.memory = least_memory(w.receivers.count(), true, options) + 50'000;
  walk_stages("traced again", 40, with(other));
  other = options, other.lobes = {{normalize(Vec3(0.2f, 1, 0.1f)), 3000.0f}};
  walk_stages("lobes", 40, with(other));
  walk_stages("subsurface", 100, [&](Progress* p) {
    return bool(bake_subsurface(w.scene, w.tracer, w.receivers, options, {{Vec3(20), Vec3(1)}}, nullptr, nullptr, p));
  });
  walk_stages("visibility", 15,
              [&](Progress* p) { return bool(bake_visibility(w.tracer, w.receivers, {.size = 16}, nullptr, p)); });
}

TEST(Cancel, Lightmaps) {
  const World w;
  auto with = [&](LightmapOptions o) {
    return [&w, o](Progress* p) {
      return bool(bake_lightmap(w.scene, w.tracer, w.receivers, w.lamps, o, true, nullptr, p));
    };
  };
  LightmapOptions options{.samples = 16, .lamp_samples = 4, .bounces = 2};
  walk_stages("counted", 40, with(options));
  options.directional = DirectionalKind::sh2;
  walk_stages("directional", 40, with(options));
  options.directional = DirectionalKind::none, options.converge = 1e-3;
  for (Solver solver : {Solver::jacobi, Solver::gauss_seidel, Solver::southwell, Solver::gmres}) {
    options.solver = solver;
    walk_stages("solver " + std::to_string(int(solver)), 18, with(options));
  }
  Scene scene = room();
  walk_stages("atlas", 1, [&](Progress* p) {
    Scene copy = scene;
    return bool(make_atlas(copy, {.texels_per_unit = 12}, p));
  });
  auto atlas = make_atlas(scene, {.texels_per_unit = 12});
  auto tracer = Tracer::build(scene);
  walk_stages("texels inside", 20, [&](Progress* p) {
    Receivers texels = make_texel_receivers(scene, *atlas);
    (void)move_buried_texels(scene, *tracer, *atlas, texels, p);
    return !p->cancelled();
  });
}

TEST(Cancel, Matrices) {
  const World w;
  Reflection reflection;
  reflection.everywhere = Ggx{Vec3(0.9f), Vec2(0.4f)};
  const ReceiverMaterials materials = make_receiver_materials(w.scene, w.receivers, reflection);
  const BakeOptions options{.order = 3, .samples = 16, .bounces = 2};
  auto with = [&](MatrixOptions m, int bounces) {
    m.incident_order = 3, m.grid = 16, m.response_samples = 256;
    BakeOptions o = options;
    o.bounces = bounces;
    return [&w, &materials, o, m](Progress* p) {
      return bool(bake_matrix(w.scene, w.tracer, w.receivers, materials, o, m, nullptr, p));
    };
  };
  walk_stages("recursion", 50, with({.outgoing = OutgoingKind::map}, 2));
  walk_stages("direct", 20, with({.outgoing = OutgoingKind::svd}, 0));
  walk_stages("paths", 20, with({.outgoing = OutgoingKind::sh, .simulate_paths = true}, 2));
  walk_stages("map", 8, [&](Progress* p) {
    return !make_map_outgoing(materials, 3, {.grid = 16, .response_samples = 256}, p).maps.empty();
  });
}

TEST(Cancel, WhatComesAfter) {
  const World w;
  auto transfer = bake(w.scene, w.tracer, w.receivers, {.order = 3, .samples = 16, .bounces = 0});
  ASSERT_TRUE(transfer);
  walk_stages("lattice", 3, [&](Progress* p) {
    return bool(bake_lattice(w.scene, w.tracer, w.receivers, *transfer, nullptr,
                             {Vec3(-1, 1.2f, -1), Vec3(1, 2, 1), 4, 4, 4}, {.order = 2, .samples = 64}, nullptr, p));
  });
  walk_stages("clusters", 60,
              [&](Progress* p) { return bool(compress_cpca(*transfer, {.clusters = 8, .rank = 2}, nullptr, p)); });
  walk_stages("lobes", 3, [&](Progress* p) { return bool(fit_zonal(*transfer, {.lobes = 2}, nullptr, p)); });
  walk_stages("grooves", 20, [&](Progress* p) { return bool(make_wrinkle_table({.order = 4, .size = 4}, p)); });
  Relit relit;
  relight(*transfer, std::vector<Vec3>(9, Vec3(1)), relit);
  const Camera camera{Vec3(3, 3, 5)};
  RenderOptions picture;
  picture.width = picture.height = 32, picture.samples = 2;
  walk_stages("picture", 20, [&](Progress* p) {
    return bool(render(w.scene, w.tracer, w.receivers.basis, relit, camera, picture, p));
  });
  const Environment sky = *load_environment("uniform:1");
  walk_stages("reference", 12, [&](Progress* p) {
    return bool(path_trace(w.scene, sky, camera, {.width = 32, .height = 32, .spp = 4}, p));
  });
}

TEST(Cancel, TheRayTree) {
  const Scene scene = make_sphere(1, 6, Vec3(0.5f));
  walk_stages("ray tree", 2, [&](Progress* p) { return bool(Tracer::build(scene, p)); });
}

}  // namespace
}  // namespace lambent

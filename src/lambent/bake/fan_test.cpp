// A fan of any number of rays ends within a piece of being told to, and in pieces is what it is in one.
#include <lambent/bake/fan.h>
#include <lambent/bake/lamps.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

constexpr size_t rays = 2 * fan_piece + 1000;

struct RandomFan {
  std::vector<float> x, y, z;
  RandomFan() {
    Random random(7);
    for (size_t i = 0; i < rays; ++i) {
      const Vec3 d = normalize(Vec3(random.next() - 0.5f, random.next() - 0.5f, random.next() - 0.5f));
      x.push_back(d.x), y.push_back(d.y), z.push_back(d.z);
    }
  }
  Directions directions() const { return {x.data(), y.data(), z.data(), rays}; }
};

TEST(Fan, EndsAfterThePieceInWhichItIsTold) {
  const RandomFan fan;
  for (size_t told = 0; told < 3; ++told) {
    Progress progress;
    std::vector<size_t> firsts, counts;
    in_pieces(fan.directions(), &progress, [&](size_t first, const Directions& d) {
      EXPECT_EQ(d.x, fan.x.data() + first);
      firsts.push_back(first), counts.push_back(d.count);
      if (firsts.size() == told + 1) progress.cancel();
    });
    EXPECT_EQ(firsts.size(), told + 1);
    EXPECT_EQ(firsts.back(), told * fan_piece);
    EXPECT_EQ(counts.back(), told < 2 ? fan_piece : rays - 2 * fan_piece);
  }
}

TEST(Fan, InPiecesIsTheSame) {
  Scene scene = make_sphere(1, 3, Vec3(0.5f));
  add_box(scene, 0, "box", Vec3(1.5f, -1, -1), Vec3(2.5f, 1, 1), 2);
  const Tracer tracer = *Tracer::build(scene);
  const RandomFan fan;
  const Vec3 eye(0, 2, 0);
  std::vector<Hit> whole(rays), pieces(rays);
  std::vector<std::vector<float>> visible(1, std::vector<float>(rays));
  tracer.closest_fan(eye, fan.directions(), whole.data());
  trace_hits(tracer, eye, fan.directions(), pieces.data(), {}, nullptr);
  trace_visible(tracer, eye, fan.directions(), std::span(visible), nullptr);
  size_t met = 0;
  for (size_t i = 0; i < rays; ++i) {
    EXPECT_EQ(whole[i].triangle, pieces[i].triangle);
    EXPECT_EQ(whole[i].distance, pieces[i].distance);
    EXPECT_EQ(visible[0][i], whole[i].triangle == none ? 1 : 0);
    met += whole[i].triangle != none;
  }
  EXPECT_GT(met, rays / 20);

  Progress stopped;
  stopped.cancel();
  std::vector<Hit> untouched(rays);
  trace_hits(tracer, eye, fan.directions(), untouched.data(), {}, &stopped);
  for (const Hit& h : untouched) EXPECT_EQ(h.triangle, none);
}

TEST(Fan, LampsOfManySamplesEnd) {
  Scene scene;
  const uint32_t lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(4);
  add_quad(scene, lamp, "lamp", Vec3(-1, 2, -1), Vec3(2, 0, 0), Vec3(0, 0, 2), 1, 1);
  const Tracer tracer = *Tracer::build(scene);
  const Lamps lamps = make_lamps(scene, nullptr, false);
  Progress progress;
  std::vector<LampLight> lights;
  auto sample = [&] {
    sample_lamps(scene, tracer, lamps, Vec3(0), Vec3(0, 1, 0), int(rays), 0, 1, 0, lights, &progress);
  };
  sample();
  EXPECT_EQ(lights.size(), rays);
  lights.clear(), progress.cancel(), sample();
  EXPECT_TRUE(lights.empty());
}

}  // namespace
}  // namespace lambent

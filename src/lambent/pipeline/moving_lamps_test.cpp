#include <lambent/core/random.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

MovingLamp must(const std::string& text) {
  auto lamp = parse_moving_lamp(text);
  EXPECT_TRUE(lamp) << lamp.error().text();
  return lamp ? *lamp : MovingLamp();
}

TEST(MovingLamps, WhatIsWrongIsNamed) {
  for (const char* text : {"",
                           "lamp=1",
                           "sphere@1,2,3=1",
                           "sphere@1,2,3,0=1",
                           "sphere@1,2,3,-1=1",
                           "sphere@1,2,3,nan=1,1,1",
                           "sphere@1,2,inf,1=1",
                           "sphere@1,2,3e9,1=1",
                           "sphere@1,2,3,1=-1,0,0",
                           "sphere@1,2,3,1=1,2",
                           "sphere@1,2,3,1",
                           "cube@1,2,3=1",
                           "point@1,2=1",
                           "point@1,2,3=nan",
                           "point@1,2,3=1e30",
                           "spot@0,0,0,0,0,0,30=1",
                           "spot@0,0,0,0,-1,0,0=1",
                           "spot@0,0,0,0,-1,0,91=1",
                           "sun@10,91=1",
                           "sun@10=1"}) {
    auto lamp = parse_moving_lamp(text);
    ASSERT_FALSE(lamp) << text;
    EXPECT_EQ(lamp.error().where, "--lamp") << text;
    EXPECT_TRUE(lamp.error().usage);
  }
  const std::vector<MovingLamp> lamps{must("point@0,0,0=1"), must("sun@0,90=1")};
  for (const char* text : {"", "1", "1@", "0@0:1,2,3", "3@0:1,2,3", "2@0:1,2,3", "1@0:1,2", "1@1:0,0,0;1:1,1,1",
                           "1@1:0,0,0;0:1,1,1", "1@x:0,0,0", "1@0:0,0,0;"}) {
    auto path = parse_lamp_path(text, lamps);
    ASSERT_FALSE(path) << text;
    EXPECT_EQ(path.error().where, "--move") << text;
  }
}

TEST(MovingLamps, AreTheirNumbersAgain) {
  for (const char* text :
       {"sphere@1,2,3,0.25=3,2,1", "point@-1.5,2,1000000=5,5,5", "spot@0,1,0,0,0,0.5,30=1,1,1", "sun@40,60=2,1,1"}) {
    auto numbers = read_lamp_numbers(text);
    ASSERT_TRUE(numbers) << numbers.error().text();
    EXPECT_EQ(lamp_text(*numbers), text);
  }
  LampNumbers spot = *read_lamp_numbers("spot@0,1,0,0,0,0.5,30=1"), sun = *read_lamp_numbers("sun@40,60=2");
  carry_lamp(spot, Vec3d(1, 2, 3)), carry_lamp(sun, Vec3d(1, 2, 3));
  EXPECT_EQ(lamp_text(spot), "spot@1,3,3,1,2,3.5,30=1,1,1");
  EXPECT_EQ(lamp_text(sun), "sun@40,60=2,2,2");
}

// Over an open floor, in closed form.
TEST(MovingLamps, LightAFloorAsTheyShould) {
  const Scene floor = make_quad(Vec3(-9, 0, 9), Vec3(18, 0, 0), Vec3(0, 0, -18), 1, 1, Vec3(0.5f));
  const Tracer tracer = *Tracer::build(floor);
  auto at = [&](const std::string& text, Vec3 p = Vec3(0, 1e-4f, 0)) {
    const MovingLamp lamp = must(text);
    return direct_light(tracer, {&lamp, 1}, p, Vec3(0, 1, 0), 64, 1).x;
  };
  EXPECT_NEAR(at("sphere@0,2,0,0.5=3"), 3 * 0.0625f, 1e-3f);         // L (r / d)^2
  EXPECT_NEAR(at("sphere@0,20,0,0.0005=3"), 3 * 6.25e-10f, 1e-12f);  // as small as it is far
  EXPECT_NEAR(at("sphere@2,2,0,0.5=3"), 3 * 0.25f / 8 * std::sqrt(0.5f), 2e-3f);
  EXPECT_EQ(at("sphere@0,2,0,5=3"), 0);     // within it
  EXPECT_EQ(at("sphere@0,-2,0,0.5=3"), 0);  // behind
  EXPECT_NEAR(at("sphere@0,0,0,0.00001=3", Vec3(0, 2, 0)), 0, 1e-9f);
  EXPECT_NEAR(at("point@0,2,0=3"), 3 / (4 * pi), 5e-5f);
  EXPECT_NEAR(at("spot@0,2,0,0,0,0,40=3"), 3 / (4 * pi), 5e-5f);
  EXPECT_EQ(at("spot@0,2,0,0,0,0,40=3", Vec3(1.7f, 1e-4f, 0)), 0);
  EXPECT_NEAR(at("sun@0,90=3"), 3 / pi, 1e-5f);
  EXPECT_NEAR(at("sun@77,30=3"), 1.5f / pi, 1e-5f);
  EXPECT_EQ(at("sun@0,-30=3"), 0);
  // A thousand, and one that is a thousand times as bright.
  const std::vector<MovingLamp> thousand(1000, must("point@0.3,2,0.1=1"));
  EXPECT_NEAR(direct_light(tracer, thousand, Vec3(0, 1e-4f, 0), Vec3(0, 1, 0), 1, 1).x, at("point@0.3,2,0.1=1000"),
              1e-2f);
}

TEST(MovingLamps, GoStraightFromPlaceToPlace) {
  std::vector<MovingLamp> lamps{must("sphere@9,9,9,1=1")};
  auto path = parse_lamp_path("1@1:0,0,0;3:2,4,0", lamps);
  ASSERT_TRUE(path) << path.error().text();
  for (const auto& [time, x] : {std::pair(0.0, 0.0f), {1.0, 0.0f}, {2.0, 1.0f}, {3.0, 2.0f}, {9.0, 2.0f}}) {
    move_lamp(lamps, *path, time);
    EXPECT_FLOAT_EQ(lamps[0].centre.x, x);
    EXPECT_FLOAT_EQ(lamps[0].centre.y, 2 * x);
  }
}

TEST(MovingLamps, OfDistantLightGoAlongArcs) {
  auto standing = parse_lamp_arc("2@90,30", 2);
  ASSERT_TRUE(standing) << standing.error().text();
  EXPECT_EQ(standing->lamp, 1u);
  EXPECT_LT(length(direction_at(*standing, 7) - Vec3(0, 0.5f, std::sqrt(0.75f))), 1e-6f);
  auto arc = parse_lamp_arc("1@1:0,10;3:180,70", 2);  // over the top: 100 degrees
  ASSERT_TRUE(arc) << arc.error().text();
  for (const auto& [time, degrees] : {std::pair(0.0, 10.0f), {1.0, 10.0f}, {1.5, 35.0f}, {2.0, 60.0f}, {9.0, 110.0f}}) {
    const float t = radians(degrees);
    EXPECT_LT(length(direction_at(*arc, time) - Vec3(std::cos(t), std::sin(t), 0)), 1e-6f) << time;
  }
  for (const char* text : {"", "1", "1@", "0@1,2", "3@1,2", "x@1,2", "1@1,2,3", "1@0,91", "1@0:0,0;0:1,1", "1@0:0",
                           "1@0:1,2;", "1@0:0,0;1:180,0", "1@nan,0"}) {
    auto path = parse_lamp_arc(text, 2);
    ASSERT_FALSE(path) << text;
    EXPECT_EQ(path.error().where, "--move") << text;
  }
}

TEST(MovingLamps, StandInASceneAsItsOwn) {
  Scene scene = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 0, -1), 1, 1, Vec3(0.5f));
  add_lamps(scene, {must("sphere@0,2,0,0.5=3"), must("point@1,2,3=4")});
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(scene.lights[0].intensity.x, 4);
  double area = 0;
  for (const Triangle& t : scene.triangles)
    if (emits(scene, t, true)) area += double(area_length(area_normal(scene, t))) / 2;
  EXPECT_NEAR(area, double(pi), 0.01);
}

TEST(MovingLamps, ClearLightIsWhatArrivesWhereNothingIsInTheWay) {
  Scene scene;
  add_quad(scene, add_material(scene, "grey", Vec3(0.5f)), "floor", Vec3(0, -1, 0), Vec3(0, 0, 4), Vec3(4, 0, 0), 2, 2);
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  for (const char* text : {"point@1.2,2.1,1.7=3,2,1", "spot@1.2,2.1,1.7,2,0,2,60=3,2,1", "sphere@1.2,2.1,1.7,0.2=3,2,1",
                           "sun@40,50=3,2,1"}) {
    const MovingLamp lamp = must(text);
    Random random(5);
    size_t bright = 0;
    for (uint64_t i = 0; i < 1000; ++i) {
      const Vec3 n = normalize(Vec3(random.next() - 0.5f, random.next(), random.next() - 0.5f));
      const Vec3 p(4 * random.next(), 0, 4 * random.next());
      const Vec3 clear = clear_light(lamp, p, n), lit = direct_light(*tracer, lamp, p, n, 64, i);
      const bool sphere = lamp.kind == MovingLamp::Kind::sphere;
      const bool over = dot(n, lamp.centre - p) > 0.25f;  // the whole sphere is over the horizon
      if (!sphere || over)
        ASSERT_LT(length(lit - clear), (sphere ? 0.03f : 1e-5f) * length(clear) + 1e-9f) << text << i;
      else ASSERT_LE(largest(lit), 1.5f * largest(clear) + 1e-6f) << text << i;
      bright += largest(clear) > 0;
    }
    EXPECT_GT(bright, 300u) << text;
  }
}

}  // namespace
}  // namespace lambent

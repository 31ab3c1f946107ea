#include <lambent/basis/sh.h>
#include <lambent/core/random.h>
#include <lambent/light/project.h>
#include <lambent/pipeline/draw_moving.h>
#include <lambent/pipeline/field_request.h>
#include <lambent/pipeline/place.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/append.h>
#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"
#include "temporary_folder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace lambent {
namespace {

class DrawMoving : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  std::string path(const std::string& name) const { return folder.file(name); }

  void make_files() {
    Scene floor;
    add_quad(floor, add_material(floor, "floor", Vec3(0.7f)), "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0),
             16, 16);
    BakeRequest bake_floor;
    bake_floor.loaded = std::make_shared<const Scene>(floor), bake_floor.scene = "floor", bake_floor.order = 4;
    bake_floor.samples = 64, bake_floor.bounces = "0", bake_floor.output = path("floor.glb");
    bake_floor.lattice = "3,2,3", bake_floor.lattice_box = "-2,0.1,-2,2,2,2";
    auto baked = bake(bake_floor);
    ASSERT_TRUE(baked) << baked.error().text();
    ASSERT_TRUE(save_baked(path("floor.glb"), *baked));
    Scene ball = make_sphere(0.5f, 2, Vec3(0.5f));
    BakeRequest bake_ball;
    bake_ball.loaded = std::make_shared<const Scene>(ball), bake_ball.scene = "ball", bake_ball.order = 4;
    bake_ball.samples = 64, bake_ball.bounces = "0", bake_ball.output = path("ball.glb");
    auto own = bake(bake_ball);
    ASSERT_TRUE(own) << own.error().text();
    ASSERT_TRUE(save_baked(path("ball.glb"), *own));
    FieldRequest field{path("ball.glb"), path("ball.field.glb")};
    field.shells = 8, field.side = 8, field.samples = 64;
    field.given = {"shells", "side", "samples"};
    auto made = field_to_file(field);
    ASSERT_TRUE(made) << made.error().text();
    field.output = path("ball.transfer.glb"), field.transfer = true, field.given.insert("transfer");
    made = field_to_file(field);
    ASSERT_TRUE(made) << made.error().text();
  }
  DrawRequest request(std::vector<std::string> place) const {
    DrawRequest r{.baked = path("floor.glb"), .env = "uniform:1,1,1", .camera = "0,4,0.01,0,0,0,60", .size = "32x32"};
    r.spp = 1, r.place = std::move(place);
    return r;
  }
  std::string ball_at(const std::string& where, const std::string& name = "a") const {
    return name + "=" + path("ball.field.glb") + "@" + where;
  }
  std::string error_of(const DrawRequest& r) const {
    auto drawing = draw(r);
    return drawing ? "" : drawing.error().text();
  }
  void write(const std::string& name, const std::string& text) const { folder.write(name, text); }
};

TEST_F(DrawMoving, ABallOverAFloorDarkensItAndIsLit) {
  make_files();
  auto alone = draw(request({}));
  ASSERT_TRUE(alone) << alone.error().text();
  auto with = draw(request({ball_at("1,0.6,0")}));
  ASSERT_TRUE(with) << with.error().text();
  const Image &before = alone->frames[0], &after = with->frames[0];
  auto at = [](const Image& image, int x, int y) { return image.rgb[size_t(y) * 32 + size_t(x)].x; };
  // Left of the middle nothing has changed but a little; beside the ball the floor is darker; the ball is there.
  EXPECT_NEAR(at(after, 5, 16) / at(before, 5, 16), 1, 0.03f);
  EXPECT_LT(at(after, 18, 16), 0.95f * at(before, 18, 16));
  EXPECT_NEAR(at(after, 25, 16), 0.5f, 0.1f);  // its top is under the open sky
}

TEST_F(DrawMoving, ALampIsSeenAndLightsTheFloorAndTheBall) {
  make_files();
  Scene lamp = make_sphere(0.3f, 2, Vec3(0.2f));
  lamp.materials[0].emissive = Vec3(8, 4, 2);
  BakeRequest bake_lamp;
  bake_lamp.loaded = std::make_shared<const Scene>(lamp), bake_lamp.scene = "lamp", bake_lamp.order = 4;
  bake_lamp.samples = 16, bake_lamp.bounces = "0", bake_lamp.output = path("lamp.glb");
  auto own = bake(bake_lamp);
  ASSERT_TRUE(own) << own.error().text();
  ASSERT_TRUE(save_baked(path("lamp.glb"), *own));
  FieldRequest field{path("lamp.glb"), path("lamp.field.glb")};
  field.shells = 8, field.side = 8, field.samples = 64, field.radiance = true;
  field.given = {"shells", "side", "samples", "radiance"};
  auto made = field_to_file(field);
  ASSERT_TRUE(made) << made.error().text();
  const std::string place = "l=" + path("lamp.field.glb") + "@-1,0.8,0";
  DrawRequest r = request({place, ball_at("0.6,0.6,0")});
  r.env = "uniform:0.001";
  auto drawing = draw(r);
  ASSERT_TRUE(drawing) << drawing.error().text();
  auto at = [&](int x, int y) { return drawing->frames[0].rgb[size_t(y) * 32 + size_t(x)]; };
  EXPECT_NEAR(at(7, 15).x, 8, 0.5f);  // the lamp itself
  // The floor at its foot: a ball's light, 8 (0.3 / d)^2 cos, of albedo 0.7; red leads.
  const Vec3 foot = at(4, 16), side = at(18, 16);
  EXPECT_GT(foot.x, 0.1f);
  EXPECT_NEAR(foot.y / foot.x, 0.5f, 0.02f);
  EXPECT_GT(side.x, 0.05f);  // the ball's side towards it
}

TEST_F(DrawMoving, AnObjectThatReflectsLightsTheFloorAndOtherObjects) {
  make_files();
  auto field = load_baked(path("ball.transfer.glb"));
  ASSERT_TRUE(field) << field.error().text();
  ASSERT_TRUE(reflecting_of(*field));
  EXPECT_EQ(light_of(reflecting_of(*field)->store).order, 3);
  EXPECT_EQ(shining_of(*field), nullptr);
  auto with =
      draw(request({"a=" + path("ball.transfer.glb") + "@1,0.6,0", "b=" + path("ball.transfer.glb") + "@-0.2,0.6,0"}));
  auto without = draw(request({ball_at("1,0.6,0"), ball_at("-0.2,0.6,0", "b")}));
  ASSERT_TRUE(with) << with.error().text();
  ASSERT_TRUE(without) << without.error().text();
  double floor = 0, ball = 0;
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 32; ++x) {
      const float more = with->frames[0].rgb[size_t(y) * 32 + size_t(x)].x -
                         without->frames[0].rgb[size_t(y) * 32 + size_t(x)].x;
      EXPECT_GT(more, -1e-3f);
      (x == 19 && y == 16 ? ball : floor) = std::max(double(more), x == 19 && y == 16 ? ball : floor);
    }
  EXPECT_GT(floor, 0.01);
  EXPECT_LT(floor, 0.3);
}

// A lamp in a corner: the light that it sends by way of the walls, against the path tracer's joint scene.
TEST_F(DrawMoving, ALampsLightGoesOnFromTheWalls) {
  SKIP_UNDER_SANITIZERS();
  Scene corner;
  const uint32_t white = add_material(corner, "white", Vec3(0.8f)),
                 red = add_material(corner, "red", Vec3(0.8f, 0.2f, 0.1f));
  add_quad(corner, white, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 14, 14);
  add_quad(corner, red, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 2, 0), 14, 14);
  add_quad(corner, white, "side", Vec3(-1, 0, 1), Vec3(0, 0, -2), Vec3(0, 2, 0), 14, 14);
  BakeRequest bake_corner;
  bake_corner.loaded = std::make_shared<const Scene>(corner), bake_corner.scene = "corner", bake_corner.order = 2;
  bake_corner.samples = 16, bake_corner.bounces = "0", bake_corner.lattice = "2,2,2";
  auto baked = bake(bake_corner);
  ASSERT_TRUE(baked) << baked.error().text();
  Scene lamp = make_sphere(0.2f, 3, Vec3(0.0f));
  lamp.materials[0].emissive = Vec3(8, 8, 8);
  BakeRequest bake_lamp;
  bake_lamp.loaded = std::make_shared<const Scene>(lamp), bake_lamp.scene = "lamp", bake_lamp.order = 2;
  bake_lamp.samples = 16, bake_lamp.bounces = "0";
  ASSERT_TRUE(save_baked(path("lamp.glb"), *bake(bake_lamp)));
  FieldRequest field{path("lamp.glb"), path("lamp.field.glb")};
  field.order = 6, field.samples = 128, field.radiance = true, field.given = {"order", "samples", "radiance"};
  auto made = field_to_file(field);
  ASSERT_TRUE(made) << made.error().text();
  DrawRequest r{.baked = "corner", .env = "uniform:0"};
  r.place = {"l=" + path("lamp.field.glb") + "@0.1,0.8,0.1"}, r.given = {"place"};
  const auto lit = [&](int bounces) {
    r.lamp_bounces = bounces;
    const Job job;
    auto d = begin_columns(*baked, r, job);
    EXPECT_TRUE(d) << d.error().text();
    d->around = *surroundings_of(r, job);
    EXPECT_TRUE(choose_light(*d));
    EXPECT_TRUE(make_relighters(*d));
    auto moving = MovingDrawing::make(*baked, r, job);
    EXPECT_TRUE(moving) << moving.error().text();
    EXPECT_TRUE(moving->set_light(*d));
    EXPECT_TRUE(moving->move_to(0));
    std::vector<Vec3> emission;
    return moving->lit(*d, emission).relit;
  };
  const Receivers receivers = make_vertex_receivers(corner);
  Scene joint = corner;
  for (Vec3& p : lamp.positions) p += Vec3(0.1f, 0.8f, 0.1f);
  append_scene(joint, lamp);
  for (int bounces : {1, 2}) {
    const Relit ours = lit(bounces), direct = lit(0);
    double error = 0, alone = 0, all = 0;
    std::vector<Vec3> at, normals;
    for (size_t i = 0; i < receivers.count(); i += 11)
      at.push_back(receivers.origins[i]), normals.push_back(receivers.normals[i]);
    const auto truth = exit_radiances(joint, make_environment("dark", 4, 2, [](Vec3) { return Vec3(0); }), at, normals,
                                      bounces, 2048, 3, {}, true);
    for (size_t k = 0; k < at.size(); ++k)
      for (int c = 0; c < 3; ++c) {
        error += std::pow(double(ours.at(11 * k)[c] - truth[k].mean[c]), 2);
        alone += std::pow(double(direct.at(11 * k)[c] - truth[k].mean[c]), 2);
        all += std::pow(double(truth[k].mean[c]), 2);
      }
    RecordProperty("relative_error_" + std::to_string(bounces), std::to_string(std::sqrt(error / all)));
    RecordProperty("without_" + std::to_string(bounces), std::to_string(std::sqrt(alone / all)));
    EXPECT_LT(std::sqrt(error / all), 0.05);
    EXPECT_GT(std::sqrt(alone / all), 0.1);
  }
}

// Light of four bands.
std::vector<Vec3> some_light() {
  Random random(4);
  std::vector<Vec3> light(16);
  for (size_t k = 0; k < light.size(); ++k)
    light[k] = (Vec3(random.next(), random.next(), random.next()) - 0.5f) * 2.0f / float(1 + sh_band(int(k)));
  light[0] = Vec3(3, 2.5f, 2);
  return light;
}

double decibels(const Image& ours, const Image& truth) {
  double squares = 0, peak = 0, count = 0;
  for (size_t i = 0; i < truth.rgb.size(); ++i) {
    if (truth.alpha[i] < 0.99f || ours.alpha[i] < 0.99f) continue;
    for (int c = 0; c < 3; ++c)
      squares += std::pow(double(ours.rgb[i][c] - truth.rgb[i][c]), 2), peak = std::max(peak, double(truth.rgb[i][c]));
    count += 3;
  }
  EXPECT_GT(count, 300);
  return 10 * std::log10(peak * peak * count / squares);
}

// A floor that is all but out of the way, under a lattice about the origin.
Baked nearly_nothing() {
  Scene floor;
  add_quad(floor, add_material(floor, "floor", Vec3(0)), "floor", Vec3(-0.1f, -9, -0.1f), Vec3(0, 0, 0.2f),
           Vec3(0.2f, 0, 0), 2, 2);
  BakeRequest r;
  r.loaded = std::make_shared<const Scene>(floor), r.scene = "floor", r.order = 4, r.samples = 64, r.bounces = "0";
  r.lattice = "2,2,2", r.lattice_box = "-2,-2,-2,2,2,2";
  return *bake(r);
}

// Two balls, one in the other's shadow, turned: the highlight is where the path tracer of the joint scene has it.
TEST_F(DrawMoving, AGlossyObjectIsAsThePathTracerSeesIt) {
  SKIP_UNDER_SANITIZERS();
  Scene balls;
  const uint32_t shiny = add_material(balls, "shiny", Vec3(0.8f, 0.6f, 0.4f));
  add_sphere(balls, shiny, "one", Vec3(0.5f, 0, 0), 0.5f, 4);
  add_sphere(balls, shiny, "two", Vec3(-0.4f, 0.1f, 0), 0.35f, 4);
  const std::string brdf = "ggx:roughness=0.6";
  BakeRequest r;
  r.loaded = std::make_shared<const Scene>(balls), r.scene = "balls", r.transfer = "matrix", r.brdf = brdf, r.order = 4;
  r.incident_order = 6, r.samples = 1024, r.bounces = "0", r.outgoing = "map";
  auto own = bake(r);
  ASSERT_TRUE(own) << own.error().text();
  ASSERT_TRUE(save_baked(path("balls.glb"), *own));
  FieldRequest field{path("balls.glb"), path("balls.field.glb")};
  field.shells = 8, field.side = 8, field.samples = 64, field.given = {"shells", "side", "samples"};
  auto made = field_to_file(field);
  ASSERT_TRUE(made) << made.error().text();
  field.transfer = true, field.given.insert("transfer");
  auto refused = field_to_file(field);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("glossy"), std::string::npos);
  const std::vector<Vec3> light = some_light();
  DrawRequest d{.baked = "floor", .env = "made", .window = "none", .camera = "0,1,4,0,0,0,30", .size = "48x36"};
  d.spp = 16, d.background = "none";
  d.environment = std::make_shared<const Environment>(reconstruct_environment(light, 128));
  d.place = {"a=" + path("balls.field.glb") + "@0.1,0.2,0,35,20,10"}, d.given = {"place"};
  const Baked floor = nearly_nothing();
  auto drawn = draw(floor, d);
  ASSERT_TRUE(drawn) << drawn.error().text();
  Scene joint = floor.scene, moved = own->scene;
  const Mat3 turn = rotation_from_yaw_pitch_roll({35, 20, 10});
  const Bounds box = bounds(moved);
  for (Vec3& p : moved.positions) p = Vec3(0.1f, 0.2f, 0) + turn * (p - 0.5f * (box.min + box.max));
  for (Vec3& n : moved.normals) n = turn * n;
  append_scene(joint, moved);
  const auto traced = [&](const std::string& model) {
    auto truth = path_trace(joint, *d.environment, parse_view(d.camera, d.size, joint)->camera,
                            {.width = 48,
                             .height = 36,
                             .spp = 1024,
                             .bounces = 0,
                             .background = false,
                             .reflection = *parse_reflection(model)});
    EXPECT_TRUE(truth) << truth.error().text();
    return truth->image;
  };
  const double glossy = decibels(drawn->frames[0], traced(brdf)),
               diffuse = decibels(drawn->frames[0], traced("diffuse"));
  RecordProperty("decibels", std::to_string(glossy));
  RecordProperty("decibels_as_diffuse", std::to_string(diffuse));
  EXPECT_GT(glossy, 30);
  EXPECT_LT(diffuse, glossy - 5);
}

// An egg that turns by its own animation: as it is drawn alone, by the same lobes.
TEST_F(DrawMoving, AnObjectOfLobesFollowsItsAnimation) {
  SKIP_UNDER_SANITIZERS();
  Scene egg = make_sphere(0.5f, 3, Vec3(0.6f));
  test::Builder b;
  std::vector<float> positions, normals;
  for (size_t v = 0; v < egg.positions.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      const Vec3 stretched = egg.positions[v] * Vec3(1.6f, 1, 0.7f);
      positions.push_back(stretched[c]);
      normals.push_back(normalize(egg.normals[v] / Vec3(1.6f, 1, 0.7f))[c]);
    }
  std::vector<uint16_t> indices;
  for (const Triangle& t : egg.triangles)
    for (uint32_t v : t.v) indices.push_back(uint16_t(v));
  const size_t p = b.floats(positions, "VEC3"), n = b.floats(normals, "VEC3"), i = b.indices(indices);
  b.json["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", p}, {"NORMAL", n}}}, {"indices", i}}}}}};
  b.json["nodes"] = {{{"mesh", 0}}};
  const size_t input = b.floats({0, 1}, "SCALAR"), output = b.floats({0, 0, 0, 1, 0, 0, 0.8f, 0.6f}, "VEC4");
  b.json["animations"] = {{{"name", "roll"},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "rotation"}}}}}},
                           {"samplers", {{{"input", input}, {"output", output}}}}}};
  test::write_bytes(path("egg.glb"), b.glb());
  BakeRequest r;
  r.scene = path("egg.glb"), r.transfer = "zonal", r.order = 4, r.samples = 256, r.bounces = "0";
  auto own = bake(r);
  ASSERT_TRUE(own) << own.error().text();
  ASSERT_TRUE(save_baked(path("lobes.glb"), *own));
  FieldRequest field{path("lobes.glb"), path("egg.field.glb")};
  field.shells = 8, field.side = 8, field.samples = 64, field.given = {"shells", "side", "samples"};
  auto made = field_to_file(field);
  ASSERT_TRUE(made) << made.error().text();
  DrawRequest d{.baked = "floor", .env = "made", .window = "none", .camera = "0,1,4,0,0,0,30", .size = "48x36"};
  d.spp = 16, d.background = "none";
  d.environment = std::make_shared<const Environment>(reconstruct_environment(some_light(), 128));
  DrawRequest alone = d;
  alone.baked = path("lobes.glb"), alone.animation = "roll", alone.time = 0.7;
  const Vec3d middle(0.5f * (bounds(own->scene).min + bounds(own->scene).max));
  d.place = {fmt::format("a={}@{:.9g},{:.9g},{:.9g}", path("egg.field.glb"), middle.x, middle.y, middle.z)};
  d.pose = {"a=roll"}, d.time = 0.7;
  const Baked floor = nearly_nothing();
  auto drawn = draw(floor, d);
  ASSERT_TRUE(drawn) << drawn.error().text();
  auto truth = draw(alone);
  ASSERT_TRUE(truth) << truth.error().text();
  d.time = 0;
  auto rest = draw(floor, d);
  ASSERT_TRUE(rest) << rest.error().text();
  const double ours = decibels(drawn->frames[0], truth->frames[0]),
               unmoved = decibels(rest->frames[0], truth->frames[0]);
  RecordProperty("decibels", std::to_string(ours));
  RecordProperty("decibels_at_rest", std::to_string(unmoved));
  EXPECT_GT(ours, 35);
  EXPECT_LT(unmoved, ours - 5);
  d.pose = {"a=jump"};
  auto none = draw(floor, d);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text().find("jump"), std::string::npos) << none.error().text();
  d.pose = {"b=roll"};
  EXPECT_FALSE(draw(floor, d));
}

TEST_F(DrawMoving, ARigidObjectTakesNoPose) {
  make_files();
  DrawRequest r = request({ball_at("0,1,0")});
  r.pose = {"a=0"};
  EXPECT_NE(error_of(r).find("only lobes follow a pose"), std::string::npos) << error_of(r);
}

TEST_F(DrawMoving, LiesAboutAReflectionAreRefused) {
  make_files();
  const std::vector<uint8_t> bytes = *read_file(path("ball.transfer.glb"));
  const std::string text(bytes.begin(), bytes.end());
  const size_t from = text.find("\"reflecting\"");
  ASSERT_NE(from, std::string::npos);
  for (const auto& [said, lie] : {std::pair("\"channels\":3", "\"channels\":1"),
                                  {"\"incidentOrder\":3", "\"incidentOrder\":0"},
                                  {"\"incidentOrder\":3", "\"incidentOrder\":9"},
                                  {"\"order\":4", "\"order\":0"},
                                  {"\"order\":4", "\"order\":3"}}) {
    std::string changed = text;
    const size_t at = changed.find(said, from);
    ASSERT_NE(at, std::string::npos) << said;
    changed.replace(at, std::string(said).size(), lie);
    write("lie.glb", changed);
    auto read = load_baked(path("lie.glb"));
    ASSERT_FALSE(read) << lie;
    EXPECT_NE(read.error().text().find("reflecting"), std::string::npos) << read.error().text();
  }
}

TEST_F(DrawMoving, PathsMoveAndTurnWithTime) {
  make_files();
  write("path.json", R"({"times": [0, 2], "places": [[-1, 0.6, 0], [1, 0.6, 0, 0, 0, 720]]})");
  DrawRequest r = request({ball_at("5,5,5")});
  r.move = {"a=" + path("path.json")}, r.frames = "0:2:1";
  auto drawing = draw(r);
  ASSERT_TRUE(drawing) << drawing.error().text();
  ASSERT_EQ(drawing->frames.size(), 3u);
  auto last = draw(request({ball_at("1,0.6,0,0,0,0,1")}));
  ASSERT_TRUE(last);
  for (size_t i = 0; i < last->frames[0].rgb.size(); ++i)
    EXPECT_LT(length(drawing->frames[2].rgb[i] - last->frames[0].rgb[i]), 1e-4f);
  EXPECT_NE(drawing->frames[0].rgb, drawing->frames[1].rgb);
}

TEST_F(DrawMoving, BadPlacesAndPathsAreRefusedInOneLine) {
  make_files();
  const auto says = [&](const DrawRequest& r, const std::string& part) {
    const std::string error = error_of(r);
    EXPECT_NE(error.find(part), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
  };
  says(request({"ball"}), "expects NAME=FIELD@X,Y,Z");
  says(request({ball_at("0,nan,0")}), "expects NAME=FIELD@X,Y,Z");
  says(request({ball_at("0,1,0,0,0,0,0")}), "scale of a must be from");
  says(request({ball_at("0,1,0,0,0,0,-1")}), "is not mirrored");
  says(request({ball_at("0,1,0"), ball_at("0,2,0")}), "name a is there twice");
  says(request({"a=" + path("ball.glb") + "@0,1,0"}), "does not say what it hides");
  DrawRequest no_lattice = request({ball_at("0,1,0")});
  no_lattice.baked = path("ball.glb");
  says(no_lattice, "bake it with --lattice");
  const auto path_says = [&](const std::string& json, const std::string& part) {
    write("path.json", json);
    DrawRequest r = request({ball_at("0,1,0")});
    r.move = {"a=" + path("path.json")}, r.frames = "0:1:1";
    says(r, part);
  };
  path_says(R"({"times": [1, 0], "places": [[0,1,0], [0,1,0]]})", "times must rise");
  path_says(R"({"times": [0], "places": [[0,1]]})", "place 0 is not X, Y, Z");
  path_says(R"({"times": [0], "places": [[0,1e99,0]]})", "place 0 is not X, Y, Z");
  path_says(R"({"times": [0, 1], "places": [[0,1,0]]})", "as long as each other");
  path_says(R"({"times": [0], "places": [[0,1,0]], "speed": 3})", "speed");
  path_says(R"({"times": [NaN], "places": [[0,1,0]]})", "path.json");
  DrawRequest r = request({ball_at("0,1,0")});
  r.move = {"b=" + path("path.json")}, r.frames = "0:1:1";
  says(r, "no --place is named b");
  says(request(std::vector<std::string>(max_placed_objects + 1, ball_at("0,1,0"))), "are more than");
}

TEST_F(DrawMoving, ManyObjectsInOnePlaceAreDarkAndFinite) {
  make_files();
  std::vector<std::string> many;
  for (int i = 0; i < 100; ++i) many.push_back(ball_at("0,0.6,0", std::to_string(i)));
  auto drawing = draw(request(many));
  ASSERT_TRUE(drawing) << drawing.error().text();
  for (const Vec3& c : drawing->frames[0].rgb) EXPECT_TRUE(is_finite(c));
}

TEST_F(DrawMoving, AFieldIsReadAsItWasWritten) {
  make_files();
  auto field = load_baked(path("ball.field.glb"));
  ASSERT_TRUE(field) << field.error().text();
  const Field* hidden = hiding_of(*field);
  ASSERT_TRUE(hidden);
  EXPECT_EQ(shining_of(*field), nullptr);
  const Shells& s = std::get<ShellPlacement>(hidden->where).shells;
  EXPECT_EQ(s.radii.size(), 8u);
  EXPECT_EQ(s.side, 8);
  EXPECT_NEAR(s.radius, 0.5f, 0.01f);
  EXPECT_EQ(light_of(hidden->store).order, 4);
}

}  // namespace
}  // namespace lambent

#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/field_request.h>
#include <lambent/pipeline/place.h>
#include <lambent/scene/procedural.h>

#include "temporary_folder.h"

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

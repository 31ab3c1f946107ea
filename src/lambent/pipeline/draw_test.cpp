#include <lambent/compress/wrinkle.h>
#include <lambent/core/file.h>
#include <lambent/pipeline/draw.h>
#include <lambent/transfer/zonal_texture.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "sanitizers.h"

namespace lambent {
namespace {

constexpr const char* room_mtl = R"(newmtl red
Kd 0.8 0.3 0.2
newmtl lamp
Kd 0.2 0.2 0.2
Ke 3 2 1
)";
// A floor and a wall, a pyramid's side that shades them, and a lamp.
constexpr const char* room_obj = R"(mtllib room.mtl
v 0 0 0
v 2 0 0
v 2 0 2
v 0 0 2
v 0 2 0
v 2 2 0
v 0.4 0.3 0.6
v 1.4 0.3 0.6
v 1 0.9 1.4
v 0.5 1.5 1
v 1.5 1.5 1
v 1 1.5 1.6
usemtl red
f 4 3 2 1
f 1 2 6 5
f 7 9 8
usemtl lamp
f 10 11 12
)";
constexpr const char* pyramid_obj = "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0.3 0.8 0.3\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n";
constexpr const char* card_obj =
    "v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 4/1 3/2 2/3\nf 4/1 2/3 1/4\n";
constexpr const char* sky = "sky:elevation=40,azimuth=20,turbidity=4,width=64";

class Drawings : public testing::Test {
 protected:
  std::filesystem::path folder;
  void SetUp() override {
    folder = std::filesystem::temp_directory_path() / ("lambent_drawings_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    for (const auto& [name, text] : {std::pair("room.mtl", room_mtl),
                                     {"room.obj", room_obj},
                                     {"pyramid.obj", pyramid_obj},
                                     {"card.obj", card_obj}})
      ASSERT_TRUE(write_file_atomically(at(name), text));
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  std::string at(const std::string& name) const { return (folder / name).string(); }
};

Image picture(const Baked& baked, DrawRequest request, const std::string& show) {
  request.show = show;
  auto drawing = draw(baked, request);
  EXPECT_TRUE(drawing) << drawing.error().text();
  return drawing ? drawing->frames.at(0) : Image();
}

void add(Image& sum, const Image& image) {
  for (size_t i = 0; i < sum.rgb.size(); ++i) sum.rgb[i] += image.rgb[i];
}

double mean_difference(const Image& a, const Image& b) {  // of their mean
  double difference = 0, all = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i)
    difference += double(length(a.rgb[i] - b.rgb[i])), all += double(length(b.rgb[i]));
  return difference / all;
}

void expect_equal(const Image& a, const Image& b) {
  ASSERT_EQ(a.rgb.size(), b.rgb.size());
  for (size_t i = 0; i < a.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(a.rgb[i][c], b.rgb[i][c], 4e-6f * std::max(1.0f, std::abs(b.rgb[i][c]))) << "pixel " << i;
}

// Emission and all reflections add up to the picture, and the first of them to what a bake of as many gives.
TEST_F(Drawings, LightIsHeldAboveZeroWhereItHasPeaksAlone) {
  const auto baked =
      bake_with_summary({.scene = at("room.obj"), .samples = 64, .bounces = "0", .given = {"samples", "bounces"}});
  ASSERT_TRUE(baked) << baked.error().text();
  auto drawn = [&](const std::string& env, const std::string& window) {
    auto drawing = draw(baked->baked, {.env = env,
                                       .window = window,
                                       .camera = "3,2,4,1,0.8,0.8,40",
                                       .size = "24x18",
                                       .background = "none",
                                       .spp = 4});
    EXPECT_TRUE(drawing);
    return std::move(*drawing);
  };
  EXPECT_EQ(drawn("uniform:1", "auto").frames[0].rgb, drawn("uniform:1", "none").frames[0].rgb);
  EXPECT_EQ(drawn("uniform:1", "auto").summary.json["sharp_light"], 0.0);
  const Drawing held = drawn("sky:elevation=20,azimuth=100,width=256", "auto");
  EXPECT_GT(held.summary.json["sharp_light"].get<double>(), 0.2);
  EXPECT_EQ(drawn("sky:elevation=20,azimuth=100,width=256", "none").summary.json["sharp_light"], 0.0);
  for (Vec3 c : held.frames[0].rgb) EXPECT_GE(std::min({c.x, c.y, c.z}), 0.0f);
}

TEST_F(Drawings, ReflectionsOneByOneAddUp) {
  const BakeRequest diffuse{.scene = at("room.obj"),
                            .precision = "single",
                            .max_edge = 0.4f,
                            .denoise = "off",  // each bake would have weights of its own
                            .samples = 64,
                            .bounces = "2",
                            .terms = true,
                            .given = {"precision", "max_edge", "denoise", "samples", "bounces", "terms"}};
  BakeRequest lightmap = diffuse;
  lightmap.transfer = "lightmap", lightmap.atlas = "64x64", lightmap.light_groups = true, lightmap.max_edge = 0,
  lightmap.denoise = "on";
  lightmap.given = {"precision", "samples", "bounces", "terms", "transfer", "atlas", "light_groups"};
  BakeRequest matrix = diffuse;
  matrix.transfer = "matrix", matrix.outgoing = "svd:3", matrix.brdf = "ggx:roughness=0.4", matrix.order = 3;
  matrix.incident_order = 3, matrix.view_map = 16, matrix.denoise = "on";
  matrix.given = {"precision", "max_edge", "samples", "bounces",        "terms",   "transfer",
                  "outgoing",  "brdf",     "order",   "incident_order", "view_map"};
  BakeRequest medium = diffuse;
  medium.subsurface = "sigma_s=20,15,15,sigma_a=0.1", medium.samples = 64, medium.order = 3, medium.denoise = "on";
  medium.given = {"precision", "max_edge", "samples", "bounces", "terms", "subsurface", "order"};
  for (const BakeRequest& asked : {diffuse, lightmap, matrix, medium}) {
    SCOPED_TRACE(asked.transfer + asked.subsurface);
    const auto whole = bake_with_summary(asked);
    ASSERT_TRUE(whole) << whole.error().text();
    ASSERT_EQ(whole->baked.terms.size(), 3u);
    const bool lamps = asked.transfer == "lightmap";
    DrawRequest request{.camera = "3,2,4,1,0.8,0.8,40", .size = "24x18", .background = "none", .spp = 4};
    if (!lamps) request.env = sky, request.window = "none";  // what is held above 0 does not add up
    const Image product = picture(whole->baked, request, "product");
    Image sum = lamps ? picture(whole->baked, request, "emission") : Image(24, 18);
    for (int k = 0; k < 3; ++k) {
      const Image term = picture(whole->baked, request, "bounce:" + std::to_string(k));
      float brightest = 0;
      for (Vec3 p : term.rgb) brightest = std::max(brightest, luminance(p));
      EXPECT_GT(brightest, asked.subsurface.empty() ? 0.001f : 0.0f);  // few walks meet another surface
      add(sum, term);
      expect_equal(picture(whole->baked, request, "sum:" + std::to_string(k)), sum);
      BakeRequest fewer = asked;
      fewer.bounces = std::to_string(k), fewer.terms = false, fewer.given.erase("terms");
      const auto part = bake_with_summary(fewer);
      ASSERT_TRUE(part) << part.error().text();
      expect_equal(picture(part->baked, request, "product"), sum);
      request.show = "sum:0";
      const auto refused = draw(part->baked, request);
      ASSERT_FALSE(refused);
      EXPECT_NE(refused.error().message.find("lambent bake --terms"), std::string::npos);
    }
    expect_equal(product, sum);
    request.show = "bounce:3";
    const auto refused = draw(whole->baked, request);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().where, "--show");
  }
}

// What a test says of an option so that it differs from the request it is put into.
const std::map<std::string, std::string> other_texts{{"env", "sky:elevation=20,azimuth=200,width=64"},
                                                     {"env-rotate", "40,10,0"},
                                                     {"window", "hann"},
                                                     {"camera", "2,3,3,1,0.5,1,35"},
                                                     {"size", "12x12"},
                                                     {"background", "env"},
                                                     {"show", "albedo"},
                                                     {"brdf", "phong:exponent=5,diffuse=0.1,specular=0.6"},
                                                     {"animation", "0"},
                                                     {"frames", "0:1"},
                                                     {"deform", "twist:50,x"},
                                                     {"method", "haar"},
                                                     {"brdf-samples", "full"},
                                                     {"indirect", "sh"},
                                                     {"at", "receivers"},
                                                     {"tile", "3,1"},
                                                     {"wrinkle", "strain"}};
const std::map<std::string, double> other_numbers{{"light-order", 1},    {"spp", 9},           {"time", 1},
                                                  {"tolerance", 4},      {"terms", 20},        {"groove-depth", 0.2},
                                                  {"groove-width", 0.4}, {"frame-bounces", 1}, {"frame-leaves", 1},
                                                  {"near-rays", 1},      {"lamp-bounces", 2}};

// Lamps of the light, moved: where they were nothing changes; elsewhere the picture and its loss are those of
// move_light; over times, pictures one by one; turned with the sky, as --env-rotate turns them.
TEST_F(Drawings, LampsOfTheLightMove) {
  const std::string sun = "sky:elevation=40,azimuth=20,turbidity=4,width=256";
  const auto baked = bake_with_summary({.scene = at("room.obj"),
                                        .light = "sh:4+lamps:2@" + sun,
                                        .samples = 256,
                                        .bounces = "1",
                                        .given = {"light", "samples", "bounces"}});
  ASSERT_TRUE(baked) << baked.error().text();
  const LightBasis light = light_of(baked->baked.surface.store);
  ASSERT_EQ(light.lobes.size(), 1u);
  const Vec3 axis = light.lobes[0].axis;
  const double elevation = double(degrees(std::asin(axis.y))), azimuth = double(degrees(std::atan2(axis.z, axis.x)));
  const DrawRequest base{.env = sun, .camera = "3,2,4,1,0.8,0.8,40", .size = "24x18", .background = "none", .spp = 4};
  std::vector<std::string> warnings;
  const auto drawn = [&](const std::string& move, const std::string& frames = "", const std::string& rotate = "") {
    DrawRequest r = base;
    if (!move.empty()) r.move = {move};
    r.frames = frames, r.env_rotate = rotate;
    warnings.clear();
    auto drawing = draw(baked->baked, r, {nullptr, [&](const std::string& w) { warnings.push_back(w); }});
    EXPECT_TRUE(drawing) << drawing.error().text();
    return std::move(*drawing);
  };
  const auto place = [&](double more) { return fmt::format("{},{}", azimuth + more, elevation); };
  const Drawing still = drawn(""), stays = drawn("1@" + place(0));
  EXPECT_TRUE(warnings.empty()) << warnings[0];
  const Drawing moved = drawn("1@" + place(30));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("lamp 1 is moved to where"), std::string::npos) << warnings[0];
  expect_equal(still.frames[0], stays.frames[0]);
  EXPECT_GT(still.summary.json["held"].get<double>(), 0.7);
  EXPECT_LT(stays.summary.json["moved"][0]["lost"].get<double>(), 1e-3);
  EXPECT_NE(still.frames[0].rgb, moved.frames[0].rgb);
  const auto& told = moved.summary.json["moved"][0];
  EXPECT_EQ(told["lamps"][0]["lamp"], 1);
  EXPECT_NEAR(told["lamps"][0]["degrees"].get<double>(), 30 * std::cos(elevation * std::numbers::pi / 180), 1.0);
  EXPECT_LT(told["lamps"][0]["held"].get<double>(), 0.1);  // a sun, far from its lobe
  EXPECT_GT(told["lost"].get<double>(), 0.8);
  const Drawing film = drawn("1@0:" + place(0) + ";2:" + place(60), "0:1:1");
  ASSERT_EQ(film.frames.size(), 2u);
  EXPECT_EQ(warnings.size(), 1u);  // a lamp, not a frame
  expect_equal(film.frames[0], stays.frames[0]);
  EXPECT_GT(film.summary.json["moved"][1]["lost"].get<double>(), 0.8);
  // The whole sky turned is its harmonics turned and its lamp carried along.
  expect_equal(drawn("1@" + place(0), "", "0,0,0").frames[0], still.frames[0]);
  const Vec3 turned = rotation_from_yaw_pitch_roll({25, 0, 0}) * axis;
  const std::string along = fmt::format("{},{}", degrees(std::atan2(turned.z, turned.x)), elevation);
  const Drawing by_hand = drawn("1@" + along, "", "25,0,0");
  // A lamp that the whole sky took away from its lobe is warned of, too.
  const Drawing away = drawn("", "", "60,0,0");
  EXPECT_LT(away.summary.json["held"].get<double>(), 0.5);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("of the light's energy"), std::string::npos) << warnings[0];
  EXPECT_LT(mean_difference(by_hand.frames[0], drawn("", "", "25,0,0").frames[0]), 0.02);
  EXPECT_GT(mean_difference(by_hand.frames[0], still.frames[0]), 0.05);
}

TEST_F(Drawings, LampsThatCannotMoveAreRefusedByName) {
  const auto refused = [&](const std::string& light, std::vector<std::string> move) {
    const auto baked = bake_with_summary({.scene = at("room.obj"),
                                          .light = light,
                                          .samples = 16,
                                          .bounces = "0",
                                          .given = {"light", "samples", "bounces"}});
    EXPECT_TRUE(baked) << baked.error().text();
    DrawRequest r{.env = sky, .size = "8x8", .spp = 1};
    r.move = std::move(move);
    auto drawing = draw(baked->baked, r);
    EXPECT_FALSE(drawing);
    EXPECT_EQ(drawing.error().where, "--move");
    return drawing.error().message;
  };
  const std::string lamp = "sh:3+lamps:1@" + std::string(sky);
  EXPECT_NE(refused("sh:3", {"1@20,30"}).find("lamps:COUNT@ENV"), std::string::npos);
  EXPECT_NE(refused("directional:9", {"1@20,30"}).find("none is a lamp"), std::string::npos);
  EXPECT_NE(refused(lamp, {"2@20,30"}).find("no lamp 2"), std::string::npos);
  EXPECT_NE(refused(lamp, {"1@20,130"}).find("elevation"), std::string::npos);
  EXPECT_NE(refused(lamp, {"1@20,30", "1@20,40"}).find("twice"), std::string::npos);
}

// Every option of the table, said of a file of every kind: it changes the picture, or is refused or warned of by name.
TEST_F(Drawings, NoOptionIsLeftAsideInSilence) {
  WrinkleOptions wrinkles;
  wrinkles.size = 6;
  auto grooves = make_wrinkle_table(wrinkles);
  ASSERT_TRUE(grooves) << grooves.error().text();
  ASSERT_TRUE(save_zonal_texture(at("grooves.lpt"), grooves->texture));
  Image half(2, 1);
  half.rgb = {Vec3(0.0f), Vec3(1.0f)};
  ASSERT_TRUE(save_image(at("half.png"), half));
  const std::pair<DrawKind, const char*> files[] = {{DrawKind::diffuse, "diffuse_lattice"},
                                                    {DrawKind::clusters, "diffuse_clusters"},
                                                    {DrawKind::lobes, "zonal"},
                                                    {DrawKind::matrix, "matrix_map"},
                                                    {DrawKind::factors, "factors"},
                                                    {DrawKind::lamps, "lightmap"},
                                                    {DrawKind::blocks, "blocks"},
                                                    {DrawKind::fixed_view, "diffuse_fixed_view"},
                                                    {DrawKind::indirect, "indirect"},
                                                    {DrawKind::wavelets, "wavelets"},
                                                    {DrawKind::texture, ""}};
  const size_t of_each = under_sanitizers() ? 4 : 1;  // every option with some kinds
  for (const auto& [kind, name] : files) {
    DrawRequest base{.baked = std::string(LAMBENT_GOLDEN) + "/" + name + ".glb", .env = sky, .background = "none"};
    if (kind == DrawKind::texture)
      base.baked = at("card.obj"), base.transfer_texture = at("grooves.lpt"), base.tile = "5,0";
    if (kind == DrawKind::indirect) base.lamp = {"point@1,1,1=3"};
    if (kind == DrawKind::blocks) base.brdf = "phong:exponent=20,diffuse=0.3,specular=0.4";
    if (kind != DrawKind::fixed_view) base.camera = "3,2,4,1,0.5,1,40", base.size = "16x12", base.spp = 4;
    const auto before = draw(base);
    ASSERT_TRUE(before) << name << ": " << before.error().text();
    size_t index = size_t(kind);
    for (const auto& option : draw_options()) {
      const std::string option_name = option.name;
      if (index++ % of_each != 0) continue;
      // The picture is written by draw_to_file(); other files have other tests.
      if (option_name == "baked" || option_name == "output" || option_name == "exposure" || option_name == "tone" ||
          option_name == "transfer-texture")
        continue;
      SCOPED_TRACE(std::string(draw_kind_names[int(kind)]) + ", --" + option_name);
      DrawRequest request = base;
      request.given.insert(json_name(option.name));
      std::visit(
          [&, kind = kind](auto member) {
            using T = std::remove_cvref_t<decltype(request.*member)>;
            if constexpr (std::is_same_v<T, std::string>)
              request.*member = option_name == "groove-map" ? at("half.png") : other_texts.at(option_name);
            else if constexpr (std::is_same_v<T, std::vector<std::string>>)
              request.*member = {option_name == "lamp"
                                     ? kind == DrawKind::indirect ? "spot@1,1,1,1,0,1,50=3,2,1" : "lamp=0.1,0.2,0.5"
                                 : option_name == "move"     ? "1@0:1,1.2,1"
                                 : option_name == "albedo"   ? "red=0.1,0.2,0.9"
                                 : option_name == "material" ? "red=phong:exponent=40,diffuse=0.1,specular=0.8"
                                 : option_name == "insert"   ? at("pyramid.obj") + "@1,0.1,1,0.8"
                                                             : "1,2,2,0.5,9,8,7"};
            else if constexpr (!std::is_same_v<T, bool>) request.*member = T(other_numbers.at(option_name));
          },
          option.member);
      if (option_name == "move") request.frames = "0:0";
      bool warned = false;
      const auto after = draw(request, {nullptr, [&](const std::string&) { warned = true; }});
      if (!(option.kinds >> int(kind) & 1)) {
        ASSERT_FALSE(after);
        EXPECT_EQ(after.error().where, "--" + option_name);
        EXPECT_NE(after.error().message.find("does not go with"), std::string::npos) << after.error().text();
      } else if (after) {
        const Image &a = before->frames[0], &b = after->frames[0];
        EXPECT_TRUE(warned || a.rgb != b.rgb || a.alpha != b.alpha) << "has no effect";
      } else {
        EXPECT_NE(after.error().text().find(option_name), std::string::npos) << after.error().text();
      }
    }
  }
}

}  // namespace
}  // namespace lambent

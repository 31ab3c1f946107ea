#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/pose.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using test::Builder;
using test::Json;
using test::loaded;

double distance(const Mat3& a, const Mat3& b) {
  double sum = 0;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) sum += double(a[i][k] - b[i][k]) * (a[i][k] - b[i][k]);
  return std::sqrt(sum);
}

// The triangle with one channel on its node.
Builder animated(const char* path, const std::vector<float>& times, const std::vector<float>& values, const char* shape,
                 const char* how) {
  Builder b = test::triangle();
  const size_t input = b.floats(times, "SCALAR"), output = b.floats(values, shape);
  b.json["animations"] = {{{"name", "go"},
                           {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}}}},
                           {"samplers", {{{"input", input}, {"output", output}, {"interpolation", how}}}}}};
  return b;
}

Pose at(const Scene& scene, double time) {
  auto pose = pose_scene(scene, 0, time);
  if (!pose) ADD_FAILURE() << pose.error().text();
  return pose ? *pose : Pose{};
}

TEST(Pose, InterpolatesTranslations) {
  const Scene linear = loaded(animated("translation", {1, 3}, {0, 0, 0, 4, 2, 0}, "VEC3", "LINEAR"));
  EXPECT_EQ(at(linear, 0).positions[0], Vec3(0, 0, 0));
  EXPECT_EQ(at(linear, 1.5).positions[0], Vec3(1, 0.5f, 0));
  EXPECT_EQ(at(linear, 9).positions[1], Vec3(6, 2, 0));
  EXPECT_LT(distance(at(linear, 2).rotations[0], Mat3(1.0f)), 1e-6);
  const Scene step = loaded(animated("translation", {1, 3}, {0, 0, 0, 4, 2, 0}, "VEC3", "STEP"));
  EXPECT_EQ(at(step, 2.9).positions[0], Vec3(0, 0, 0));
  EXPECT_EQ(at(step, 3).positions[0], Vec3(4, 2, 0));
  // One cubic piece: value 0, out-tangent 1, in-tangent 3, value 4, over two seconds: Hermite's basis at its middle is
  // 1/2, 1/8, 1/2, -1/8.
  const Scene cubic = loaded(
      animated("translation", {1, 3}, {9, 9, 9, 0, 0, 0, 1, 0, 0, 3, 0, 0, 4, 0, 0, 9, 9, 9}, "VEC3", "CUBICSPLINE"));
  EXPECT_NEAR(at(cubic, 2).positions[0].x, 0.5 * 4 + 2 * (0.125 * 1 - 0.125 * 3), 1e-6);
  EXPECT_NEAR(at(cubic, 1.5).positions[0].x, 2 * (0.140625 * 1 - 0.046875 * 3) + 0.15625 * 4, 1e-6);
}

TEST(Pose, TurnsAlongTheShorterGreatCircle) {
  // Rotations of 0 and 120 degrees about a skew axis, the second with its sign changed and not of unit length.
  const Vec4 q(std::sin(radians(60.0f)) * normalize(Vec3(1, 2, -2)), std::cos(radians(60.0f)));
  const Scene scene =
      loaded(animated("rotation", {0, 1}, {0, 0, 0, 1, -3 * q.x, -3 * q.y, -3 * q.z, -3 * q.w}, "VEC4", "LINEAR"));
  for (double t : {0.0, 0.25, 0.5, 1.0}) {
    const Pose p = at(scene, t);
    const Mat3 R = rotation_about(normalize(Vec3(1, 2, -2)), float(radians(120.0 * t)));
    for (size_t v = 0; v < 3; ++v) {
      EXPECT_LT(length(p.positions[v] - R * scene.positions[v]), 1e-5);
      EXPECT_LT(length(p.normals[v] - R * scene.normals[v]), 1e-5);
      EXPECT_LT(distance(p.rotations[v], R), 1e-5);
    }
  }
  // A rotation of zero is none.
  EXPECT_EQ(at(loaded(animated("rotation", {0, 1}, {0, 0, 0, 0, 0, 0, 0, 0}, "VEC4", "LINEAR")), 0.5).positions[1],
            Vec3(2, 0, 0));
}

TEST(Pose, ScalesToNothingAndMirrors) {
  const Scene scene = loaded(animated("scale", {0, 1}, {1, 1, 1, -1, 1, 1}, "VEC3", "LINEAR"));
  const Pose flat = at(scene, 0.5), mirrored = at(scene, 1);
  for (size_t v = 0; v < 3; ++v) {
    EXPECT_TRUE(is_finite(flat.normals[v]));
    EXPECT_LT(std::abs(length(flat.normals[v]) - 1), 1e-5);
    EXPECT_LT(distance(transpose(flat.rotations[v]) * flat.rotations[v], Mat3(1.0f)), 1e-5);
    EXPECT_LT(distance(mirrored.rotations[v], Mat3(Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1))), 1e-5);
  }
  EXPECT_EQ(mirrored.mirrored[0], 1);
  const Scene turned = posed(scene, mirrored);
  EXPECT_GT(area_normal(turned, turned.triangles[0]).z, 0);  // still seen from the same side
}

TEST(Pose, MorphsByAnimatedWeights) {
  Builder b = test::triangle();
  b.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", b.floats({0, 0, 3, 0, 0, 3, 0, 0, 3}, "VEC3")}},
                                                     {{"POSITION", b.floats({0, 0, 0, 1, 0, 0, 0, 0, 0}, "VEC3")}}};
  const size_t input = b.floats({0, 2}, "SCALAR"), output = b.floats({0, 1, 1, 0}, "SCALAR");
  b.json["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}},
                           {"samplers", {{{"input", input}, {"output", output}}}}}};
  const Pose p = at(loaded(b), 0.5);
  EXPECT_EQ(p.positions[0], Vec3(0, 0, 0.75f));
  EXPECT_EQ(p.positions[1], Vec3(2.75f, 0, 0.75f));
}

TEST(Pose, RefusesBrokenAnimations) {
  auto message = [](const Builder& b) {
    auto scene = b.load();
    if (!scene) return scene.error().text();
    auto pose = pose_scene(*scene, 0, 0.5);
    return pose ? std::string() : pose.error().text();
  };
  EXPECT_NE(message(test::triangle()), "");
  const Builder good = animated("translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3", "LINEAR");
  EXPECT_EQ(message(good), "");
  EXPECT_NE(message(animated("translation", {1, 0}, {0, 0, 0, 1, 0, 0}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("translation", {0, NAN}, {0, 0, 0, 1, 0, 0}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("translation", {0, 1}, {0, 0, 0, INFINITY, 0, 0}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("translation", {0, 1, 2}, {0, 0, 0, 1, 0, 0}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("rotation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3", "CUBICSPLINE")), "");
  EXPECT_NE(message(animated("translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3", "WAVES")), "");
  EXPECT_NE(message(animated("translation", {}, {}, "VEC3", "LINEAR")), "");
  EXPECT_NE(message(animated("weights", {0, 1}, {0, 1}, "SCALAR", "LINEAR")).find('?'),
            0u);  // weights without targets: said or ignored
  for (auto [key, value] : {std::pair<const char*, Json>{"channels", Json()},
                            {"channels", Json::array({1})},
                            {"samplers", Json()},
                            {"samplers", Json::array()},
                            {"samplers", Json::array({Json::object()})}}) {
    Builder b = good;
    if (value.is_null()) b.json["animations"][0].erase(key);
    else b.json["animations"][0][key] = value;
    EXPECT_NE(message(b), "") << key << value;
  }
  Builder astray = good;
  astray.json["animations"][0]["channels"][0]["target"]["node"] = 7;
  EXPECT_NE(message(astray), "");
  // To be ignored: no node, or a path of some extension.
  Builder nowhere = good;
  nowhere.json["animations"][0]["channels"][0]["target"].erase("node");
  EXPECT_EQ(message(nowhere), "");
  Builder pointer = good;
  pointer.json["animations"][0]["channels"][0]["target"]["path"] = "pointer";
  EXPECT_EQ(message(pointer), "");
  EXPECT_FALSE(pose_scene(make_sphere(1, 1, Vec3(1)), 0, 0));
  EXPECT_FALSE(pose_scene(*good.load(), 1, 0));
  EXPECT_FALSE(pose_scene(*good.load(), 0, NAN));
}

TEST(Pose, KeysBeforeZeroAndTwoAtOneTime) {
  const Scene early = loaded(animated("translation", {-2, 2}, {0, 0, 0, 4, 0, 0}, "VEC3", "LINEAR"));
  EXPECT_EQ(at(early, -1).positions[0], Vec3(1, 0, 0));
  EXPECT_EQ(at(early, 0).positions[0], Vec3(2, 0, 0));
  EXPECT_EQ((*list_animations(early))[0].from, -2);
  // A jump at 1, from 2 to 6: from there on the later key.
  for (const char* how : {"LINEAR", "STEP"}) {
    const Scene jump = loaded(animated("translation", {0, 1, 1, 2}, {0, 0, 0, 2, 0, 0, 6, 0, 0, 8, 0, 0}, "VEC3", how));
    const bool linear = how == std::string("LINEAR");
    EXPECT_EQ(at(jump, 0.5).positions[0], Vec3(linear ? 1 : 0, 0, 0));
    EXPECT_EQ(at(jump, 1).positions[0], Vec3(6, 0, 0));
    EXPECT_EQ(at(jump, 1.5).positions[0], Vec3(linear ? 7 : 6, 0, 0));
    EXPECT_EQ(at(jump, 3).positions[0], Vec3(8, 0, 0));
  }
  // All keys at one time: before it the first, then the last.
  const Scene at_once = loaded(animated("translation", {1, 1}, {2, 0, 0, 6, 0, 0}, "VEC3", "LINEAR"));
  EXPECT_EQ(at(at_once, 0).positions[0], Vec3(2, 0, 0));
  EXPECT_EQ(at(at_once, 1).positions[0], Vec3(6, 0, 0));
}

TEST(Pose, ABrokenAnimationHarmsNoOther) {
  Builder b = animated("translation", {0, 1}, {0, 0, 0, 4, 0, 0}, "VEC3", "LINEAR");
  b.json["animations"].push_back({{"name", "bad"}, {"channels", {1}}});
  b.json["animations"].push_back(7);
  std::swap(b.json["animations"][0], b.json["animations"][1]);
  const Scene scene = loaded(b);
  EXPECT_EQ(*find_animation(scene, "go"), 1u);
  EXPECT_EQ(pose_scene(scene, 1, 0.5)->positions[0], Vec3(2, 0, 0));
  EXPECT_FALSE(pose_scene(scene, 0, 0.5));
  EXPECT_FALSE(pose_scene(scene, 2, 0.5));
  const auto list = *list_animations(scene);
  ASSERT_EQ(list.size(), 3u);
  EXPECT_NE(list[0].problem, "");
  EXPECT_EQ(list[1].problem, "");
  EXPECT_EQ(list[1].to, 1);
  EXPECT_NE(list[2].problem, "");
}

TEST(Pose, FindsAnimations) {
  const Scene scene = loaded(animated("translation", {1, 3}, {0, 0, 0, 4, 2, 0}, "VEC3", "LINEAR"));
  EXPECT_EQ(*find_animation(scene, "go"), 0u);
  EXPECT_EQ(*find_animation(scene, "0"), 0u);
  EXPECT_FALSE(find_animation(scene, "1"));
  EXPECT_FALSE(find_animation(scene, "run"));
  EXPECT_FALSE(find_animation(loaded(test::triangle()), "0"));
  EXPECT_FALSE(find_animation(make_sphere(1, 1, Vec3(1)), "0"));
  const auto list = *list_animations(scene);
  EXPECT_EQ(list[0].from, 1);
  EXPECT_EQ(list[0].to, 3);
}

TEST(Pose, PosesTheSharedModels) {
  const std::string folder = test::data_folder();
  if (folder.empty()) GTEST_SKIP() << "no data folder";
  for (const char* name : {"CesiumMan.glb", "Fox.glb", "MorphStressTest.gltf"}) {
    auto scene = load_scene(folder + "/meshes/" + name);
    ASSERT_TRUE(scene) << scene.error().text();
    const auto list = *list_animations(*scene);
    ASSERT_FALSE(list.empty());
    for (size_t a = 0; a < list.size(); ++a) {
      float moved = 0;
      for (double u : {0.0, 0.3, 0.7}) {
        auto pose = pose_scene(*scene, a, list[a].from + u * (list[a].to - list[a].from));
        ASSERT_TRUE(pose) << pose.error().text();
        for (size_t v = 0; v < scene->positions.size(); ++v) {
          ASSERT_TRUE(is_finite(pose->positions[v]));
          ASSERT_LT(std::abs(length(pose->normals[v]) - 1), 1e-4);
          // An orthogonal matrix that takes the normal along.
          ASSERT_LT(distance(transpose(pose->rotations[v]) * pose->rotations[v], Mat3(1.0f)), 1e-4);
          ASSERT_LT(length(pose->rotations[v] * scene->normals[v] - pose->normals[v]), 1e-3);
          moved = std::max(moved, length(pose->positions[v] - scene->positions[v]));
        }
      }
      EXPECT_GT(moved, 0.01f * bounds(*scene).diagonal()) << name << ' ' << a;
    }
  }
}

TEST(Deform, TwistsAndBendsAsTheFormulasSay) {
  Scene scene;
  add_box(scene, add_material(scene, "grey", Vec3(0.5f)), "box", Vec3(-1, 0, -1), Vec3(1, 6, 1), 12);
  const Pose twist = deform_scene(scene, *parse_deformation("twist:90"));
  const Pose bend = deform_scene(scene, *parse_deformation("bend:180,y,x"));
  double twisted = 0;
  for (size_t v = 0; v < scene.positions.size(); ++v) {
    const Vec3 p = scene.positions[v];
    // Twist: a quarter turn from end to end; heights stay, distances from the axis too.
    EXPECT_NEAR(twist.positions[v].y, p.y, 1e-4);
    const Mat3 R = rotation_from_yaw_pitch_roll({90 * (p.y - 3) / 6, 0, 0});
    EXPECT_LT(length(twist.positions[v] - R * p), 1e-4);
    twisted = std::max(twisted, distance(twist.rotations[v], R));
    EXPECT_LT(length(twist.rotations[v] * scene.normals[v] - twist.normals[v]), 1e-4);
    // Bend: the middle line is half a circle of length 6 about (6 / pi, 3, 0), and each cross-section turns rigidly.
    const float angle = pi * (p.y - 3) / 6, radius = 6 / pi;
    const Vec3 on_arc(radius * (1 - std::cos(angle)), 3 + radius * std::sin(angle), 0);
    const Mat3 B(Vec3(std::cos(angle), -std::sin(angle), 0), Vec3(std::sin(angle), std::cos(angle), 0), Vec3(0, 0, 1));
    EXPECT_LT(length(bend.positions[v] - (on_arc + B * Vec3(p.x, 0, p.z))), 1e-4);
    EXPECT_LT(length(bend.normals[v] - B * scene.normals[v]), 1e-4);
    EXPECT_LT(distance(bend.rotations[v], B), 1e-4);
  }
  EXPECT_LT(twisted, 0.5);  // shear bends the polar rotation and the normals away from it
  EXPECT_LT(distance(deform_scene(scene, *parse_deformation("bend:0")).rotations[0], Mat3(1.0f)), 1e-5);
}

TEST(Deform, RefusesOtherTexts) {
  for (const char* text : {"", "bend", "bend:", "bend:x", "bend:400", "bend:nan", "bend:10,", "bend:10,w",
                           "bend:10,y,y", "bend:10,x,y,z", "twist:10,x,y", "twist:1e9", "melt:3"})
    EXPECT_FALSE(parse_deformation(text)) << text;
  EXPECT_EQ(parse_deformation("bend:-30,z,x")->towards, 0);
}

TEST(Deform, RotationsOfOddGradients) {
  const Vec3 a = normalize(Vec3(1, 2, 3)), b = normalize(Vec3(-2, 1, 0.5f));
  for (const Mat3d& F : {Mat3d(0.0), Mat3d(NAN), Mat3d(Vec3d(1, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 0, 1)), Mat3d(-1.0),
                         Mat3d(Vec3d(1, 0.5, 0), Vec3d(0, 3, 0.2), Vec3d(0.1, 0, 0.01))})
    for (const Vec3& to : {a, b, -a}) {
      const Mat3 R = pose_rotation(F, a, to);
      EXPECT_LT(distance(transpose(R) * R, Mat3(1.0f)), 1e-5);
      EXPECT_LT(length(R * a - to), 1e-4);
    }
}

}  // namespace
}  // namespace lambent

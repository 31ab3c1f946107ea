// Files as environments: the same light said plainly, or its closed form.
#include <lambent/light/environment.h>
#include <lambent/light/project.h>

#include <exr_maker.h>
#include <gtest/gtest.h>

#include <numbers>

namespace lambent {
namespace {

using test::Bytes, test::Maker;

Environment environment(const Bytes& bytes) {
  auto env = environment_from_file(bytes, "a.exr");
  EXPECT_TRUE(env) << env.error().text();
  return env ? *env : Environment{};
}

// Red, the l = 0 coefficient: the sphere's mean times 2 sqrt(pi).
float mean(const Environment& env) { return project_environment(env, 1)[0].x / (2 * std::sqrt(pi)); }

TEST(EnvironmentFile, APartOfTheSphereIsBlackOutside) {
  // A quarter of the sphere: the upper half of the half around +X.
  Maker part(64, 32, {"R", "G", "B"}), whole(64, 32, {"R", "G", "B"});
  part.header.dataWindow() = Imath::Box2i({16, 0}, {47, 15});
  part.value = [](size_t, int, int) { return 1.0f; };
  whole.value = [](size_t, int x, int y) { return x >= 16 && x < 48 && y < 16 ? 1.0f : 0.0f; };
  const Environment cropped = environment(part.bytes()), same = environment(whole.bytes());
  EXPECT_EQ(cropped.image.rgb, same.image.rgb);
  EXPECT_NEAR(mean(cropped), 0.25f, 1e-6f);
  EXPECT_TRUE(cropped.warnings.empty());
  // Not a panorama that ends somewhere without saying where it belongs.
  EXPECT_FALSE(environment_from_file(Maker(64, 20, {"R"}).bytes(), "a.exr"));
}

Bytes with_envmap(Maker maker, Imf::Envmap envmap) {
  maker.header.insert("envmap", Imf::EnvmapAttribute(envmap));
  return maker.bytes();
}

TEST(EnvironmentFile, TheEnvmapAttributeTurns) {
  Maker maker(64, 32, {"R"});
  maker.value = [](size_t, int x, int y) { return x == 32 && y == 15 ? 1.0f : 0.0f; };  // the middle: OpenEXR's +Z
  EXPECT_GT(radiance(environment(with_envmap(maker, Imf::ENVMAP_LATLONG)), normalize(Vec3(-0.05f, 0.05f, 1))).x, 0);
  EXPECT_GT(radiance(environment(maker.bytes()), normalize(Vec3(1, 0.05f, 0.05f))).x, 0);  // ours: +X
  // By the attribute the data window is the sphere; a crop of another shape lies in the display window.
  maker.header.displayWindow() = Imath::Box2i({0, 0}, {127, 63});
  const Environment own = environment(with_envmap(maker, Imf::ENVMAP_LATLONG));
  EXPECT_EQ(own.image.width, 64);
  EXPECT_EQ(own.warnings,
            std::vector<std::string>{
                "a.exr: its envmap attribute lays its data window over the sphere, not its display window"});
  maker.header.dataWindow() = Imath::Box2i({0, 0}, {127, 31});
  maker.value = [](size_t, int, int) { return 1.0f; };
  const Environment upper = environment(with_envmap(maker, Imf::ENVMAP_LATLONG));
  EXPECT_EQ(upper.image.width, 128);
  EXPECT_NEAR(mean(upper), 0.5f, 1e-6f);
}

TEST(EnvironmentFile, CubesByTheAttributeAndByShape) {
  // +Y of both, the third face: a sixth of the sphere, around the zenith.
  Maker maker(8, 48, {"R"});
  maker.value = [](size_t, int, int y) { return y >= 16 && y < 24 ? 1.0f : 0.0f; };
  for (const Bytes& bytes : {maker.bytes(), with_envmap(maker, Imf::ENVMAP_CUBE)}) {
    const Environment env = environment(bytes);
    EXPECT_NEAR(mean(env), 1 / 6.0f, 1e-3f / 6);
    EXPECT_EQ(radiance(env, {0, 1, 0}).x, 1);
  }
}

TEST(EnvironmentFile, InfinityIsTheLargestHalfFloat) {
  Maker maker(8, 4, {"R", "G", "B"}, Imf::HALF);
  maker.value = [](size_t, int x, int y) { return x == 3 && y == 1 ? INFINITY : 1.0f; };
  Environment env = environment(maker.bytes());
  EXPECT_EQ(env.image.at(3, 1), Vec3(65504));
  EXPECT_EQ(
      env.warnings,
      std::vector<std::string>{
          "a.exr: 1 pixel with a channel that is infinite: taken as 65504, the largest that its half floats hold"});
  maker.value = [](size_t, int x, int y) { return x == 3 && y == 1 ? INFINITY : x == 0 && y == 0 ? 7.0f : 1.0f; };
  for (auto& [name, channel] : maker.channels) channel.type = Imf::FLOAT;
  maker.header.channels() = Imf::ChannelList();
  EXPECT_EQ(environment(maker.bytes()).image.at(3, 1), Vec3(7));
}

}  // namespace
}  // namespace lambent

#include <lambent/brdf/parse_brdf.h>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace lambent {
namespace {

template <class T>
T parsed(const char* text) {
  auto brdf = parse_brdf(text);
  EXPECT_TRUE(brdf) << text << ": " << brdf.error().text();
  if (!brdf || !std::holds_alternative<T>(*brdf)) {
    ADD_FAILURE() << text << " is another model";
    return {};
  }
  return std::get<T>(*brdf);
}

std::string error(std::string_view text) {
  auto brdf = parse_brdf(text);
  return brdf ? std::string() : brdf.error().text();
}

TEST(ParseBrdf, EveryModel) {
  EXPECT_EQ(parsed<Lambert>("lambert").albedo, Vec3(0.8f));
  EXPECT_EQ(parsed<Lambert>("lambert:albedo=0.25").albedo, Vec3(0.25f));
  EXPECT_EQ(parsed<Lambert>("lambert:albedo=0.1,0.2,1").albedo, Vec3(0.1f, 0.2f, 1));
  const Phong phong = parsed<Phong>("phong:exponent=50,diffuse=0.1,0.2,0.3,specular=0.5");
  EXPECT_EQ(phong.exponent, 50);
  EXPECT_EQ(phong.diffuse, Vec3(0.1f, 0.2f, 0.3f));
  EXPECT_EQ(phong.specular, Vec3(0.5f));
  const Ggx ggx = parsed<Ggx>("ggx:roughness=0.5,0.25,f0=1,0.5,0.25");
  EXPECT_EQ(ggx.alpha, Vec2(0.25f, 0.0625f));
  EXPECT_EQ(ggx.f0, Vec3(1, 0.5f, 0.25f));
  EXPECT_EQ(parsed<Ggx>("ggx:roughness=0.5").alpha, Vec2(0.25f));
  const CookTorrance cook = parsed<CookTorrance>("cook-torrance:specular=0.5,roughness=0.125,f0=0.04,diffuse=0.5");
  EXPECT_EQ(cook.m, 0.125f);
  EXPECT_EQ(cook.f0, Vec3(0.04f));
  EXPECT_EQ(cook.specular, Vec3(0.5f));
  const Ward ward = parsed<Ward>("ward:ax=0.05,ay=0.5");
  EXPECT_EQ(ward.alpha, Vec2(0.05f, 0.5f));
  const MetallicRoughness mr = parsed<MetallicRoughness>("metallic-roughness:color=1,0.5,0,metallic=1,roughness=0.25");
  EXPECT_EQ(mr.base_color, Vec3(1, 0.5f, 0));
  EXPECT_EQ(mr.metallic, 1);
  EXPECT_EQ(mr.roughness, 0.25f);
}

TEST(ParseBrdf, Measured) {
  const std::string path = testing::TempDir() + "with,comma.brdf";
  std::ofstream(path) << "6 440 480 520 560 600 640\n0.1 0 0.2 1 .1 .1 .1 .1 .1 .1\n";
  auto brdf = parse_brdf("measured:" + path);
  ASSERT_TRUE(brdf) << brdf.error().text();
  EXPECT_NEAR(evaluate(*brdf, Vec3(0, 0, 1), Vec3(0, 0, 1)).y, 0.1f, 1e-4f);
  std::filesystem::remove(path);
  EXPECT_NE(error("measured:" + path).find("no such file"), std::string::npos);
  EXPECT_EQ(error("measured:"), "measured: names no file");
}

TEST(ParseBrdf, RefusesInOneLine) {
  EXPECT_EQ(error("glass"),
            "no reflection model \"glass\": lambert, phong, ggx, cook-torrance, ward, metallic-roughness or measured");
  EXPECT_EQ(error("lambert:colour=1"), "lambert: there is no \"colour\"; it takes albedo");
  EXPECT_EQ(error("ggx:roughness"), "ggx: \"roughness\" is not of the form key=value");
  EXPECT_EQ(error("ggx:roughness=0.3,roughness=0.4"), "ggx: \"roughness\" is given twice");
  EXPECT_EQ(error("ggx:roughness="), "ggx: \"roughness\" is not a number: \"\"");
  EXPECT_EQ(error("ggx:roughness=0.3,"), "ggx: ends in a comma");
  EXPECT_EQ(error("ggx:roughness=nan"), "ggx: \"roughness\" is not a number: \"nan\"");
  EXPECT_EQ(error("ggx:roughness=2"), "ggx: roughness must lie in [0, 1]");
  EXPECT_EQ(error("ggx:roughness=-0.1"), "ggx: roughness must lie in [0, 1]");
  EXPECT_EQ(error("ggx:roughness=0.1,0.2,0.3"), "ggx: roughness takes one number or 2");
  EXPECT_EQ(error("ward:ax=0.1,0.2"), "ward: ax takes one number");
  EXPECT_EQ(error("lambert:albedo=1,2"), "lambert: albedo takes one number or 3");
  EXPECT_EQ(error("phong:exponent=1e6"), "phong: exponent must lie in [0, 100000]");
  EXPECT_EQ(error("phong:diffuse=0.5,specular=0.1,0.6,0.1"), "phong: diffuse and specular add up to more than 1");
  for (const char* text : {"", ":", "=", "lambert:=", "lambert:,", "a\nb", "ggx:\n=1", "ggx:\n=a", "ggx:x=\n"}) {
    EXPECT_FALSE(error(text).empty()) << text;
    EXPECT_EQ(error(text).find('\n'), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace lambent

#include <lambent/scene/load.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "temporary_folder.h"
#include "test_meshes.h"

namespace lambent {
namespace {

using test::bytes_of;
using test::TemporaryFolder;
using test::tiny_png;

Result<Scene> load(std::string_view text, const std::string& folder) {
  return load_obj(bytes_of(text), "t.obj", folder);
}

Scene must_load(std::string_view text, const std::string& folder) {
  auto scene = load(text, folder);
  EXPECT_TRUE(scene) << scene.error().text();
  if (!scene) return test::bare_cube();
  EXPECT_EQ(test::broken_invariant(*scene), "");
  return *scene;
}

// A triangle of the material `m` of a library that says `mtl`.
Scene with_material(const TemporaryFolder& folder, const std::string& mtl) {
  folder.write("t.mtl", "newmtl m\n" + mtl);
  return must_load("mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n",
                   folder.path.string());
}

TEST(LoadMtl, MaterialsAndTextures) {
  TemporaryFolder folder;
  folder.write("my lib.mtl",
               "newmtl red\r\nKd 1.5 0.25 -1\r\nKe 2 0 0\r\nnewmtl grey\r\nKd 0.5\r\n"
               "newmtl image\r\nKd 1 1 1\r\nmap_Kd -clamp on -s 2 3 1 -o 0.25 0.5 -bm 1 .\\50% tex.png\r\n");
  folder.write("50% tex.png", tiny_png());
  std::string text =
      "mtllib my lib.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.1 0.2\n"
      "usemtl red\nf 1 2 3\nusemtl grey\nf 1 2 4\nusemtl image\nf 1/1 3/1 4/1\n";
  Scene s = must_load(text, folder.path.string());
  EXPECT_TRUE(s.warnings.empty());
  ASSERT_EQ(s.materials.size(), 3u);
  EXPECT_EQ(s.materials[0].base_color, Vec3(1, 0.25f, 0));
  EXPECT_EQ(s.materials[0].emissive, Vec3(2, 0, 0));
  EXPECT_EQ(s.materials[0].metallic, 0);
  EXPECT_EQ(s.materials[1].base_color, Vec3(0.5f));
  const Material& image = s.materials[2];
  ASSERT_EQ(image.base_color_texture, 0);
  ASSERT_EQ(s.textures.size(), 1u);
  EXPECT_EQ(s.textures[0].width, 2);
  EXPECT_EQ(s.textures[0].wrap_s, Wrap::clamp);
  EXPECT_EQ(s.textures[0].mime_type, "image/png");
  EXPECT_EQ(s.textures[0].rgb, (std::vector<uint8_t>{255, 0, 0, 0, 0, 255}));
  // In the file's space (0.1, 0.2) goes to (0.1 * 2 + 0.25, 0.2 * 3 + 0.5).
  constexpr float rounding = 1e-6f;
  Vec2 uv = s.texcoords[0].back();
  EXPECT_NEAR(image.uv_transform[0] * uv.x + image.uv_transform[2], 0.45f, rounding);
  EXPECT_NEAR(1 - (image.uv_transform[4] * uv.y + image.uv_transform[5]), 1.1f, rounding);
  EXPECT_EQ(image.uv_transform[1], 0);
  EXPECT_EQ(image.uv_transform[3], 0);

  folder.write("my lib.mtl", "newmtl a\nKd 1 x 1\n");
  auto malformed = load(text, folder.path.string());
  ASSERT_FALSE(malformed);
  EXPECT_NE(malformed.error().where.find("my lib.mtl:2"), std::string::npos);
  for (const char* name : {"/etc/passwd", "no.mtl"}) {
    std::string body = "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    Scene plain = must_load("mtllib " + std::string(name) + body, folder.path.string());
    EXPECT_EQ(plain.warnings.size(), 1u);
  }
}

// An uncompressed TGA of 24 or 32 bits, from the bottom row up as most are: blue, green, red (, alpha).
std::string tga(int width, int height, int bits, std::string_view pixels) {
  std::string header("\0\0\2\0\0\0\0\0\0\0\0\0", 12);
  for (int x : {width, height}) header += {char(x & 255), char(x >> 8)};
  header += {char(bits), char(bits == 32 ? 8 : 0)};
  return header + std::string(pixels);
}

TEST(LoadMtl, GlowsByItsMapTimesKe) {
  TemporaryFolder folder;
  folder.write("a.png", tiny_png());
  Scene s = with_material(folder, "Ke 8 4 2\nmap_Ke -s 2 1 1 a.png\nPr 0.25\nPm 0.75\n");
  const Material& m = s.materials[0];
  EXPECT_TRUE(s.warnings.empty());
  EXPECT_EQ(m.emissive, Vec3(8, 4, 2));
  ASSERT_EQ(m.emissive_texture, 0);
  EXPECT_EQ(m.base_color_texture, -1);
  EXPECT_EQ(m.emissive_transform[0], 2);
  EXPECT_EQ(m.roughness, 0.25f);
  EXPECT_EQ(m.metallic, 0.75f);
  // The left half of the picture, which is twice across, is red; v is clear of its edges' blending.
  EXPECT_LT(length(emission(s, s.triangles[0], 0.125f, 0.5f) - Vec3(8, 0, 0)), 1e-5f);
  // Exporters write 0 for what the map gives; a map that is lost does not light the whole surface.
  EXPECT_EQ(with_material(folder, "Ke 0 0 0\nmap_Ke a.png\n").materials[0].emissive, Vec3(1));
  EXPECT_EQ(with_material(folder, "map_Ke a.png\n").materials[0].emissive, Vec3(1));
  EXPECT_EQ(with_material(folder, "Ke 5 5 5\nmap_Ke gone.png\n").materials[0].emissive, Vec3(0));
}

TEST(LoadMtl, BlackKdBesideAMapMeansTheMap) {
  TemporaryFolder folder;
  folder.write("a.png", tiny_png());
  Scene s = with_material(folder, "Kd 0 0 0\nmap_Kd a.png\n");
  EXPECT_EQ(s.materials[0].base_color, Vec3(1));
  EXPECT_EQ(s.materials[0].base_color_texture, 0);
  EXPECT_EQ(with_material(folder, "Kd 0.5 1 1\nMAP_KD a.png\n").materials[0].base_color, Vec3(0.5f, 1, 1));
  EXPECT_EQ(with_material(folder, "Kd 0 0 0\n").materials[0].base_color, Vec3(0));
  EXPECT_EQ(with_material(folder, "Kd 0 0 0\nmap_Kd gone.png\n").materials[0].base_color, Vec3(0.8f));
}

TEST(LoadMtl, PicturesAreFoundByTheirLastSteps) {
  TemporaryFolder folder;
  folder.write("Brick.PNG", tiny_png());
  std::filesystem::create_directories(folder.path / "textures");
  std::filesystem::create_directories(folder.path / "scene/maps");
  folder.write("textures/tile.png", tiny_png());
  folder.write("scene/maps/tile.png", tiny_png());
  folder.write("secret.png", tiny_png());
  for (const char* name :
       {"Brick.PNG", "C:\\projects\\yard\\brick.png", "/home/me/Brick.png", "..\\Brick.PNG", "textures/tile.png",
        "D:/yard/Textures/TILE.png", "\\\\server\\share\\textures\\tile.png", "../../textures/./tile.png"}) {
    Scene s = with_material(folder, fmt::format("map_Kd {}\n", name));
    EXPECT_EQ(s.materials[0].base_color_texture, 0) << name;
    EXPECT_TRUE(s.warnings.empty()) << name;
  }
  // Never out of the scene's folder.
  folder.write("scene/t.mtl", "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd ../secret.png\n");
  std::filesystem::create_symlink(folder.path / "secret.png", folder.path / "scene/link.png");
  const std::string text = "mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
  for (const char* name : {"../secret.png", "link.png", "gone.png", "", "maps", "t.mtl", "/etc/passwd"}) {
    folder.write("scene/t.mtl", fmt::format("newmtl m\nKd 0.5 0.5 0.5\nmap_Kd {}\n", name));
    Scene s = must_load(text, (folder.path / "scene").string());
    EXPECT_EQ(s.materials[0].base_color_texture, -1) << name;
    EXPECT_EQ(s.materials[0].base_color, Vec3(0.5f)) << name;
    ASSERT_EQ(s.warnings.size(), 1u) << name;
    EXPECT_NE(s.warnings[0].find("t.mtl:3"), std::string::npos) << s.warnings[0];
  }
  // One warning, however many are lost.
  Scene s = with_material(folder, "map_Kd gone.png\nmap_Ke lost.png\n");
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_NE(s.warnings[0].find("(and 1 more)"), std::string::npos) << s.warnings[0];
}

TEST(LoadMtl, ReadsTgaBmpAndPnmAsPng) {
  TemporaryFolder folder;
  const std::string red_blue_bgr("\0\0\xff\xff\0\0", 6), red_blue_rgb("\xff\0\0\0\0\xff", 6);
  std::string runs = tga(2, 1, 24, "");
  runs[2] = 10;
  runs += std::string("\x80\0\0\xff\x80\xff\0\0", 8);
  std::string bmp("BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\2\0\0\0\1\0\0\0\1\0\x18\0", 30);
  bmp += std::string(24, '\0') + red_blue_bgr + std::string(2, '\0');
  for (auto [name, bytes] : {std::pair{"a.tga", tga(2, 1, 24, red_blue_bgr)},
                             {"b.tga", runs},
                             {"a.bmp", bmp},
                             {"a.ppm", "P6 2 1 255\n" + red_blue_rgb}}) {
    folder.write(name, bytes);
    Scene s = with_material(folder, fmt::format("map_Kd {}\n", name));
    ASSERT_EQ(s.textures.size(), 1u) << name;
    EXPECT_TRUE(s.warnings.empty()) << name;
    EXPECT_EQ(s.textures[0].rgb, (std::vector<uint8_t>{255, 0, 0, 0, 0, 255})) << name;
    EXPECT_EQ(s.textures[0].mime_type, "image/png");  // what a GLB may hold
    for (size_t length = 0; length < bytes.size(); ++length) {
      folder.write(name, std::string_view(bytes).substr(0, length));
      Scene cut = with_material(folder, fmt::format("map_Kd {}\n", name));
      EXPECT_EQ(cut.warnings.size() + cut.textures.size(), 1u);
    }
  }
  for (std::string_view other : {"GIF89a\1\0\1\0", "DDS ....", "not a picture"}) {
    folder.write("a.gif", other);
    EXPECT_EQ(with_material(folder, "map_Kd a.gif\n").warnings.size(), 1u);
  }
}

TEST(LoadMtl, DissolvesByNumberAndMap) {
  TemporaryFolder folder;
  folder.write("a.png", tiny_png());
  // Half there below, whole above; in the red channel or the alpha.
  folder.write("mask.tga", tga(1, 2, 24, std::string("\0\0\x80\0\0\xff", 6)));
  folder.write("both.tga", tga(1, 2, 32, std::string("\x10\x20\x30\x80\x10\x20\x30\xff", 8)));
  auto is_blended = [](const Material& m) { return m.alpha_mode == AlphaMode::blend; };
  for (auto [mtl, alpha] : {std::pair{"d 0.25\n", 0.25f},
                            {"Tr 0.75\n", 0.25f},
                            {"d -halo 0.25\n", 0.25f},
                            {"d 1\nTr 1\n", 1.0f},
                            {"Tr 1\n", 1.0f},
                            {"Tr 0\n", 1.0f},
                            {"", 1.0f}}) {
    const Material m = with_material(folder, mtl).materials[0];
    EXPECT_EQ(m.alpha, alpha) << mtl;
    EXPECT_EQ(is_blended(m), alpha < 1) << mtl;
  }
  for (const char* mtl :
       {"map_d mask.tga\n", "map_Kd both.tga\nmap_d mask.tga\n", "map_Kd both.tga\nmap_d both.tga\n"}) {
    Scene s = with_material(folder, mtl);
    EXPECT_TRUE(s.warnings.empty());
    ASSERT_EQ(s.materials[0].base_color_texture, 0) << mtl;
    EXPECT_TRUE(is_blended(s.materials[0]));
    EXPECT_NEAR(sample_alpha(s.textures[0], {0.5f, 0.75f}), 128 / 255.0f, 0.01f) << mtl;
  }
  // Colours' own alpha says nothing where no map_d asks for it.
  EXPECT_FALSE(is_blended(with_material(folder, "map_Kd both.tga\n").materials[0]));
}

TEST(LoadMtl, SaysWhatItDoesNotRead) {
  TemporaryFolder folder;
  Scene s = with_material(folder, "Ks 1 1 1\nNs 20\nillum 2\nmap_Bump bump.png\nmap_Bump b.png\ndisp d.png\n");
  ASSERT_EQ(s.warnings.size(), 1u);
  EXPECT_EQ(s.warnings[0], "t.obj: not read of its materials: disp, map_Bump");
}

TEST(LoadMtl, ColoursGiveWayToThePicture) {
  TemporaryFolder folder;
  folder.write("a.png", tiny_png());
  folder.write("t.mtl", "newmtl m\nmap_Kd a.png\nnewmtl n\n");
  const std::string text =
      "mtllib t.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 0 0 1 1 0 0\nusemtl m\nf 1 2 3\n";
  Scene pictured = must_load(text, folder.path.string()),
        both = must_load(text + "usemtl n\nf 1 3 4\n", folder.path.string());
  EXPECT_TRUE(pictured.colors.empty());
  EXPECT_EQ(pictured.warnings.size(), 1u);
  ASSERT_EQ(both.colors.size(), 6u);
  EXPECT_EQ(both.colors[0], Vec3(1));
  EXPECT_EQ(both.colors[5], Vec3(1, 0, 0));
}

}  // namespace
}  // namespace lambent

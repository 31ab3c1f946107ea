// Orientation against OpenEXR's own functions (ImfEnvmap.h) and against faces folded by hand; energies against closed
// forms; the same light as a plain lat-long map.
#include <lambent/core/random.h>
#include <lambent/basis/cubemap.h>
#include <lambent/image/image.h>
#include <lambent/light/environment.h>
#include <lambent/light/project.h>
#include <lambent/light/sphere_map.h>

#include <exr_maker.h>
#include <gtest/gtest.h>

#include <numbers>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;

// Where the light of a map comes from: the sum of its energies, and the direction of their sum.
struct Power {
  double energy;
  Vec3 direction;
};
Power power_of(const Image& map) {
  double energy = 0;
  Vec3d moment(0);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      energy += double(map.at(x, y).x) * texel_solid_angle(y, map.width, map.height);
      moment += double(map.at(x, y).x) * texel_moment(x, y, map.width, map.height);
    }
  return {energy, normalize(Vec3(moment))};
}

Image one_pixel(int width, int height, int x, int y) {
  Image image(width, height);
  image.at(x, y) = Vec3(1);
  return image;
}

TEST(SphereMap, ShapesAreTold) {
  const auto map = [](int w, int h, Envmap envmap = Envmap::unsaid) { return sphere_map_of(w, h, envmap, "a.exr"); };
  EXPECT_EQ(*map(64, 32), SphereMap::latlong);
  EXPECT_EQ(*map(333, 166), SphereMap::latlong);  // halved from 667: off by a pixel
  EXPECT_EQ(*map(64, 48), SphereMap::horizontal_cross);
  EXPECT_EQ(*map(48, 64), SphereMap::vertical_cross);
  EXPECT_EQ(*map(96, 16), SphereMap::row);
  EXPECT_EQ(*map(16, 96), SphereMap::column);
  EXPECT_EQ(*map(16, 96, Envmap::cube), SphereMap::exr_cube);
  EXPECT_EQ(*map(64, 32, Envmap::latlong), SphereMap::exr_latlong);
  for (auto [w, h] : {std::pair{64, 64}, {64, 20}, {1920, 1080}, {32, 64}, {80, 48}}) EXPECT_FALSE(map(w, h)) << w;
  EXPECT_EQ(
      map(64, 64).error().text(),
      "a.exr: a picture of 64 x 64 is no map of the whole sphere: 2:1 is a lat-long map, 4:3 and 3:4 are crosses and "
      "6:1 and 1:6 strips of cube maps; a part of a panorama needs black where it ends");
  EXPECT_EQ(map(64, 32, Envmap::cube).error().text(),
            "a.exr: is a cube map by its envmap attribute, whose faces stand in a column of 1:6, not 64 x 32");
  EXPECT_FALSE(map(16, 96, Envmap::latlong));
}

TEST(SphereMap, EveryPixelOfOpenExrsCubeIsWhereItSays) {
  constexpr int size = 5;
  const Imath::Box2i window({0, 0}, {size - 1, 6 * size - 1});
  for (int f = 0; f < 6; ++f)
    for (int j = 0; j < size; ++j)
      for (int i = 0; i < size; ++i) {
        const auto face = Imf::CubeMapFace(f);
        const Imath::V2f place(static_cast<float>(i), static_cast<float>(j));
        const Imath::V2f at = Imf::CubeMap::pixelPosition(face, window, place);
        Imath::V3f d = Imf::CubeMap::direction(face, window, place);
        // Theirs are centres out to the edges, which are ours of a face 4/5 as wide.
        const int axis = f / 2;
        d /= std::abs(d[axis]);
        for (int k = 0; k < 3; ++k)
          if (k != axis) d[k] *= float(size - 1) / size;
        const Image map = latlong_of(one_pixel(size, 6 * size, int(at.x), int(at.y)), SphereMap::exr_cube);
        const Power power = power_of(map);
        const Vec3 expected = normalize(Vec3(d.x, d.y, d.z));
        EXPECT_GT(dot(power.direction, expected), std::cos(radians(2.0f))) << f << " " << i << " " << j;
        EXPECT_NEAR(power.energy / cube_solid_angle(size, i, j), 1, 2e-3);  // alike under turns of a face
      }
}

TEST(SphereMap, EveryPixelOfOpenExrsLatLongIsWhereItSays) {
  for (auto [w, h] : {std::pair{16, 8}, {18, 9}}) {
    const Imath::Box2i window({0, 0}, {w - 1, h - 1});
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        // Theirs are centres out to the poles and the seam; so (x + 1/2) (w - 1) / w of them is the centre of our area.
        const Imath::V2f place((float(x) + 0.5f) / float(w) * float(w - 1),
                               (float(y) + 0.5f) / float(h) * float(h - 1));
        const Imath::V3f d = Imf::LatLongMap::direction(window, place);
        const Power power = power_of(latlong_of(one_pixel(w, h, x, y), SphereMap::exr_latlong));
        // The mean direction of a texel lies a little towards the equator from its centre.
        EXPECT_GT(dot(power.direction, Vec3(d.x, d.y, d.z)), std::cos(radians(4.0f))) << w << " " << x << " " << y;
        EXPECT_NEAR(power.energy, texel_solid_angle(y, w, h), 1e-6);
      }
  }
}

// Ahead -Z, right +X, up +Y: the middles of the faces in each layout, and of the edges they share with the one ahead.
TEST(SphereMap, CrossesAndStripsFoldUp) {
  struct Face {
    SphereMap map;
    int columns, rows;
    std::array<std::pair<int, int>, 6> cells;  // right, left, up, down, ahead, behind
  };
  const Face layouts[] = {{SphereMap::horizontal_cross, 4, 3, {{{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {3, 1}}}},
                          {SphereMap::vertical_cross, 3, 4, {{{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {1, 3}}}},
                          {SphereMap::row, 6, 1, {{{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {5, 0}}}},
                          {SphereMap::column, 1, 6, {{{0, 0}, {0, 1}, {0, 2}, {0, 3}, {0, 4}, {0, 5}}}}};
  const Vec3 axes[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, -1}, {0, 0, 1}};
  constexpr int size = 9, middle = 4, end = 8;
  constexpr float coordinate = 8 / 9.0f;  // of the outermost pixels' centres
  const auto seen = [&](const Face& l, int face, int x, int y) {
    const auto [cx, cy] = l.cells[size_t(face)];
    return power_of(latlong_of(one_pixel(l.columns * size, l.rows * size, cx * size + x, cy * size + y), l.map));
  };
  const float near = std::cos(radians(1.5f));
  for (const Face& l : layouts) {
    for (int f = 0; f < 6; ++f) {
      const Power power = seen(l, f, middle, middle);
      EXPECT_GT(dot(power.direction, axes[f]), near) << int(l.map) << " " << f;
      EXPECT_NEAR(power.energy / cube_solid_angle(size, middle, middle), 1, 2e-3);
    }
    // Ahead: to its right is the right.
    EXPECT_GT(dot(seen(l, 4, end, middle).direction, normalize(Vec3(coordinate, 0, -1))), near);
    // The right face's left edge meets it, and its top the upper face.
    EXPECT_GT(dot(seen(l, 0, 0, middle).direction, normalize(Vec3(1, 0, -coordinate))), near);
    EXPECT_GT(dot(seen(l, 0, middle, 0).direction, normalize(Vec3(1, coordinate, 0))), near);
    EXPECT_GT(dot(seen(l, 1, end, middle).direction, normalize(Vec3(-1, 0, -coordinate))), near);
    // The upper face's lower edge and the lower one's upper edge meet it.
    EXPECT_GT(dot(seen(l, 2, middle, end).direction, normalize(Vec3(0, 1, -coordinate))), near);
    EXPECT_GT(dot(seen(l, 3, middle, 0).direction, normalize(Vec3(0, -1, -coordinate))), near);
    EXPECT_GT(dot(seen(l, 3, end, middle).direction, normalize(Vec3(coordinate, -1, 0))), near);
    // Behind: upright it hangs to the right of the right face; on its head, below the lower one.
    const bool on_its_head = l.map == SphereMap::vertical_cross;
    const Vec3 first = on_its_head ? Vec3(0, -coordinate, 1) : Vec3(coordinate, 0, 1);
    EXPECT_GT(dot((on_its_head ? seen(l, 5, middle, 0) : seen(l, 5, 0, middle)).direction, normalize(first)), near);
  }
}

// A function of direction on a picture of each kind, by its pixels' directions.
TEST(SphereMap, TheSameLightInEveryForm) {
  const auto light = [](Vec3 d) { return Vec3(1 + d.x, 1 + 0.5f * d.y - d.z * d.y, 2 + d.z * d.z); };
  constexpr int size = 32;
  const auto direction = [](int face, int x, int y) {  // of OpenGL's faces, in our frame
    const Vec3 p = cube_point(face, (2 * float(x) + 1) / size - 1, (2 * float(y) + 1) / size - 1);
    return normalize(Vec3(p.x, p.y, -p.z));
  };
  Image cross(4 * size, 3 * size), tall(3 * size, 4 * size), row(6 * size, size), column(size, 6 * size);
  const std::pair<int, int> cells[] = {{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {3, 1}};
  for (int f = 0; f < 6; ++f)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        const Vec3 value = light(direction(f, x, y));
        cross.at(cells[f].first * size + x, cells[f].second * size + y) = value;
        if (f < 5) tall.at(cells[f].first * size + x, cells[f].second * size + y) = value;
        else tall.at(2 * size - 1 - x, 4 * size - 1 - y) = value;
        row.at(f * size + x, y) = value, column.at(x, f * size + y) = value;
      }
  const auto plain = project_environment(make_environment("plain", 512, 256, light), 4);
  const std::pair<SphereMap, Image*> forms[] = {{SphereMap::horizontal_cross, &cross},
                                                {SphereMap::vertical_cross, &tall},
                                                {SphereMap::row, &row},
                                                {SphereMap::column, &column}};
  for (const auto& [map, image] : forms) {
    Environment env;
    env.image = latlong_of(*image, map);
    const auto found = project_environment(env, 4);
    constexpr float texels = 4e-3f;  // of 32 a side
    for (size_t i = 0; i < plain.size(); ++i)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[i][k], plain[i][k], texels) << int(map) << " " << i;
  }
}

TEST(SphereMap, EnergiesAreKept) {
  for (int size : {1, 2, 3, 16, 40}) {
    Image even(6 * size, size);
    std::fill(even.rgb.begin(), even.rgb.end(), Vec3(0.5f, 1, 2));
    constexpr float rounding = 1e-6f;
    for (const Vec3& c : latlong_of(even, SphereMap::row).rgb)
      for (int k = 0; k < 3; ++k) ASSERT_NEAR(c[k] / even.rgb[0][k], 1, rounding) << size;
    Random random(uint64_t(size) + 5);
    Image uneven = even;
    double expected = 0;
    for (int f = 0; f < 6; ++f)
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) {
          uneven.at(f * size + x, y) = Vec3(random.next() < 0.1f ? 100.0f : 0.1f);
          expected += double(uneven.at(f * size + x, y).x) * cube_solid_angle(size, x, y);
        }
    EXPECT_NEAR(power_of(latlong_of(uneven, SphereMap::row)).energy / expected, 1, 1e-3) << size;
  }
}

}  // namespace
}  // namespace lambent

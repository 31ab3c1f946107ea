// Normal textures on directional lightmaps: against the bumps' own formula, and against the path tracer.
#include <lambent/bake/lightmap.h>
#include <lambent/receivers/atlas.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/reflection.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A tilted quad of 2 x 1.5 with bumps h = height sin(2 pi k s) sin(2 pi k t) on it, s along a, t along b, both from 0
// to 1.
struct Bumps {
  Vec3 origin{0.3f, -0.2f, 0.1f}, a, b;
  float height = 0.1f, k = 2;
  Bumps() {
    const Mat3 turn = rotation_from_yaw_pitch_roll({30, 20, -15});
    a = turn * Vec3(2, 0, 0), b = turn * Vec3(0, 1.5f, 0);
  }
  Vec3 n() const { return normalize(cross(a, b)); }
  // In the frame (a, b, n) / lengths: (-dh/ds / |a|, -dh/dt / |b|, 1).
  Vec3 local(float s, float t) const {
    const float w = 2 * pi * k;
    return normalize(Vec3(-height * w * std::cos(w * s) * std::sin(w * t) / length(a),
                          -height * w * std::sin(w * s) * std::cos(w * t) / length(b), 1));
  }
  Vec3 normal(float s, float t) const {
    const Vec3 l = local(s, t);
    return l.x * normalize(a) + l.y * normalize(b) + l.z * n();
  }
  // Places (s, t) of a point of the plane.
  Vec2 place(Vec3 p) const { return {dot(p - origin, a) / dot(a, a), dot(p - origin, b) / dot(b, b)}; }
};

// The quad, its normal texture and coordinates: the picture upright, or mirrored in u; with or without tangents.
Scene bumpy(const Bumps& bumps, bool mirrored = false, bool tangents = false) {
  Scene scene = make_quad(bumps.origin, bumps.a, bumps.b, 3, 3, Vec3(0.5f));
  constexpr int size = 128;
  Texture texture;
  texture.width = texture.height = size;
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      const float u = (float(i) + 0.5f) / size, v = (float(j) + 0.5f) / size;
      Vec3 n = bumps.local(mirrored ? 1 - u : u, 1 - v);
      if (mirrored) n.x = -n.x;  // its x is along +u, which runs against a
      for (int c = 0; c < 3; ++c) texture.rgb.push_back(uint8_t(std::lround((n[c] + 1) / 2 * 255)));
    }
  scene.textures.push_back(texture);
  scene.materials[0].normal_texture = 0;
  for (Vec3 p : scene.positions) {
    const Vec2 at = bumps.place(p);
    scene.texcoords[0].push_back({mirrored ? 1 - at.x : at.x, 1 - at.y});
    if (tangents) scene.tangents.push_back(Vec4(normalize(mirrored ? -bumps.a : bumps.a), mirrored ? -1 : 1));
  }
  return scene;
}

Camera facing(const Bumps& bumps) {
  const Vec3 middle = bumps.origin + 0.5f * (bumps.a + bumps.b);
  return {middle + 3.5f * bumps.n() + 0.4f * bumps.a, middle, bumps.b, 35};
}

Image draw(Scene scene, const Environment* sky, DirectionalKind kind, int samples = 16) {
  auto atlas = make_atlas(scene, {.texels_per_unit = 12});
  EXPECT_TRUE(atlas);
  const Receivers receivers = make_texel_receivers(scene, *atlas);
  auto tracer = Tracer::build(scene);
  auto map = bake_lightmap(
      scene, *tracer, receivers, make_lamps(scene, sky, false),
      {.samples = 2048, .lamp_samples = 256, .bounces = 0, .directional = kind, .precision = Precision::single}, false);
  EXPECT_TRUE(map) << (map ? "" : map.error().text());
  Relit relit;
  relight(map->all, std::vector<Vec3>(map->all.columns(), Vec3(1)), relit);
  auto image = render(scene, *tracer, receivers.basis, relit, facing(Bumps()),
                      {.width = 96, .height = 72, .samples = samples, .directional = kind});
  EXPECT_TRUE(image);
  return *image;
}

// RMS difference over the covered pixels, relative to the second picture's mean.
double difference(const Image& x, const Image& y) {
  double square = 0, mean = 0;
  size_t count = 0;
  for (size_t i = 0; i < x.rgb.size(); ++i) {
    if (y.alpha[i] < 1) continue;
    square += double(dot(x.rgb[i] - y.rgb[i], x.rgb[i] - y.rgb[i])) / 3,
        mean += double(y.rgb[i].x + y.rgb[i].y + y.rgb[i].z) / 3;
    ++count;
  }
  EXPECT_GT(count, x.rgb.size() / 4);
  return std::sqrt(square / double(count)) / (mean / double(count));
}

// The bumps seen by that camera, by a formula for the light that leaves where the normal is n.
template <class F>
Image picture(const Bumps& bumps, F leaving) {
  Image image(96, 72);
  image.alpha.assign(image.rgb.size(), 0);
  const CameraRays rays(facing(bumps), 96, 72);
  constexpr int grid = 4;
  for (int y = 0; y < 72; ++y)
    for (int x = 0; x < 96; ++x) {
      int covered = 0;
      for (int k = 0; k < grid * grid; ++k) {
        const Vec3 d =
            rays.direction(float(x) + (float(k % grid) + 0.5f) / grid, float(y) + (float(k / grid) + 0.5f) / grid);
        const Vec3 p = rays.eye + d * (dot(bumps.origin - rays.eye, bumps.n()) / dot(d, bumps.n()));
        const Vec2 at = bumps.place(p);
        if (at.x < 0 || at.x > 1 || at.y < 0 || at.y > 1) continue;
        ++covered;
        image.at(x, y) += leaving(bumps.normal(at.x, at.y)) / float(grid * grid);
      }
      image.alpha[size_t(y) * 96 + size_t(x)] = float(covered) / (grid * grid);
    }
  return image;
}

TEST(NormalMap, NormalsAreThoseOfTheBumps) {
  const Bumps bumps;
  constexpr float eight_bits = 0.012f;  // half a step in each of three channels, and between texels
  for (bool mirrored : {false, true})
    for (bool tangents : {false, true}) {
      const Scene scene = bumpy(bumps, mirrored, tangents);
      float worst = 0;
      for (const Triangle& t : scene.triangles)
        for (Vec2 uv : {Vec2(0.2f, 0.3f), Vec2(0.6f, 0.1f), Vec2(0.05f, 0.8f)}) {
          const Vec2 at = bumps.place(interpolate(scene.positions, t, uv.x, uv.y));
          worst = std::max(worst, length(mapped_normal(scene, t, uv.x, uv.y, bumps.n()) - bumps.normal(at.x, at.y)));
        }
      EXPECT_LT(worst, eight_bits) << mirrored << tangents;
    }
  // The scale: half of the slope, as a fraction of x and y before they are made unit again.
  Scene scene = bumpy(bumps);
  scene.materials[0].normal_scale = 0.5f;
  const Triangle& t = scene.triangles[4];
  const Vec2 at = bumps.place(interpolate(scene.positions, t, 0.2f, 0.3f));
  const Vec3 l = bumps.local(at.x, at.y) * Vec3(0.5f, 0.5f, 1),
             world = normalize(l.x * normalize(bumps.a) + l.y * normalize(bumps.b) + l.z * bumps.n());
  EXPECT_LT(length(mapped_normal(scene, t, 0.2f, 0.3f, bumps.n()) - world), eight_bits);
  // No texture, no coordinates, coordinates that do not vary: the surface's own.
  for (Vec2& uv : scene.texcoords[0]) uv = Vec2(0.5f);
  EXPECT_EQ(mapped_normal(scene, t, 0.2f, 0.3f, bumps.n()), bumps.n());
  scene.texcoords[0].clear();
  EXPECT_EQ(mapped_normal(scene, t, 0.2f, 0.3f, bumps.n()), bumps.n());
}

TEST(NormalMap, ALampOnBumpsIsItsFormula) {
  SKIP_UNDER_SANITIZERS();
  const Bumps bumps;
  Scene scene = bumpy(bumps);
  const Vec3 I(3, 2, 1), to_sun = normalize(bumps.n() + 0.5f * normalize(bumps.a) - 0.3f * normalize(bumps.b));
  scene.lights.push_back(
      {.name = "sun", .kind = PunctualLight::Kind::directional, .direction = -to_sun, .intensity = I});
  const Vec3 lit = 0.5f * I / pi;
  const Image formula = picture(bumps, [&](Vec3 n) { return lit * std::max(0.0f, dot(n, to_sun)); });
  const Image flat = picture(bumps, [&](Vec3) { return lit * dot(bumps.n(), to_sun); });
  EXPECT_GT(difference(flat, formula), 0.2);  // the bumps show
  for (bool mirrored : {false, true}) {
    Scene drawn = bumpy(bumps, mirrored);
    drawn.lights = scene.lights;
    EXPECT_LT(difference(draw(drawn, nullptr, DirectionalKind::vector), formula), 0.012) << mirrored;
    auto traced = path_trace(drawn, make_environment("black", 4, 2, [](Vec3) { return Vec3(0); }), facing(bumps),
                             {.width = 96, .height = 72, .spp = 16, .bounces = 0, .background = false, .lamps = true});
    ASSERT_TRUE(traced);
    EXPECT_LT(difference(traced->image, formula), 0.012) << mirrored;
  }
  // The other ways store one lamp as well as they can (see DirectionalLightmap); what the flat normal misses is more.
  EXPECT_LT(difference(draw(scene, nullptr, DirectionalKind::sh3), formula), 0.1);
}

TEST(NormalMap, UnderASkyAsThePathTracerHasIt) {
  SKIP_UNDER_SANITIZERS();
  const Bumps bumps;
  Scene scene = bumpy(bumps);
  scene.materials[0].base_color = Vec3(0.8f, 0.5f, 0.3f);
  const Vec3 bright = normalize(bumps.n() + 0.7f * normalize(bumps.a));
  const Environment sky = make_environment("lobe", 64, 32, [&](Vec3 d) {
    return Vec3(0.2f, 0.3f, 0.5f) + std::exp(8 * (dot(d, bright) - 1)) * Vec3(4, 3, 2);
  });
  auto traced =
      path_trace(scene, sky, facing(bumps), {.width = 96, .height = 72, .spp = 256, .bounces = 0, .background = false});
  ASSERT_TRUE(traced);
  ReferenceOptions smooth{.width = 96, .height = 72, .spp = 256, .bounces = 0, .background = false};
  smooth.reflection.normal_maps = false;
  auto flat = path_trace(scene, sky, facing(bumps), smooth);
  ASSERT_TRUE(flat);
  const double bump = difference(flat->image, traced->image);
  EXPECT_GT(bump, 0.12);
  const double left = difference(draw(scene, &sky, DirectionalKind::sh3), traced->image);
  EXPECT_LT(left, 0.15 * bump);
  RecordProperty("sh:3", std::to_string(left)), RecordProperty("none", std::to_string(bump));

  // What the cheaper ones make of this sky, by sums over its directions: mean + n . first moment / 2 pi for two bands
  // of irradiance / pi, the blend of three irradiances, and n . V.
  constexpr int many = 20000;
  double mean[3] = {}, moment[3][3] = {}, three[3][3] = {};
  const Mat3 frame = frame_about(bumps.n());
  for (int i = 0; i < many; ++i) {
    const float z = (float(i) + 0.5f) / many, r = std::sqrt(1 - z * z), phi = 2.39996323f * float(i);
    const Vec3 d = frame * Vec3(r * std::cos(phi), r * std::sin(phi), z), light = radiance(sky, d);
    for (int c = 0; c < 3; ++c) {
      mean[c] += double(light[c]) / many * 2 * pi;
      for (int k = 0; k < 3; ++k) {
        moment[c][k] += double(light[c] * d[k]) / many * 2 * pi;
        three[c][k] += double(light[c] * std::max(0.0f, dot(d, frame * hl2_basis[k]))) / many * 2 * pi;
      }
    }
  }
  const Vec3 albedo = scene.materials[0].base_color;
  auto by_formula = [&](DirectionalKind kind) {
    return picture(bumps, [&](Vec3 n) {
      Vec3 sum(0);
      float weights[3], total = 0;
      for (int k = 0; k < 3; ++k) {
        const float cosine = std::max(0.0f, dot(n, frame * hl2_basis[k]));
        total += weights[k] = cosine * cosine;
      }
      for (int c = 0; c < 3; ++c) {
        const double along = double(n.x) * moment[c][0] + double(n.y) * moment[c][1] + double(n.z) * moment[c][2];
        if (kind == DirectionalKind::sh2) sum[c] = float(mean[c] / (4 * pi) + along / (2 * pi));
        if (kind == DirectionalKind::vector) sum[c] = float(std::max(0.0, along) / pi);
        if (kind == DirectionalKind::hl2)
          for (int k = 0; k < 3; ++k) sum[c] += weights[k] / total * float(three[c][k] / pi);
      }
      return albedo * sum;
    });
  };
  for (DirectionalKind kind : {DirectionalKind::sh2, DirectionalKind::hl2, DirectionalKind::vector}) {
    const Image formula = by_formula(kind);
    EXPECT_LT(difference(draw(scene, &sky, kind), formula), 0.012) << int(kind);
    RecordProperty(directional_name(kind), std::to_string(difference(formula, traced->image)));
  }
}

TEST(NormalMap, BacksHaveTheNegatedNormal) {
  // A sun behind a two-sided quad: the path tracer and the lightmap agree about what is seen from there.
  const Bumps bumps;
  Scene scene = bumpy(bumps);
  for (Triangle& t : scene.triangles) t.two_sided = true;
  const Vec3 to_sun = normalize(-bumps.n() + 0.5f * normalize(bumps.a));
  scene.lights.push_back(
      {.name = "sun", .kind = PunctualLight::Kind::directional, .direction = -to_sun, .intensity = Vec3(2)});
  Camera camera = facing(bumps);
  camera.eye = 2.0f * camera.target - camera.eye;
  auto traced = path_trace(scene, make_environment("black", 4, 2, [](Vec3) { return Vec3(0); }), camera,
                           {.width = 96, .height = 72, .spp = 64, .bounces = 0, .background = false, .lamps = true});
  ASSERT_TRUE(traced);
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  auto map = bake_lightmap(
      scene, *tracer, receivers, make_lamps(scene, nullptr, false),
      {.samples = 64, .bounces = 0, .directional = DirectionalKind::vector, .precision = Precision::single}, false);
  ASSERT_TRUE(map);
  Relit relit;
  relight(map->all, std::vector<Vec3>{Vec3(1)}, relit);
  auto image = render(scene, *tracer, receivers.basis, relit, camera,
                      {.width = 96, .height = 72, .samples = 64, .directional = DirectionalKind::vector});
  ASSERT_TRUE(image);
  EXPECT_LT(difference(*image, traced->image), 0.01);
}

TEST(Show, RadiosityTimesAlbedoIsTheProduct) {
  Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2, Vec3(0.8f, 0.4f, 0.2f));
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  Relit relit;
  relit.rows = 1;
  relit.values.assign((receivers.count() + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  for (size_t r = 0; r < receivers.count(); ++r) relit.set(r, 0, float(r + 1) * Vec3(0.25f, 0.5f, 0.75f));
  auto shown = [&](RenderOptions::Show show) {
    auto image = render(scene, *tracer, receivers.basis, relit, camera_around(bounds(scene)),
                        {.width = 24, .height = 24, .samples = 1, .show = show});
    EXPECT_TRUE(image);
    return *image;
  };
  const Image product = shown(RenderOptions::Show::product), light = shown(RenderOptions::Show::radiosity),
              colour = shown(RenderOptions::Show::albedo);
  double sum = 0;
  for (size_t i = 0; i < product.rgb.size(); ++i) {
    for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(product.rgb[i][c], light.rgb[i][c] * colour.rgb[i][c]);
    if (colour.alpha[i] > 0) {
      EXPECT_EQ(colour.rgb[i], Vec3(0.8f, 0.4f, 0.2f));
    }
    sum += double(product.rgb[i].x);
  }
  EXPECT_GT(sum, 0);
}

}  // namespace
}  // namespace lambent

#include <lambent/basis/sh.h>
#include <lambent/bake/lightmap.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

constexpr DirectionalKind kinds[] = {DirectionalKind::sh2, DirectionalKind::sh3, DirectionalKind::hl2,
                                     DirectionalKind::vector};

// A tilted plane: no axis is the world's.
Scene plane() { return make_quad(Vec3(0), Vec3(1, 0.3f, 0), Vec3(0.2f, -0.4f, 1), 2, 2, Vec3(0.5f)); }

struct Baked {
  Receivers receivers;
  Lightmap map;
  std::vector<Vec3> rows(size_t receiver) const {
    Relit lit;
    relight(map.all, std::vector<Vec3>(map.all.columns(), Vec3(1)), lit);
    std::vector<Vec3> out;
    for (int row = 0; row < map.all.rows; ++row) out.push_back(lit.at(receiver, row));
    return out;
  }
};

Baked bake_rows(const Scene& scene, const Environment* sky, DirectionalKind kind,
                LightmapOptions options = {.samples = 4096, .bounces = 0}) {
  Baked b{make_vertex_receivers(scene), {}};
  options.directional = kind, options.precision = Precision::single;
  auto tracer = Tracer::build(scene);
  auto map = bake_lightmap(scene, *tracer, b.receivers, make_lamps(scene, sky, true), options, false);
  EXPECT_TRUE(map) << (map ? "" : map.error().text());
  if (map) b.map = std::move(*map);
  return b;
}

TEST(DirectionalLightmap, OfASunAreTheClosedForms) {
  Scene scene = plane();
  const Vec3 s = normalize(Vec3(0.3f, -0.8f, 0.4f)) * -1.0f, I(3, 2, 1);  // to the sun: above the plane's front?
  const Vec3 normal = scene.normals[0], to_sun = dot(s, normal) > 0 ? s : -s;
  scene.lights.push_back(
      {.name = "sun", .kind = PunctualLight::Kind::directional, .direction = -to_sun, .intensity = I});
  const Vec3 n = normalize(normal + 0.5f * receiver_frame(normal)[0] - 0.2f * receiver_frame(normal)[1]);
  for (DirectionalKind kind : kinds) {
    const Baked b = bake_rows(scene, nullptr, kind);
    ASSERT_EQ(b.map.all.rows, directional_rows(kind));
    const std::vector<Vec3> rows = b.rows(0);
    const Mat3 frame = receiver_frame(normal);
    float y[9];
    evaluate_sh(3, to_sun, y);
    for (int k = 0; k < directional_rows(kind); ++k) {
      float expected = 0;
      if (kind == DirectionalKind::hl2) expected = std::max(0.0f, dot(to_sun, frame * hl2_basis[k])) / pi;
      else if (kind == DirectionalKind::vector) expected = to_sun[k] / pi;
      else expected = float(clamped_cosine(sh_band(k))) * y[k] / pi;
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(rows[size_t(k)][c], I[c] * expected, 1e-4f) << int(kind) << " row " << k;
    }
    // One lamp is what the vector stands for: exact for any normal.
    if (kind == DirectionalKind::vector) {
      EXPECT_NEAR(evaluate_directional_light(kind, rows, frame, n).x, I.x * std::max(0.0f, dot(n, to_sun)) / pi, 1e-4f);
    }
  }
}

TEST(DirectionalLightmap, OfAUniformSkyAboveAPlane) {
  // Light from the half-space above the plane alone: a normal at the angle t receives (1 + cos t) / 2 of it. The plane
  // is black.
  Scene scene = plane();
  scene.materials[0].base_color = Vec3(0);
  const Environment sky = make_environment("uniform", 8, 4, [](Vec3) { return Vec3(1, 2, 4); });
  const Vec3 normal = scene.normals[0];
  const Mat3 frame = receiver_frame(normal);
  for (DirectionalKind kind : kinds) {
    const Baked b = bake_rows(scene, &sky, kind);
    // A receiver in the middle of the plane.
    size_t r = 0;
    for (size_t i = 0; i < b.receivers.count(); ++i)
      if (length(b.receivers.origins[i] - Vec3(0.6f, -0.05f, 0.5f)) <
          length(b.receivers.origins[r] - Vec3(0.6f, -0.05f, 0.5f)))
        r = i;
    const std::vector<Vec3> rows = b.rows(r);
    if (kind == DirectionalKind::hl2) {
      // Exact for its own directions, whose cosine to the normal is 1 / sqrt(3): within the clamp at grazing angles.
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(rows[size_t(k)].y, 2 * (1 + 1 / std::sqrt(3.0f)) / 2, 0.02f);
    }
    for (float t : {0.0f, 0.3f, 0.6f}) {
      const Vec3 n = std::cos(t) * normal + std::sin(t) * normalize(frame[0] + 0.7f * frame[1]);
      const float expected = (1 + std::cos(t)) / 2;
      // Order 3 holds the half-space's irradiance to 1%, order 2 and the vector to 6%, Half-Life 2's blend of three
      // values of (1 + cos 55) / 2 is all alike: 0.79.
      const float tolerance = kind == DirectionalKind::sh3    ? 0.02f
                            : kind == DirectionalKind::hl2    ? 0.23f
                            : kind == DirectionalKind::vector ? 0.16f
                                                              : 0.08f;
      EXPECT_NEAR(evaluate_directional_light(kind, rows, frame, n).y / 2, expected, tolerance)
          << int(kind) << " at " << t;
    }
  }
}

TEST(DirectionalLightmap, ItsOwnNormalGivesTheLightmap) {
  // With bounces and lamps of all kinds, E(receiver's normal) by the vector is E itself, ray by ray.
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.2f, 0.1f)),
                 lamp = add_material(scene, "lamp", Vec3(0.3f));
  scene.materials[lamp].emissive = Vec3(6, 5, 3);
  add_quad(scene, red, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 6, 6);
  add_quad(scene, red, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 1.5f, 0), 6, 6);
  add_quad(scene, lamp, "lamp", Vec3(-0.6f, 1.4f, 0.1f), Vec3(0.4f, 0.1f, 0), Vec3(0, 0.05f, 0.3f), 1, 1);
  const Environment sky =
      make_environment("skew", 16, 8, [](Vec3 d) { return Vec3(0.2f) + std::max(0.0f, d.x) * Vec3(1, 0.5f, 2); });
  const Baked plain = bake_rows(scene, &sky, DirectionalKind::none, {.samples = 1024, .bounces = 2});
  const Baked vector = bake_rows(scene, &sky, DirectionalKind::vector, {.samples = 1024, .bounces = 2});
  for (size_t r = 0; r < plain.receivers.count(); r += 5) {
    const Vec3 n = plain.receivers.normals[r], e = plain.rows(r)[0],
               v = evaluate_directional_light(DirectionalKind::vector, vector.rows(r), receiver_frame(n), n);
    // Rays below cosine 0.02, 0.04% of all, count for less; halves in the operator round.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(v[c], e[c], 2e-3f * (1 + e[c])) << r;
  }
}

}  // namespace
}  // namespace lambent

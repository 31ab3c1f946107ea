// Light through surfaces that let it pass, in every kind of bake, the reference and pictures, against closed forms: a
// room behind glass of transmission t and colour c is t c times the room behind an open window.
#include <lambent/bake/bake.h>
#include <lambent/bake/lattice.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/visibility.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>

#include "reference_checks.h"
#include "sanitizers.h"

#include <gtest/gtest.h>

#include <numeric>

namespace lambent {
namespace {

constexpr Vec3 tint(0.75f, 0.5f, 0.25f);

// Four by three by four metres, lit through a window of the wall x = 4 alone.
Scene room(int n = 2) {
  Scene s;
  const uint32_t red = add_material(s, "red", Vec3(0.7f, 0.4f, 0.3f)), grey = add_material(s, "grey", Vec3(0.6f));
  add_quad(s, red, "floor", Vec3(0), Vec3(0, 0, 4), Vec3(4, 0, 0), 2 * n, 2 * n);
  add_quad(s, grey, "ceiling", Vec3(0, 3, 0), Vec3(4, 0, 0), Vec3(0, 0, 4), n, n);
  add_quad(s, grey, "z0", Vec3(0), Vec3(4, 0, 0), Vec3(0, 3, 0), n, n);
  add_quad(s, grey, "z4", Vec3(0, 0, 4), Vec3(0, 3, 0), Vec3(4, 0, 0), n, n);
  add_quad(s, red, "x0", Vec3(0), Vec3(0, 3, 0), Vec3(0, 0, 4), n, n);
  auto strip = [&](float y0, float y1, float z0, float z1) {
    add_quad(s, grey, "x4", Vec3(4, y0, z0), Vec3(0, 0, z1 - z0), Vec3(0, y1 - y0, 0), n / 2, n / 2);
  };
  strip(0, 1, 0, 4), strip(2.25f, 3, 0, 4), strip(1, 2.25f, 0, 1), strip(1, 2.25f, 3, 4);
  return s;
}

// A box of glass about the room, `distance` from it: all light comes through it once.
void glaze(Scene& s, const Material& glass, float distance = 0.02f) {
  const uint32_t material = add_material(s, "glass", glass.base_color);
  s.materials[material] = glass, s.materials[material].name = "glass", s.materials[material].metallic = 0;
  add_box(s, material, "glass", Vec3(-distance), Vec3(4, 3, 4) + distance, 1);
  for (Triangle& t : s.triangles)
    if (s.parts[t.part].material == material) t.two_sided = true;
}
Material stained() {  // passes tint and reflects nothing
  Material m;
  m.base_color = tint, m.transmission = 1;
  return m;
}
Material smoked(float alpha) {  // black, and there by a share
  Material m;
  m.base_color = Vec3(0), m.alpha_mode = AlphaMode::blend, m.alpha = alpha;
  return m;
}

struct World {
  Scene scene;
  Receivers receivers;
  Tracer tracer = *Tracer::build(scene);
  explicit World(Scene s) : scene(std::move(s)), receivers(make_vertex_receivers(scene)) {}
  World(Scene s, Receivers r) : scene(std::move(s)), receivers(std::move(r)) {}
  World(const World&) = delete;
};
Scene with(const Material& glass) {
  Scene s = room();
  glaze(s, glass);
  return s;
}
// The same without the glass: its triangles have no area, so that receivers and rays are the same.
World opened(const World& glazed) {
  Scene s = glazed.scene;
  for (Triangle& t : s.triangles)
    if (s.materials[s.parts[t.part].material].name == "glass") t.v[1] = t.v[2] = t.v[0];
  return {std::move(s), glazed.receivers};
}
std::vector<size_t> inside(const World& w) {
  std::vector<size_t> out;
  for (size_t r = 0; r < w.receivers.count(); ++r) {
    const Vec3 p = w.receivers.origins[r];
    const Vec3 margin = min(p, Vec3(4, 3, 4) - p);
    if (std::min({margin.x, margin.y, margin.z}) > 0) out.push_back(r);
  }
  return out;
}

// These receivers' rows of b are c times those of a.
void expect_tinted(const Transfer& a, const Transfer& b, const std::vector<size_t>& receivers, Vec3 c,
                   float tolerance = 2e-4f) {
  ASSERT_EQ(a.rows, b.rows);
  double light = 0;
  for (size_t r : receivers) {
    const std::vector<float> open = load_receiver(a, r), glazed = load_receiver(b, r);
    float most = 0;
    for (float v : open) most = std::max(most, std::abs(v));
    light += double(most);
    for (int row = 0; row < a.rows; ++row)
      for (int ch = 0; ch < 3; ++ch)
        for (size_t k = 0; k < a.columns(); ++k) {
          auto at = [&](const Transfer& t, const std::vector<float>& v) {
            return v[(size_t(row) * size_t(t.channels) + size_t(std::min(ch, t.channels - 1))) * t.columns() + k];
          };
          ASSERT_NEAR(at(b, glazed), c[ch] * at(a, open), tolerance * most + 1e-6f)
              << "receiver " << r << " row " << row << " channel " << ch << " column " << k;
        }
  }
  EXPECT_GT(light, 0.1);
}

TEST(Glass, DimsAndColoursRays) {
  Scene s = room();
  for (int k = 1; k <= 3; ++k) glaze(s, smoked(0.5f), 0.02f * float(k));
  glaze(s, stained(), 0.1f);
  const World w(std::move(s));
  EXPECT_TRUE(w.tracer.lets_pass());
  EXPECT_TRUE(w.tracer.colours());
  const Vec3 eye(2, 1.5f, 2), out(1, 0, 0);
  const float x[] = {1, 1, 0}, y[] = {0, 0.05f, 1}, z[] = {0, 0.03f, 0};
  float red[3], green[3], blue[3], grey[3];
  w.tracer.visible_fan(eye, {x, y, z, 3}, {red, green, blue});
  w.tracer.visible_fan(eye, {x, y, z, 3}, grey);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(Vec3(red[i], green[i], blue[i]), 0.125f * tint);
    EXPECT_FLOAT_EQ(grey[i], 0.0625f);
  }
  EXPECT_EQ(Vec3(red[2], green[2], blue[2]), Vec3(0));  // the ceiling
  EXPECT_EQ(w.tracer.transmittance(eye, out, 2.05f), Vec3(0.25f));
  EXPECT_EQ(w.tracer.transmittance(eye, out, 1), Vec3(1));
  EXPECT_EQ(w.tracer.transmittance(eye, -out, 3), Vec3(0));
  EXPECT_EQ(w.tracer.transmittance(Vec3(6, 1.5f, 2), -out, 3), 0.125f * tint);  // the other way, and no farther
  // A lone opaque pane, blended by name, costs nothing.
  const World solid(with(smoked(1)));
  EXPECT_FALSE(solid.tracer.lets_pass());
}

TEST(Glass, TwoTrianglesInOnePlaceAreOneSheet) {
  Scene s = room();
  glaze(s, smoked(0.5f));
  // The same box from the other side.
  add_box(s, s.parts.back().material, "back", Vec3(-0.02f), Vec3(4, 3, 4) + 0.02f, 1, true);
  const World w(std::move(s));
  for (int i = 0; i < 200; ++i) {
    const Vec2 u = sobol_owen(uint32_t(i), 5);
    const Vec3 d = normalize(Vec3(2, u.x - 0.5f, u.y - 0.5f));
    EXPECT_EQ(w.tracer.transmittance(Vec3(2, 1.5f, 2), d, INFINITY), Vec3(0.5f));
  }
}

TEST(Glass, HitsAreDrawnWithTheirShares) {
  Scene s = room();
  Material glass = stained();
  glass.transmission = 0.5f, glass.alpha_mode = AlphaMode::blend, glass.alpha = 0.8f;
  glaze(s, glass), glaze(s, smoked(0.25f), 0.1f);
  const World w(std::move(s));
  constexpr size_t n = 1 << 14;
  std::vector<float> x(n, 1), y(n), z(n);
  for (size_t i = 0; i < n; ++i) y[i] = 0.2f * sobol_owen(uint32_t(i), 1).x, z[i] = 0.2f * sobol_owen(uint32_t(i), 1).y;
  std::vector<Hit> hits(n);
  std::vector<Passage> passages(n);
  w.tracer.closest_fan(Vec3(2, 1.5f, 2), {x.data(), y.data(), z.data(), n}, hits.data(), passages.data());
  const Vec3 first = Vec3(0.2f) + 0.4f * tint;  // 1 - a + a t C
  Vec3 sum[3] = {Vec3(0), Vec3(0), Vec3(0)};
  for (size_t i = 0; i < n; ++i) {
    const int met = hits[i].triangle == none ? 2 : w.scene.triangles[hits[i].triangle].part == w.scene.parts.size() - 1;
    sum[met] += passages[i].hit / float(n);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(passages[i].sky[c], 0.75f * first[c], 1e-6f);
  }
  const Vec3 expected[3] = {Vec3(0.8f), 0.25f * first, 0.75f * first};  // what is covered, and has been reached
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[k][c], expected[k][c], 0.03f) << k;  // 5 sigmas
  // One ray alone, and any thread, draws the same.
  for (size_t i = 0; i < 64; ++i) {
    Passage p;
    const Hit h = w.tracer.closest(Vec3(2, 1.5f, 2), Vec3(x[i], y[i], z[i]), p);
    EXPECT_EQ(h.triangle, hits[i].triangle);
    EXPECT_EQ(p.hit, passages[i].hit);
  }
}

TEST(Glass, DiffuseBakesAreTinted) {
  const World glazed(with(stained())), dark(with(smoked(0.75f))), open = opened(glazed);
  for (int bounces : {0, 2}) {
    // Denoised, each would have weights of its own.
    BakeOptions o{.order = 4, .samples = 512, .bounces = bounces, .precision = Precision::single, .denoise = false};
    o.lobes = {{normalize(Vec3(1, 0.2f, 0.1f)), 4}, {normalize(Vec3(1, 0.1f, -0.2f)), 500}};  // broad and sharp
    auto a = bake(open.scene, open.tracer, open.receivers, o),
         b = bake(glazed.scene, glazed.tracer, glazed.receivers, o),
         c = bake(dark.scene, dark.tracer, dark.receivers, o);
    ASSERT_TRUE(a && b && c);
    EXPECT_EQ(b->channels, 3);
    EXPECT_EQ(c->channels, bounces == 0 ? 1 : 3);
    expect_tinted(*a, *b, inside(open), tint);
    expect_tinted(*a, *c, inside(open), Vec3(0.25f));
  }
}

TEST(Glass, DoesNotDependOnThreads) {
  Material glass = stained();
  glass.transmission = 0.5f;
  const World w(with(glass));
  const BakeOptions o{.order = 3, .samples = 128, .bounces = 2};
  auto all = bake(w.scene, w.tracer, w.receivers, o);
  Result<Transfer> one = Error{};
  run_serially([&] { one = bake(w.scene, w.tracer, w.receivers, o); });
  ASSERT_TRUE(all && one);
  for (size_t r = 0; r < w.receivers.count(); ++r) EXPECT_EQ(load_receiver(*all, r), load_receiver(*one, r));
}

TEST(Glass, MatricesAreTinted) {
  const World glazed(with(stained())), open = opened(glazed);
  for (bool paths : {false, true})
    for (int bounces : {0, 1}) {
      if (paths && bounces == 0) continue;
      BakeOptions o{.order = 3, .samples = 256, .bounces = bounces, .precision = Precision::single};
      if (!paths) o.lobes = {{normalize(Vec3(1, 0.2f, 0.1f)), 4}, {normalize(Vec3(1, 0.1f, -0.2f)), 500}};
      const MatrixOptions m{.incident_order = 3,
                            .outgoing = OutgoingKind::sh,
                            .outgoing_order = 3,
                            .grid = 16,
                            .response_samples = 256,
                            .simulate_paths = paths};
      auto baked = [&](const World& w) {
        return bake_matrix(w.scene, w.tracer, w.receivers, make_receiver_materials(w.scene, w.receivers, {}), o, m);
      };
      auto a = baked(open), b = baked(glazed);
      ASSERT_TRUE(a && b);
      if (!paths) {
        expect_tinted(a->transfer, b->transfer, inside(open), tint);
        continue;
      }
      // Paths pass glass by chance: their sums agree.
      for (size_t c = 0; c < 3; ++c) {
        double sums[2] = {0, 0};
        for (size_t r : inside(open))
          for (int k = 0; k < 2; ++k)
            sums[k] += double(load_receiver(k ? b->transfer : a->transfer, r)[c * a->transfer.columns()]);
        EXPECT_NEAR(sums[1], double(tint[int(c)]) * sums[0], 0.03 * sums[0]) << c;
      }
    }
}

TEST(Glass, LatticesAreTinted) {
  const World glazed(with(stained())), open = opened(glazed);
  // Denoised, each would have weights of its own.
  const BakeOptions o{.order = 3, .samples = 256, .bounces = 1, .precision = Precision::single, .denoise = false};
  const Lattice lattice{Vec3(0.5f), Vec3(3.5f, 2.5f, 3.5f), 2, 2, 2};
  auto baked = [&](const World& w) {
    auto t = bake(w.scene, w.tracer, w.receivers, o);
    return bake_lattice(w.scene, w.tracer, w.receivers, *t, nullptr, lattice,
                        {.order = 3, .samples = 512, .precision = Precision::single});
  };
  auto a = baked(open), b = baked(glazed);
  ASSERT_TRUE(a && b);
  std::vector<size_t> points(lattice.count());
  std::iota(points.begin(), points.end(), size_t{0});
  expect_tinted(a->transfer, b->transfer, points, tint);
}

TEST(Glass, LightmapsAreTinted) {
  auto lit = [](Scene s) {
    s.lights.push_back({.name = "point",
                        .kind = PunctualLight::Kind::point,
                        .position = Vec3(7, 2, 2.2f),
                        .intensity = Vec3(30, 40, 50)});
    const uint32_t lamp = add_material(s, "lamp", Vec3(0));
    s.materials[lamp].emissive = Vec3(5, 6, 7);
    add_quad(s, lamp, "lamp", Vec3(6, 1, 1), Vec3(0, 0, 1), Vec3(0, 1, 0), 1, 1);
    return s;
  };
  const World glazed(lit(with(stained()))), open = opened(glazed);
  const Environment sky = make_environment("skew", 16, 8, [](Vec3 d) { return Vec3(0.2f) + std::max(0.0f, d.x); });
  for (DirectionalKind kind : {DirectionalKind::none, DirectionalKind::sh2}) {
    const LightmapOptions o{
        .samples = 512, .lamp_samples = 256, .bounces = 1, .directional = kind, .precision = Precision::single};
    auto baked = [&](const World& w) {
      return bake_lightmap(w.scene, w.tracer, w.receivers, make_lamps(w.scene, &sky, true), o, false);
    };
    auto a = baked(open), b = baked(glazed);
    ASSERT_TRUE(a && b);
    expect_tinted(a->all, b->all, inside(open), tint, 0.02f);  // rays of the fan meet the lamp by chance
  }
}

TEST(Glass, ThatGlowsLightsByWhatIsThere) {
  // An emissive pane at alpha 0.5 gives half of what the solid one gives.
  auto glowing = [](float alpha) {
    Material m = smoked(alpha);
    m.emissive = Vec3(4, 2, 1);
    return m;
  };
  const World solid(with(glowing(1))), half(with(glowing(0.5f)));
  auto baked = [&](const World& w) {
    return bake_lightmap(w.scene, w.tracer, w.receivers, make_lamps(w.scene, nullptr, true),
                         {.samples = 4096, .lamp_samples = 256, .bounces = 0, .precision = Precision::single}, false);
  };
  auto a = baked(solid), b = baked(half);
  ASSERT_TRUE(a && b);
  for (size_t c = 0; c < 3; ++c) {
    double whole = 0, part = 0;
    for (size_t r : inside(solid))
      whole += double(load_receiver(a->all, r)[c]), part += double(load_receiver(b->all, r)[c]);
    EXPECT_NEAR(part, 0.5 * whole, 0.02 * whole);
    EXPECT_GT(whole, 1);
  }
}

TEST(Glass, VisibilityIsRounded) {
  const World open = opened(World(with(smoked(0.3f))));
  auto levels = [&](const World& w, int bits) {
    auto v = bake_visibility(w.tracer, w.receivers, {.size = 16, .bits = bits});
    EXPECT_TRUE(v);
    std::vector<uint8_t> out(cube_texels(16));
    decode_visibility(*v, w.receivers.front[12], out);  // in the middle of the floor
    return out;
  };
  const auto all = levels(open, 1);
  EXPECT_EQ(levels(World(with(smoked(0.3f))), 1), all);  // more than half is seen
  for (uint8_t level : levels(World(with(smoked(0.6f))), 1)) EXPECT_EQ(level, 0);
  const auto fine = levels(open, 4), half = levels(World(with(smoked(0.6f))), 4);
  size_t seen = 0;
  for (size_t t = 0; t < fine.size(); ++t) {
    EXPECT_NEAR(half[t], 0.4f * float(fine[t]), 0.51f);
    seen += fine[t] > 0;
  }
  EXPECT_GT(seen, 3u);
}

TEST(Glass, MasksAreHoles) {
  // A black ceiling over a floor, with a hole of polygons and with a picture of one: texel edges are where alpha
  // crosses the cutoff, halfway between 0 and 255.
  auto floor = [] {
    Scene s;
    add_quad(s, add_material(s, "floor", Vec3(0.6f)), "floor", Vec3(0), Vec3(0, 0, 4), Vec3(4, 0, 0), 4, 4);
    return s;
  };
  Scene holes = floor(), picture = floor();
  const uint32_t black = add_material(holes, "black", Vec3(0)), mask = add_material(picture, "mask", Vec3(0));
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      if (!(i == 1 && j == 2) && !(i == 3 && j == 0))
        add_quad(holes, black, "tile", Vec3(float(i), 1, float(j)), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1);
  add_quad(picture, mask, "ceiling", Vec3(0, 1, 0), Vec3(0, 0, 4), Vec3(4, 0, 0), 1, 1);
  Texture t;
  constexpr int side = 64;
  t.width = t.height = side, t.rgb.assign(3 * side * side, 255), t.alpha.assign(side * side, 255);
  t.wrap_s = t.wrap_t = Wrap::clamp;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      if ((x / 16 == 1 && y / 16 == 2) || (x / 16 == 3 && y / 16 == 0)) t.alpha[size_t(y * side + x)] = 0;
  picture.textures = {t};
  picture.texcoords[0].assign(picture.positions.size(), Vec2(0));
  for (size_t v = 0; v < picture.positions.size(); ++v)
    picture.texcoords[0][v] = 0.25f * Vec2(picture.positions[v].x, picture.positions[v].z);
  picture.materials[mask].base_color_texture = 0;
  picture.materials[mask].alpha_mode = AlphaMode::mask;
  for (Scene* s : {&holes, &picture})
    for (Triangle& triangle : s->triangles) triangle.two_sided = triangle.part > 0;
  const World a(std::move(holes)), b(std::move(picture));
  for (int bounces : {0, 1}) {
    const BakeOptions o{.order = 4, .samples = 4096, .bounces = bounces, .precision = Precision::single};
    auto x = bake(a.scene, a.tracer, a.receivers, o), y = bake(b.scene, b.tracer, b.receivers, o);
    ASSERT_TRUE(x && y);
    // The bilinear edge between a hole's and a solid texel is straight; only its corners are rounded.
    for (uint32_t v = 0; v < 25; ++v) {  // of the floor
      const std::vector<float> p = load_receiver(*x, a.receivers.front[v]), q = load_receiver(*y, b.receivers.front[v]);
      for (size_t k = 0; k < p.size(); ++k) EXPECT_NEAR(q[k], p[k], 0.006f) << v << " " << k;
    }
  }
}

TEST(Glass, TheReferenceAgrees) {
  SKIP_UNDER_SANITIZERS();
  // Coloured, half-covered panes that reflect as well, lamps on either side of them: bake and path tracer share no ray.
  Scene s = room(8);
  Material glass = stained();
  glass.transmission = 0.6f, glass.alpha_mode = AlphaMode::blend, glass.alpha = 0.7f;
  glaze(s, glass), glaze(s, smoked(0.2f), 0.3f);
  s.lights.push_back(
      {.name = "point", .kind = PunctualLight::Kind::point, .position = Vec3(6, 2, 2), .intensity = Vec3(9, 6, 3)});
  const World w(std::move(s));
  const Environment sky = test::skewed_environment();
  std::vector<Vec3> origins, normals;
  const uint32_t vertices[] = {40, 100, 144, 230};  // of the floor, 17 x 17
  for (uint32_t v : vertices) {
    const uint32_t r = w.receivers.front[v];
    origins.push_back(w.receivers.origins[r]), normals.push_back(w.receivers.normals[r]);
  }
  for (int bounces : {0, 2}) {
    const LightmapOptions o{.samples = 4096, .lamp_samples = 256, .bounces = bounces, .precision = Precision::single};
    auto map = bake_lightmap(w.scene, w.tracer, w.receivers, make_lamps(w.scene, &sky, false), o, false);
    ASSERT_TRUE(map);
    const auto truth = exit_radiances(w.scene, sky, origins, normals, bounces, 1 << 16, 3, {}, true);
    for (size_t i = 0; i < origins.size(); ++i) {
      const std::vector<float> e = load_receiver(map->all, w.receivers.front[vertices[i]]);
      // Bounces are interpolated between vertices half a metre apart.
      const float share = bounces == 0 ? 0.02f : 0.06f;
      for (size_t c = 0; c < 3; ++c) {
        const float t = truth[i].mean[int(c)];
        EXPECT_NEAR(e[c], t, share * t) << bounces << " bounces, " << i << " " << c;
      }
    }
  }

  // Its own closed form: tinted glass that reflects nothing.
  const World glazed(with(stained())), open = opened(glazed);
  const auto a = exit_radiances(open.scene, sky, origins, normals, 2, 1 << 15, 3),
             b = exit_radiances(glazed.scene, sky, origins, normals, 2, 1 << 15, 4);
  for (size_t i = 0; i < a.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const float sigma = std::sqrt(tint[c] * tint[c] * a[i].variance[c] + b[i].variance[c]);
      EXPECT_NEAR(b[i].mean[c], tint[c] * a[i].mean[c], test::sigmas * sigma) << i;
      EXPECT_LT(sigma, 0.05f * a[i].mean[c]);
    }
}

TEST(Glass, PicturesShowWhatIsBehind) {
  SKIP_UNDER_SANITIZERS();
  // Black panes in front of a uniform sky: 0.5^k of it, by render and by reference; tinted, in front of a lit wall.
  for (int panes = 1; panes <= 4; ++panes) {
    Scene s;
    for (int k = 0; k < panes; ++k) glaze(s, smoked(0.5f), 0.5f * float(k));
    glaze(s, stained(), 9);
    s.materials[0].emissive = Vec3(0.25f);  // the nearest pane glows where it is there
    const World w(std::move(s));
    const Environment white = test::uniform_environment(1);
    const Camera camera = test::look(Vec3(2, 1, 2), Vec3(4, 1, 2), 30);
    BakeOptions o{.order = 1, .samples = 16, .bounces = 0, .precision = Precision::single};
    auto transfer = bake(w.scene, w.tracer, w.receivers, o);
    ASSERT_TRUE(transfer);
    Relit relit;
    relight(*transfer, std::vector<Vec3>{Vec3(0)}, relit);
    RenderOptions options{.width = 4, .height = 4, .samples = 4, .background = &white};
    options.emission.assign(w.scene.materials.size(), Vec3(0));
    options.emission[0] = Vec3(0.25f);
    auto image = render(w.scene, w.tracer, w.receivers.basis, relit, camera, options);
    ASSERT_TRUE(image);
    ReferenceOptions r = test::small_picture(4, 4096, 1);
    r.background = true, r.lamps = true;
    auto truth = path_trace(w.scene, white, camera, r);
    ASSERT_TRUE(truth);
    const Vec3 expected = 0.125f + std::pow(0.5f, float(panes)) * tint;
    for (size_t i = 0; i < 16; ++i)
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(image->rgb[i][c], expected[c], 1e-5f);
        EXPECT_NEAR(truth->image.rgb[i][c], expected[c], test::sigmas * std::sqrt(truth->variance[i][c]) + 1e-5f);
      }
    options.background = nullptr, r.background = false;
    auto cut = render(w.scene, w.tracer, w.receivers.basis, relit, camera, options);
    auto cut_truth = path_trace(w.scene, white, camera, r);
    ASSERT_TRUE(cut && cut_truth);
    const float covered = 1 - std::pow(0.5f, float(panes)) * 0.5f;  // the tint's mean is 1/2
    EXPECT_NEAR(cut->alpha[5], covered, 1e-5f);
    EXPECT_NEAR(cut_truth->image.alpha[5], covered, 0.04f);
  }
}

}  // namespace
}  // namespace lambent

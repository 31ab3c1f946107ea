// Copies that share their triangles against the same scene without sharing.
#include <lambent/bake/bake.h>
#include <lambent/bake/lightmap.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/scene/procedural.h>
#include <lambent/trace/copies.h>
#include <lambent/trace/tracer.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A bent, lopsided thing without any symmetry.
Scene tree(int levels = 2) {
  Scene s = make_sphere(1, levels, Vec3(0.6f));
  for (Vec3& p : s.positions) p = Vec3(p.x * (1.2f + 0.4f * p.y), 2 * p.y + 0.3f * p.x * p.x, p.z + 0.5f * p.y * p.y);
  return s;
}

// Appends it, moved by `turn` and `at`; a mirrored one names its corners the other way about, as loaders do.
void plant(Scene& s, const Scene& model, const Mat3d& turn, Vec3d at, uint32_t material, bool two_sided = false) {
  const bool mirrored = dot(cross(turn[0], turn[1]), turn[2]) < 0;
  const Mat3d cofactors(cross(turn[1], turn[2]), cross(turn[2], turn[0]), cross(turn[0], turn[1]));
  std::vector<Vec3> positions, normals;
  for (Vec3 p : model.positions) positions.push_back(Vec3(turn * Vec3d(p) + at));
  for (Vec3 n : model.normals) normals.push_back(Vec3(normalize(cofactors * Vec3d(n) * (mirrored ? -1.0 : 1.0))));
  std::vector<uint32_t> indices;
  for (const Triangle& t : model.triangles)
    indices.insert(indices.end(), {t.v[0], t.v[mirrored ? 2 : 1], t.v[mirrored ? 1 : 2]});
  add_mesh(s, material, "tree", positions, normals, indices);
  for (uint32_t t = 0; t < s.parts.back().triangle_count; ++t)
    s.triangles[s.parts.back().first_triangle + t].two_sided = two_sided;
}

Mat3d some_turn(Random& random, bool mirrored) {
  auto number = [&] { return 2 * double(random.next()) - 1; };
  Mat3d m;
  double volume = 0;
  while (std::abs(volume) < 1) {
    m = Mat3d(Vec3d(number(), number(), number()), Vec3d(number(), number(), number()),
              Vec3d(number(), number(), number()));
    volume = dot(cross(m[0], m[1]), m[2]);
  }
  if ((volume < 0) != mirrored) m[0] = -m[0];
  return m;
}

// Twelve trees on a floor, of two kinds, turned, sheared, some mirrored.
Scene grove(bool glass = false) {
  Scene s;
  const uint32_t grey = add_material(s, "grey", Vec3(0.5f)), leaves = add_material(s, "leaves", Vec3(0.7f, 0.4f, 0.3f));
  if (glass) s.materials[leaves].transmission = 0.5f;
  add_quad(s, grey, "floor", Vec3(-4, -4, -4), Vec3(0, 0, 24), Vec3(32, 0, 0), 6, 6);
  Random random(3);
  Scene other = tree();
  for (Vec3& p : other.positions) p.x += 0.3f * p.y * p.y * p.z;
  for (int i = 0; i < 12; ++i)
    plant(s, i % 3 == 2 ? other : tree(), some_turn(random, i % 2 == 1), Vec3d(8 * (i % 4), 0.5, 8 * (i / 4)), leaves,
          glass);
  return s;
}

TEST(Copies, AreFoundWhateverTheMap) {
  const Scene s = grove();
  const std::vector<Shape> shapes = find_shapes(s, 1);
  ASSERT_EQ(shapes.size(), 2u);
  EXPECT_EQ(shapes[0].copies.size() + shapes[1].copies.size(), 12u);
  size_t flipped = 0;
  for (const Shape& shape : shapes) {
    EXPECT_EQ(shape.copies[0].part, shape.part);
    for (const Copy& copy : shape.copies) {
      flipped += copy.flipped;
      const Part &a = s.parts[shape.part], &b = s.parts[copy.part];
      for (uint32_t t = 0; t < a.triangle_count; ++t) {
        for (uint32_t k = 0; k < 3; ++k) {
          const Vec3d x = Vec3d(s.positions[s.triangles[a.first_triangle + t].v[k]]) - shape.middle;
          const Vec3d y = s.positions[s.triangles[b.first_triangle + t].v[copy.flipped && k > 0 ? 3 - k : k]];
          ASSERT_LT(length(Mat3d(copy.turn) * x + Vec3d(copy.at) - y), 6e-6);
        }
      }
    }
  }
  EXPECT_EQ(flipped, 6u);
}

TEST(Copies, DifferWhereAVertexDoes) {
  Scene s;
  add_material(s, "grey", Vec3(0.5f));
  Random random(1);
  for (int i = 0; i < 3; ++i) plant(s, tree(), some_turn(random, false), Vec3d(5 * i, 0, 0), 0);
  EXPECT_EQ(find_shapes(s, 1).at(0).copies.size(), 3u);
  s.positions[s.parts[1].first_vertex + 7] += Vec3(0, 1e-4f, 0);
  EXPECT_EQ(find_shapes(s, 1).at(0).copies.size(), 2u);
  EXPECT_TRUE(find_shapes(s, s.parts[0].triangle_count + 1).empty());
  // So do corners in another order, and what has no area or is not finite is no shape at all.
  Scene none_alike = s;
  std::swap(none_alike.triangles[s.parts[2].first_triangle], none_alike.triangles[s.parts[2].first_triangle + 1]);
  EXPECT_TRUE(find_shapes(none_alike, 1).empty());
  for (Vec3& p : s.positions) p = Vec3(p.x, 0, 0);
  EXPECT_TRUE(find_shapes(s, 1).empty());
}

TEST(Copies, MayBeFlat) {
  Scene s;
  add_material(s, "grey", Vec3(0.5f));
  add_quad(s, 0, "a", Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 4, 4);
  add_quad(s, 0, "b", Vec3(3, 0, 1), Vec3(0, 2, 1), Vec3(1, 1, 0), 4, 4);
  add_quad(s, 0, "c", Vec3(3, 0, 5), Vec3(0, 2, 0), Vec3(0, 0, 1), 4, 4);
  const std::vector<Shape> shapes = find_shapes(s, 1);
  ASSERT_EQ(shapes.size(), 1u);
  EXPECT_EQ(shapes[0].copies.size(), 3u);
}

struct Pair {
  Scene scene;
  Tracer apart, shared;
  explicit Pair(Scene s)
      : scene(std::move(s)),
        apart(*Tracer::build(scene, nullptr, Sharing::never)),
        shared(*Tracer::build(scene, nullptr, Sharing::always)) {}
  Pair(const Pair&) = delete;
};

// But for the rounding of coordinates of up to 30, which a ray that grazes a surface sees over its cosine.
void expect_same(const Scene& scene, Vec3 direction, const Hit& a, const Hit& b) {
  ASSERT_EQ(a.triangle, b.triangle);
  if (a.triangle == none) return;
  EXPECT_EQ(a.front, b.front);
  const float cosine = std::abs(dot(unit_normal(scene, scene.triangles[a.triangle]), direction));
  EXPECT_LT(std::abs(a.distance - b.distance) * cosine, 1e-5f);
  EXPECT_LT(std::abs(a.u - b.u) * cosine, 1e-4f);
  EXPECT_LT(std::abs(a.v - b.v) * cosine, 1e-4f);
}

// Rays whose every neighbour by a hair meets the same triangle: others may go either way.
template <class Check>
void for_sure_rays(const Pair& p, Check check) {
  Random random(2);
  size_t checked = 0, copies = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 from(28 * random.next() - 2, 8 * random.next() - 3, 20 * random.next() - 2);
    const Vec2 u(random.next(), random.next());
    const float z = 2 * u.x - 1, r = std::sqrt(1 - z * z);
    const Vec3 d(r * std::cos(2 * pi * u.y), z, r * std::sin(2 * pi * u.y));
    const Hit hit = p.apart.closest(from, d);
    bool sure = hit.triangle == none || (hit.distance > 1e-3f && std::min({hit.u, hit.v, 1 - hit.u - hit.v}) > 1e-3f);
    for (int k = 0; k < 3; ++k) {
      Vec3 aside(0);
      aside[size_t(k)] = 1e-4f;
      for (Vec3 near : {d + aside, d - aside}) sure = sure && p.apart.closest(from, near).triangle == hit.triangle;
    }
    if (!sure) continue;
    ++checked, copies += hit.triangle != none && p.scene.triangles[hit.triangle].part > 0;
    check(from, d, hit);
  }
  EXPECT_GT(checked, 10000u);
  EXPECT_GT(copies, 1000u);
}

TEST(SharedCopies, AreMetWhereTheyWouldBeApart) {
  const Pair p(grove());
  EXPECT_EQ(p.apart.copies(), 0u);
  EXPECT_EQ(p.shared.copies(), 12u);
  for_sure_rays(p, [&](Vec3 from, Vec3 d, const Hit& hit) {
    expect_same(p.scene, d, hit, p.shared.closest(from, d));
    const std::vector<float> x(20, d.x), y(20, d.y), z(20, d.z);
    std::vector<Hit> hits(20);
    std::vector<float> seen(20);
    p.shared.closest_fan(from, {x.data(), y.data(), z.data(), 20}, hits.data());
    p.shared.visible_fan(from, {x.data(), y.data(), z.data(), 20}, seen.data());
    expect_same(p.scene, d, hit, hits[0]), expect_same(p.scene, d, hit, hits[19]);
    EXPECT_EQ(seen[19], hit.triangle == none ? 1.0f : 0.0f);
    EXPECT_EQ(p.shared.closest(from, d, 0, hit.distance * 0.999f).triangle, none);
  });
}

TEST(SharedCopies, LetLightPass) {
  const Pair p(grove(true));
  ASSERT_TRUE(p.shared.lets_pass());
  std::vector<Hit> a, b;
  size_t deep = 0, unlike = 0;
  for_sure_rays(p, [&](Vec3 from, Vec3 d, const Hit& hit) {
    expect_same(p.scene, d, hit, p.shared.closest(from, d));
    p.apart.layers(from, d, 0, a), p.shared.layers(from, d, 0, b);
    if (a.size() != b.size()) return void(++unlike);  // layers behind the first are not sure
    bool same = true;
    for (size_t i = 0; i < a.size(); ++i) same = same && a[i].triangle == b[i].triangle;
    if (!same) return void(++unlike);
    for (size_t i = 0; i < a.size(); ++i) expect_same(p.scene, d, a[i], b[i]);
    deep += a.size() > 2;
    EXPECT_NEAR(p.apart.transmittance(from, d, 30).x, p.shared.transmittance(from, d, 30).x, 1e-5f);
  });
  EXPECT_GT(deep, 500u);
  EXPECT_LT(unlike, 20u);
}

// What two differ by, relative RMS over all receivers but the share of them that `most` gives: those that differ most.
double difference(const Transfer& a, const Transfer& b, double most) {
  EXPECT_EQ(a.receivers, b.receivers);
  std::vector<double> squares;
  double all = 0, sum = 0;
  for (size_t r = 0; r < a.receivers; ++r) {
    const std::vector<float> x = load_receiver(a, r), y = load_receiver(b, r);
    double square = 0;
    for (size_t i = 0; i < x.size(); ++i) {
      square += double(x[i] - y[i]) * double(x[i] - y[i]);
      all += double(x[i]) * double(x[i]);
    }
    squares.push_back(square);
  }
  std::sort(squares.begin(), squares.end());
  squares.resize(size_t(double(squares.size()) * (1 - most)));
  for (double square : squares) sum += square;
  return std::sqrt(sum / all);
}

// Direct light is the same to the bit, but at one receiver in five hundred, in a fold so tight that its hair above the
// surface is within the rounding of another. Of rays that bounce one in two thousand meets a neighbour of its triangle.
TEST(SharedCopies, BakeToTheSame) {
  SKIP_UNDER_SANITIZERS();
  for (bool glass : {false, true}) {
    const Pair p(grove(glass));
    const Receivers receivers = make_vertex_receivers(p.scene);
    for (int bounces : {0, 2}) {
      const BakeOptions options{.order = 4,
                                .samples = 256,
                                .bounces = bounces,
                                .precision = Precision::single,
                                .denoise = false,
                                .certify = false};
      auto a = bake(p.scene, p.apart, receivers, options), b = bake(p.scene, p.shared, receivers, options);
      ASSERT_TRUE(a && b);
      EXPECT_LT(difference(*a, *b, 0.005), bounces == 0 ? 1e-5 : 1e-3) << glass;
    }
  }
}

TEST(SharedCopies, GlowTheSame) {
  Scene s = grove();
  const uint32_t lamp = add_material(s, "lamp", Vec3(0));
  s.materials[lamp].emissive = Vec3(3, 2, 1);
  for (size_t p : {4, 7, 9}) s.parts[p].material = lamp;
  const Pair p(std::move(s));
  const Receivers receivers = make_vertex_receivers(p.scene);
  const Lamps lamps = make_lamps(p.scene, nullptr, true);
  const LightmapOptions options{.samples = 256, .lamp_samples = 16, .bounces = 1, .precision = Precision::single};
  auto a = bake_lightmap(p.scene, p.apart, receivers, lamps, options, false),
       b = bake_lightmap(p.scene, p.shared, receivers, lamps, options, false);
  ASSERT_TRUE(a && b);
  EXPECT_LT(difference(a->all, b->all, 0.005), 2e-3);
}

// Of itself only where it pays: not for a few pillars, but for a forest, whose tree then has one of each.
TEST(SharedCopies, AreThereWhereTheySaveMemory) {
  EXPECT_EQ(Tracer::build(grove())->copies(), 0u);
  Scene forest;
  add_material(forest, "leaves", Vec3(0.5f));
  const Scene model = tree(5);  // 20,480 triangles
  Random random(4);
  size_t one = 0;
  for (int i = 0; i < 60; ++i) {
    plant(forest, model, some_turn(random, false), Vec3d(5 * (i % 8), 0, 5 * (i / 8)), 0);
    if (i == 0) one = Tracer::build(forest)->bytes();
  }
  auto tracer = Tracer::build(forest);
  EXPECT_EQ(tracer->copies(), 60u);
  EXPECT_LT(tracer->bytes(), 2 * one);
  EXPECT_GT(Tracer::build(forest, nullptr, Sharing::never)->bytes(), 50 * one);
}

}  // namespace
}  // namespace lambent

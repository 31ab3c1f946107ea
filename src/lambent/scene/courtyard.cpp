// Torus-knot tube: parametrised about the curve on a torus, framed by the torus's own normal, which is periodic.
#include <lambent/core/check.h>
#include <lambent/scene/procedural.h>

#include <array>

namespace lambent {
namespace {

// One part under construction, and the planes at which grids are divided so that pieces meet at vertices, not inside
// cells.
struct Builder {
  float detail;
  std::array<std::vector<float>, 3> planes;
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;

  int cells(float length, float cell) const { return std::max(1, int(std::ceil(length * detail / cell - 1e-3f))); }

  void finish(Scene& scene, uint32_t material, const char* name) {
    add_mesh(scene, material, name, positions, normals, indices);
    positions.clear(), normals.clear(), indices.clear();
  }
};

struct Point {
  Vec3 position, normal;
};

// Grid of point(i, j), 0 <= i <= ni, 0 <= j <= nj; its front is along d/di x d/dj. `closed` joins the last row to the
// first.
template <class F>
void add_surface(Builder& b, int ni, int nj, bool closed, F point) {
  uint32_t first = uint32_t(b.positions.size()), row = uint32_t(ni) + 1, rows = uint32_t(closed ? nj : nj + 1);
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < row; ++i) {
      Point p = point(int(i), int(j));
      b.positions.push_back(p.position), b.normals.push_back(p.normal);
    }
  }
  auto add = [&](uint32_t u, uint32_t v, uint32_t w) {
    auto same = [&](uint32_t k, uint32_t l) { return b.positions[k] == b.positions[l]; };
    if (!same(u, v) && !same(v, w) && !same(w, u)) b.indices.insert(b.indices.end(), {u, v, w});
  };
  for (uint32_t j = 0; j < uint32_t(nj); ++j) {
    for (uint32_t i = 0; i + 1 < row; ++i) {
      uint32_t v = first + j * row + i, above = first + (j + 1) % rows * row + i;
      add(v, v + 1, above + 1), add(v, above + 1, above);
    }
  }
}

// Even steps of at most `cell` between `low` and `high` and the planes between them.
std::vector<float> ticks(const Builder& b, int axis, float low, float high, float cell) {
  std::vector<float> stops{low};
  for (float plane : b.planes[size_t(axis)])
    if (plane > low + 1e-4f && plane < high - 1e-4f) stops.push_back(plane);
  stops.push_back(high);
  std::sort(stops.begin(), stops.end());
  std::vector<float> out{low};
  for (size_t k = 1; k < stops.size(); ++k) {
    int n = b.cells(stops[k] - stops[k - 1], cell);
    for (int i = 1; i < n; ++i) out.push_back(stops[k - 1] + (stops[k] - stops[k - 1]) * float(i) / float(n));
    out.push_back(stops[k]);
  }
  return out;
}

// Cell sizes of a block's faces.
struct Cells {
  float left, right, bottom, top, back, front;  // -x, +x, -y, +y, -z, +z
};

void add_block(Builder& b, Vec3 min, Vec3 max, Cells cells) {
  const float sizes[6] = {cells.left, cells.right, cells.bottom, cells.top, cells.back, cells.front};
  for (int face = 0; face < 6; ++face) {
    int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    bool positive = face % 2 == 1;
    if (!positive) std::swap(u, v);
    std::vector<float> us = ticks(b, u, min[u], max[u], sizes[face]), vs = ticks(b, v, min[v], max[v], sizes[face]);
    Vec3 normal(0);
    normal[axis] = positive ? 1.0f : -1.0f;
    add_surface(b, int(us.size()) - 1, int(vs.size()) - 1, false, [&](int i, int j) {
      Vec3 p;
      p[axis] = positive ? max[axis] : min[axis], p[u] = us[size_t(i)], p[v] = vs[size_t(j)];
      return Point{p, normal};
    });
  }
}

void add_block(Builder& b, Vec3 min, Vec3 max, float cell) {
  add_block(b, min, max, {cell, cell, cell, cell, cell, cell});
}

// A cubic Bezier arc of a turned profile, (radius, height), upwards on the outside.
using Arc = std::array<Vec2, 4>;
Arc line(Vec2 a, Vec2 b) { return {a, a + (b - a) / 3.0f, b - (b - a) / 3.0f, b}; }

void add_turned(Builder& b, Vec3 foot, std::span<const Arc> profile, int around, float cell) {
  int n = std::max(8, int(std::lround(float(around) * b.detail)));
  for (const Arc& c : profile) {
    int steps = b.cells(length(c[1] - c[0]) + length(c[2] - c[1]) + length(c[3] - c[2]), cell);
    add_surface(b, steps, n, true, [&](int i, int j) {
      float t = float(i) / float(steps), s = 1 - t, turn = 2 * pi * float(j) / float(n);
      Vec2 p = s * s * s * c[0] + 3 * s * s * t * c[1] + 3 * s * t * t * c[2] + t * t * t * c[3];
      Vec2 d = s * s * (c[1] - c[0]) + 2 * s * t * (c[2] - c[1]) + t * t * (c[3] - c[2]);
      Vec3 out(std::cos(turn), 0, std::sin(turn));
      return Point{foot + p.x * out + Vec3(0, p.y, 0), normalize_or(d.y * out - Vec3(0, d.x, 0), out)};
    });
  }
}

// Heights and depths, metres. The yard is 6 x 6 between the walls; its front is at +z.
constexpr float half = 3.0f, outer = 3.3f, base = -0.2f;
constexpr float step_height = 0.15f, loggia = 2 * step_height;  // floor levels
constexpr float step_front = -0.40f, loggia_front = -0.75f;     // edges
constexpr float arcade_front = -1.05f, arcade_back = -1.35f;
constexpr float spring = 1.95f, arch_radius = 0.78f, arcade_top = 3.0f;
constexpr float roof_front = -0.88f, roof_top = 3.16f;
constexpr float left_height = 2.45f, right_height = 1.75f;
constexpr Vec3 plinth(0.1f, 0, 0.95f);
constexpr float plinth_top = 0.86f;

// A wall over three round arches; each bay is a grid between the arch and the bay's outline.
void add_arcade(Builder& b) {
  const float rise = arcade_top - spring, side = 1.0f;
  int up = b.cells(rise, 0.06f), across = b.cells(2 * side, 0.06f), radial = b.cells(0.40f, 0.06f);
  int deep = b.cells(arcade_front - arcade_back, 0.06f), along = 2 * up + across;
  for (float centre : {-2.0f, 0.0f, 2.0f}) {
    auto outline = [&](int k) {  // counter-clockwise from the right springing
      if (k <= up) return Vec2(side, rise * float(k) / float(up));
      if (k <= up + across) return Vec2(side - 2 * side * float(k - up) / float(across), rise);
      return Vec2(-side, rise * float(along - k) / float(up));
    };
    auto arch = [&](int k) { return normalize(outline(k)) * arch_radius; };
    auto wall = [&](int i, int k) { return arch(k) + (outline(k) - arch(k)) * (float(i) / float(radial)); };
    auto at = [&](Vec2 p, float z) { return Vec3(centre + p.x, spring + p.y, z); };
    add_surface(b, radial, along, false, [&](int i, int k) { return Point{at(wall(i, k), arcade_front), {0, 0, 1}}; });
    add_surface(b, along, radial, false, [&](int k, int i) { return Point{at(wall(i, k), arcade_back), {0, 0, -1}}; });
    auto depth = [&](int j) { return arcade_back + (arcade_front - arcade_back) * float(j) / float(deep); };
    add_surface(b, deep, along, false, [&](int j, int k) {
      return Point{at(arch(k), depth(j)), Vec3(-arch(k) / arch_radius, 0)};
    });
    for (int k : {0, along}) {  // undersides
      add_surface(b, radial, deep, false, [&](int i, int j) {
        return Point{at(wall(k == 0 ? i : radial - i, k), depth(j)), {0, -1, 0}};
      });
    }
    add_surface(b, across, deep, false, [&](int k, int j) { return Point{at(outline(up + k), depth(j)), {0, 1, 0}}; });
    if (centre > 1) {
      add_surface(b, up, deep, false, [&](int k, int j) { return Point{at(outline(k), depth(j)), {1, 0, 0}}; });
    } else if (centre < -1) {
      add_surface(b, up, deep, false, [&](int k, int j) {
        return Point{at(outline(along - up + k), depth(j)), {-1, 0, 0}};
      });
    }
  }
}

void add_column(Builder& b, float x) {
  Vec3 foot(x, loggia, 0.5f * (arcade_front + arcade_back));
  const float height = spring - loggia;
  add_block(b, foot + Vec3(-0.2f, 0, -0.2f), foot + Vec3(0.2f, 0.08f, 0.2f), 0.05f);
  add_block(b, foot + Vec3(-0.24f, height - 0.1f, -0.21f), foot + Vec3(0.24f, height, 0.21f), 0.05f);
  const Arc profile[] = {line({0, 0.08f}, {0.16f, 0.08f}),
                         {Vec2(0.16f, 0.08f), Vec2(0.21f, 0.08f), Vec2(0.21f, 0.15f), Vec2(0.16f, 0.15f)},
                         {Vec2(0.16f, 0.15f), Vec2(0.15f, 0.17f), Vec2(0.135f, 0.19f), Vec2(0.135f, 0.22f)},
                         {Vec2(0.135f, 0.22f), Vec2(0.137f, 0.65f), Vec2(0.125f, 1.1f), Vec2(0.112f, 1.33f)},
                         {Vec2(0.112f, 1.33f), Vec2(0.14f, 1.33f), Vec2(0.14f, 1.37f), Vec2(0.112f, 1.37f)},
                         line({0.112f, 1.37f}, {0.112f, 1.42f}),
                         {Vec2(0.112f, 1.42f), Vec2(0.125f, 1.49f), Vec2(0.16f, 1.55f), Vec2(0.195f, 1.55f)},
                         line({0.195f, 1.55f}, {0, 1.55f})};
  add_turned(b, foot, profile, 40, 0.04f);
}

// The (2, 3) torus knot, its axis turned a little from the viewer, resting on the plinth.
void add_knot(Builder& b) {
  constexpr float major = 0.36f, minor = 0.165f, tube = 0.105f;
  int along = b.cells(5.4f, 0.018f), around = b.cells(2 * pi * tube, 0.021f);
  Vec3 axis = normalize(Vec3(0.30f, 0.16f, 1)), side = normalize(cross(Vec3(0, 1, 0), axis));
  Mat3 stand(side, cross(axis, side), axis);
  size_t first = b.positions.size();
  add_surface(b, around, along, true, [&](int i, int j) {
    float t = 2 * pi * float(j) / float(along) + pi / 2;
    float c2 = std::cos(2 * t), s2 = std::sin(2 * t), c3 = std::cos(3 * t), s3 = std::sin(3 * t);
    float r = major + minor * c3;
    Vec3 out(c2 * c3, s2 * c3, s3);  // the torus's normal
    Vec3 tangent =
        normalize(Vec3(-3 * minor * s3 * c2 - 2 * r * s2, -3 * minor * s3 * s2 + 2 * r * c2, 3 * minor * c3));
    Vec3 across = cross(tangent, out);
    float turn = 2 * pi * float(i) / float(around);
    Vec3 n = std::cos(turn) * out + std::sin(turn) * across;
    return Point{stand * (Vec3(r * c2, r * s2, minor * s3) + tube * n), stand * n};
  });
  float lowest = INFINITY;
  for (size_t v = first; v < b.positions.size(); ++v) lowest = std::min(lowest, b.positions[v].y);
  for (size_t v = first; v < b.positions.size(); ++v) b.positions[v] += plinth + Vec3(0, plinth_top - lowest, 0);
}

void add_urn(Builder& b, Vec3 foot) {
  const Arc profile[] = {line({0, 0}, {0.15f, 0}),
                         line({0.15f, 0}, {0.15f, 0.03f}),
                         {Vec2(0.15f, 0.03f), Vec2(0.08f, 0.05f), Vec2(0.07f, 0.09f), Vec2(0.11f, 0.13f)},
                         {Vec2(0.11f, 0.13f), Vec2(0.36f, 0.30f), Vec2(0.30f, 0.52f), Vec2(0.13f, 0.60f)},
                         {Vec2(0.13f, 0.60f), Vec2(0.10f, 0.64f), Vec2(0.11f, 0.68f), Vec2(0.19f, 0.72f)},
                         line({0.19f, 0.72f}, {0.165f, 0.725f}),
                         {Vec2(0.165f, 0.725f), Vec2(0.09f, 0.68f), Vec2(0.08f, 0.64f), Vec2(0.10f, 0.58f)},
                         line({0.10f, 0.58f}, {0, 0.56f})};
  add_turned(b, foot, profile, 48, 0.03f);
}

}  // namespace

Scene make_courtyard(float detail) {
  LAMBENT_CHECK(detail > 0 && detail <= 64);
  Scene scene;
  uint32_t stone = add_material(scene, "stone", {0.60f, 0.56f, 0.50f});
  uint32_t plaster = add_material(scene, "plaster", {0.74f, 0.70f, 0.63f});
  uint32_t terracotta = add_material(scene, "terracotta", {0.65f, 0.16f, 0.08f});
  uint32_t teal = add_material(scene, "teal", {0.08f, 0.28f, 0.45f});
  uint32_t marble = add_material(scene, "marble", {0.80f, 0.79f, 0.77f});
  uint32_t ochre = add_material(scene, "ochre", {0.72f, 0.42f, 0.11f});
  Builder b;
  b.detail = detail;
  b.planes[0] = {-half, -2.90f, -2.45f, plinth.x - 0.45f, plinth.x + 0.45f, half};
  b.planes[1] = {0, step_height, loggia, right_height, left_height};
  b.planes[2] = {-half,        arcade_back, arcade_front,     roof_front,
                 loggia_front, step_front,  plinth.z - 0.45f, plinth.z + 0.45f};
  constexpr float fine = 0.05f, medium = 0.075f, coarse = 0.3f;

  add_block(b, {-half, base, step_front}, {half, 0, half}, {coarse, coarse, coarse, fine, coarse, medium});
  b.finish(scene, stone, "floor");
  add_block(b, {-half, base, loggia_front}, {half, step_height, step_front},
            {coarse, coarse, coarse, fine, coarse, fine});
  add_block(b, {-half, base, -half}, {half, loggia, loggia_front}, {coarse, coarse, coarse, fine, coarse, fine});
  b.finish(scene, stone, "steps");

  const Cells left_wall{coarse, medium, coarse, coarse, coarse, medium};
  const Cells right_wall{medium, coarse, coarse, coarse, coarse, medium};
  add_block(b, {-outer, base, -outer}, {-half, arcade_top, roof_front}, left_wall);
  add_block(b, {-outer, base, roof_front}, {-half, left_height, half}, left_wall);
  b.finish(scene, terracotta, "left wall");
  add_block(b, {half, base, -outer}, {outer, arcade_top, roof_front}, right_wall);
  add_block(b, {half, base, roof_front}, {outer, right_height, half}, right_wall);
  b.finish(scene, teal, "right wall");
  add_block(b, {-half, base, -outer}, {half, arcade_top, -half}, {coarse, coarse, coarse, coarse, coarse, medium});
  b.finish(scene, plaster, "back wall");
  add_block(b, {-outer - 0.05f, left_height, roof_front}, {-half + 0.05f, left_height + 0.07f, half + 0.05f}, medium);
  add_block(b, {half - 0.05f, right_height, roof_front}, {outer + 0.05f, right_height + 0.07f, half + 0.05f}, medium);
  b.finish(scene, plaster, "copings");
  add_block(b, {-outer - 0.05f, arcade_top, -outer - 0.05f}, {outer + 0.05f, roof_top, roof_front},
            {medium, medium, medium, 0.15f, coarse, fine});
  b.finish(scene, plaster, "roof");

  add_arcade(b);
  for (float sign : {-1.0f, 1.0f}) {  // half-piers at the walls, with imposts
    auto pier = [&](float inner, float low, float high, float margin) {
      float x0 = sign * half, x1 = sign * inner;
      add_block(b, {std::min(x0, x1), low, arcade_back - margin}, {std::max(x0, x1), high, arcade_front + margin},
                fine);
    };
    pier(half - 0.22f, loggia, spring - 0.1f, 0.0f);
    pier(half - 0.26f, spring - 0.1f, spring, 0.04f);
  }
  b.finish(scene, plaster, "arcade");
  add_column(b, -1), add_column(b, 1);
  b.finish(scene, marble, "columns");

  add_block(b, plinth + Vec3(-0.45f, 0, -0.45f), plinth + Vec3(0.45f, 0.10f, 0.45f), fine);
  add_block(b, plinth + Vec3(-0.34f, 0.10f, -0.34f), plinth + Vec3(0.34f, 0.80f, 0.34f), fine);
  add_block(b, plinth + Vec3(-0.40f, 0.80f, -0.40f), plinth + Vec3(0.40f, plinth_top, 0.40f), fine);
  b.finish(scene, stone, "plinth");
  add_knot(b);
  b.finish(scene, marble, "knot");

  add_block(b, {-2.90f, 0.38f, -0.15f}, {-2.45f, 0.45f, 1.25f}, fine);
  for (float z : {0.0f, 0.95f}) add_block(b, {-2.84f, 0, z}, {-2.51f, 0.38f, z + 0.15f}, fine);
  b.finish(scene, stone, "bench");
  int levels = std::clamp(int(std::lround(4 + std::log2(detail))), 1, 8);
  add_sphere(scene, marble, "sphere on the bench", {-2.66f, 0.45f + 0.17f, 0.25f}, 0.17f, levels);
  add_sphere(scene, marble, "large sphere", {-2.15f, 0.38f, 1.95f}, 0.38f, levels);
  add_sphere(scene, marble, "small sphere", {2.25f, 0.27f, 1.30f}, 0.27f, levels);
  add_urn(b, {2.45f, 0, 0.45f});
  b.finish(scene, ochre, "urn");
  return scene;
}

Camera courtyard_camera() {
  Camera camera;
  camera.eye = {0.95f, 1.95f, 7.6f}, camera.target = {-0.05f, 1.42f, -0.3f};
  camera.fov = 35.0f;
  return camera;
}

}  // namespace lambent

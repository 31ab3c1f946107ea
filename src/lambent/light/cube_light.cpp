// Follows: locally-adaptive-products, section 4 (cubemap texels weighted by their solid angles).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/cube_light.h>

#include <array>

namespace lambent {
namespace {

// A convex polygon of few corners.
template <class V>
struct Polygon {
  std::array<V, 12> at;
  int count = 0;
  void add(V v) { at[size_t(count++)] = v; }
};

// What of the polygon lies where side(v) >= 0; side is linear.
template <class V, class Side>
Polygon<V> clip(const Polygon<V>& p, Side side) {
  Polygon<V> out;
  for (int i = 0; i < p.count; ++i) {
    const V a = p.at[size_t(i)], b = p.at[size_t((i + 1) % p.count)];
    const float s = side(a), t = side(b);
    if (s >= 0) out.add(a);
    if ((s < 0) != (t < 0)) out.add(a + (b - a) * (s / (s - t)));
  }
  return out;
}

// Parts of one texel of the map: where they lie in the cube, their solid angles, and directions.
struct Parts {
  struct Part {
    size_t texel;
    float solid_angle;
    Vec3 direction;
  };
  std::vector<Part> parts;
  float total = 0;
};

void add_part(int size, int face, int column, int row, const Polygon<Vec2>& p, Parts& out) {
  float area = 0;
  Vec2 centre(0);
  for (int i = 1; i + 1 < p.count; ++i) {
    const Vec2 a = p.at[size_t(i)] - p.at[0], b = p.at[size_t(i + 1)] - p.at[0];
    const float twice = std::abs(a.x * b.y - a.y * b.x);
    area += 0.5f * twice, centre += 0.5f * twice * (p.at[0] + (a + b) / 3.0f);
  }
  if (!(area > 0)) return;
  centre = centre / area * (2 / float(size)) - 1.0f;
  const Vec3 point = cube_point(face, centre.x, centre.y);
  const float length2 = glm::dot(point, point), solid_angle = area / (length2 * std::sqrt(length2));
  out.parts.push_back({cube_texel(size, face, column, row), solid_angle, point / std::sqrt(length2)});
  out.total += solid_angle;
}

// The polygon on a face, in texels.
void add_parts(int size, int face, const Polygon<Vec2>& p, Parts& out) {
  Vec2 least(p.at[0]), most(p.at[0]);
  for (int i = 1; i < p.count; ++i) least = glm::min(least, p.at[size_t(i)]), most = glm::max(most, p.at[size_t(i)]);
  auto cell = [&](float x) { return std::clamp(int(x), 0, size - 1); };
  const int x0 = cell(least.x), x1 = cell(most.x), y0 = cell(least.y), y1 = cell(most.y);
  for (int y = y0; y <= y1; ++y) {
    Polygon<Vec2> strip = p;
    if (y > y0) strip = clip(strip, [&](Vec2 v) { return v.y - float(y); });
    if (y < y1) strip = clip(strip, [&](Vec2 v) { return float(y + 1) - v.y; });
    for (int x = x0; x <= x1; ++x) {
      Polygon<Vec2> part = strip;
      if (x > x0) part = clip(part, [&](Vec2 v) { return v.x - float(x); });
      if (x < x1) part = clip(part, [&](Vec2 v) { return float(x + 1) - v.x; });
      add_part(size, face, x, y, part, out);
    }
  }
}

Vec2 to_texels(const CubePlace& p, int size) { return (Vec2(p.u, p.v) + 1.0f) * (0.5f * float(size)); }

void add_texel(int size, const std::array<Vec3, 4>& corners, Parts& out) {
  out.parts.clear(), out.total = 0;
  Polygon<Vec2> flat;
  int face = -1;
  bool one = true;
  for (const Vec3& c : corners) {
    const CubePlace place = cube_place(c);
    one &= face < 0 || place.face == face;
    face = place.face;
    flat.add(to_texels(place, size));
  }
  if (one) return add_parts(size, face, flat, out);
  for (int f = 0; f < 6; ++f) {
    // The face's cone: |u|, |v| <= w along its axis.
    const Vec3 axis = cube_point(f, 0, 0), u = cube_point(f, 1, 0) - axis, v = cube_point(f, 0, 1) - axis;
    Polygon<Vec3> p;
    for (const Vec3& c : corners) p.add(c);
    for (const Vec3& edge : {axis - u, axis + u, axis - v, axis + v})
      if (p.count > 0) p = clip(p, [&](Vec3 d) { return glm::dot(edge, d); });
    if (p.count < 3) continue;
    Polygon<Vec2> on_face;
    for (int i = 0; i < p.count; ++i) {
      const Vec3 d = p.at[size_t(i)] / glm::dot(axis, p.at[size_t(i)]);
      on_face.add(glm::clamp(to_texels({f, glm::dot(u, d), glm::dot(v, d)}, size), 0.0f, float(size)));
    }
    add_parts(size, f, on_face, out);
  }
}

}  // namespace

CubeLight cube_light(const Environment& env, int size, const Mat3& rotation) {
  LAMBENT_CHECK(is_cube_size(size));
  // Texels of the map are cut so small that the arcs of their parallels are straight.
  const int w = env.image.width, h = env.image.height, split = std::max(1, (4 * size + w - 1) / w);
  const int fine_w = w * split, fine_h = h * split;
  constexpr size_t pieces = 8;  // whose sums are added in order, so that the result does not depend on threads
  struct Sum {
    std::vector<Vec3> energy;
    std::vector<Vec3> moment;  // sum of channels of energy, times direction
  };
  std::vector<Sum> sums(pieces);
  parallel_for(pieces, 1, [&](size_t begin, size_t end) {
    for (size_t piece = begin; piece < end; ++piece) {
      Sum& sum = sums[piece];
      sum.energy.assign(cube_texels(size), Vec3(0)), sum.moment.assign(cube_texels(size), Vec3(0));
      Parts parts;
      std::vector<Vec3> above, below;
      auto corners = [&](int row) {
        std::vector<Vec3> out;
        for (int x = 0; x <= fine_w; ++x) out.push_back(rotation * latlong_direction(Vec2(float(x) / float(fine_w), float(row) / float(fine_h))));
        return out;
      };
      const int first = int(size_t(fine_h) * piece / pieces), last = int(size_t(fine_h) * (piece + 1) / pieces);
      if (first < last) below = corners(first);
      for (int y = first; y < last; ++y) {
        above = std::move(below), below = corners(y + 1);
        const float solid_angle = float(texel_solid_angle(y, fine_w, fine_h));
        for (int x = 0; x < fine_w; ++x) {
          const Vec3 radiance = env.image.at(x / split, y / split);
          if (radiance == Vec3(0)) continue;
          const size_t i = size_t(x);
          add_texel(size, {above[i], above[i + 1], below[i + 1], below[i]}, parts);
          for (const Parts::Part& part : parts.parts) {
            const Vec3 energy = radiance * (solid_angle * part.solid_angle / parts.total);
            sum.energy[part.texel] += energy;
            sum.moment[part.texel] += (energy.x + energy.y + energy.z) * part.direction;
          }
        }
      }
    }
  });
  CubeLight light{size, std::move(sums[0].energy), std::move(sums[0].moment)};
  const Cube cube = make_cube(size);
  parallel_for(cube_texels(size), 4096, [&](size_t begin, size_t end) {
    for (size_t piece = 1; piece < pieces; ++piece)
      for (size_t t = begin; t < end; ++t) light.energy[t] += sums[piece].energy[t], light.direction[t] += sums[piece].moment[t];
    for (size_t t = begin; t < end; ++t) light.direction[t] = normalize_or(light.direction[t], cube.texels.at(t));
  });
  return light;
}

Environment reduced(const Environment& env, int width) {
  const int w = env.image.width, h = env.image.height;
  int factor = std::max(1, w / width);
  while (factor > 1 && (w % factor || h % factor)) --factor;
  if (factor == 1) return env;
  Environment out = env;
  out.image = Image(w / factor, h / factor);
  for (int y = 0; y < h / factor; ++y)
    for (int x = 0; x < w / factor; ++x) {
      glm::dvec3 sum(0);
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i) sum += glm::dvec3(env.image.at(x * factor + i, y * factor + j)) * texel_solid_angle(y * factor + j, w, h);
      out.image.at(x, y) = Vec3(sum / texel_solid_angle(y, w / factor, h / factor));
    }
  return out;
}

float largest_share(const CubeLight& light) {
  double total = 0, largest = 0;
  for (const Vec3& e : light.energy) {
    const double sum = double(e.x) + double(e.y) + double(e.z);
    total += sum, largest = std::max(largest, sum);
  }
  return total > 0 ? float(largest / total) : 0.0f;
}

}  // namespace lambent

// Follows: locally-adaptive-products, section 4 (cubemap texels weighted by their solid angles).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/cube_light.h>

#include <algorithm>
#include <numbers>

namespace lambent {
namespace {

// A convex polygon: a quad, cut by at most two lines a side and once more by each of two.
struct Polygon {
  float at[2][12];  // by axis
  int count = 0;

  Polygon() {}  // corners are set as they come
  void add(int axis, float along, float across) { at[axis][count] = along, at[1 - axis][count++] = across; }
};

// What of the polygon lies below and above `place` on an axis.
void cut(const Polygon& p, int axis, float place, Polygon& low, Polygon& high) {
  low.count = high.count = 0;
  const float *along = p.at[axis], *across = p.at[1 - axis];
  for (int i = 0; i < p.count; ++i) {
    const int j = i + 1 == p.count ? 0 : i + 1;
    const bool below = along[i] <= place;
    (below ? low : high).add(axis, along[i], across[i]);
    if (below != (along[j] <= place)) {
      const float y = across[i] + (across[j] - across[i]) * ((place - along[i]) / (along[j] - along[i]));
      low.add(axis, place, y), high.add(axis, place, y);
    }
  }
}

// Parts of one texel of the map: where they lie in the cube, their solid angles, and the directions of their middles.
struct Part {
  size_t texel;
  float solid_angle;
  Vec3 direction;
};
struct Parts {
  Part at[64];
  int count = 0;
  float total = 0;

  Parts() {}
};

void add_part(int size, int face, int column, int row, const Polygon& p, Parts& out) {
  if (p.count < 3 || out.count == std::ssize(out.at)) return;
  const float x0 = p.at[0][0], y0 = p.at[1][0];
  float twice = 0, cx = 0, cy = 0;
  for (int i = 1; i + 1 < p.count; ++i) {
    const float ax = p.at[0][i] - x0, ay = p.at[1][i] - y0, bx = p.at[0][i + 1] - x0, by = p.at[1][i + 1] - y0,
                area = std::abs(ax * by - ay * bx);
    twice += area, cx += area * (ax + bx), cy += area * (ay + by);
  }
  if (!(twice > 0)) return;
  const float third = 1 / (3 * twice), scale = 2 / float(size);
  const Vec3 point = cube_point(face, (x0 + cx * third) * scale - 1, (y0 + cy * third) * scale - 1);
  const float inverse = 1 / std::sqrt(dot(point, point)), solid_angle = 0.5f * twice * inverse * inverse * inverse;
  out.at[out.count++] = {cube_texel(size, face, column, row), solid_angle, point * inverse};
  out.total += solid_angle;
}

// The polygon on a face, in texels, along their grid, which it meets in these columns and rows.
void add_parts(int size, int face, const Polygon& p, int first_column, int last_column, int first_row, int last_row,
               Parts& out) {
  Polygon right = p, column, lower, cell;
  for (int x = first_column; x <= last_column; ++x) {
    if (x < last_column) {
      const Polygon whole = right;
      cut(whole, 0, float(x + 1), column, right);
    }
    const Polygon& strip = x < last_column ? column : right;
    if (first_row == last_row) {
      add_part(size, face, x, first_row, strip, out);
      continue;
    }
    lower = strip;
    for (int y = first_row; y < last_row; ++y) {
      const Polygon whole = lower;
      cut(whole, 1, float(y + 1), cell, lower);
      add_part(size, face, x, y, cell, out);
    }
    add_part(size, face, x, last_row, lower, out);
  }
}

// A corner of a texel of the map.
struct Corner {
  Vec3 d;
  int face;
  Vec2 at;  // on it, in texels
  int column, row;
};
Corner make_corner(int size, Vec3 d) {
  const CubePlace place = cube_place(d);
  const Vec2 at = (Vec2(place.u, place.v) + 1.0f) * (0.5f * float(size));
  return {d, place.face, at, std::min(int(at.x), size - 1), std::min(int(at.y), size - 1)};
}

// A texel whose corners lie on several faces: on each that it may touch, what lies within the face.
void add_over_edges(int size, const Corner* const (&corners)[4], Parts& out) {
  const float end = float(size);
  for (int f = 0; f < 6; ++f) {
    const Vec3 axis = cube_point(f, 0, 0), u = cube_point(f, 1, 0) - axis, v = cube_point(f, 0, 1) - axis;
    Polygon p, inside, outside;
    bool near = true;
    for (const Corner* c : corners) {
      const float along = dot(axis, c->d);
      near &= along > 0.4f;  // on the face it would be 0.577 at least
      p.add(0, (dot(u, c->d) / along + 1) * 0.5f * end, (dot(v, c->d) / along + 1) * 0.5f * end);
    }
    if (!near) continue;
    for (int axis_of_face = 0; axis_of_face < 2; ++axis_of_face) {
      cut(p, axis_of_face, end, inside, outside);
      cut(inside, axis_of_face, 0, outside, p);
    }
    if (p.count < 3) continue;
    int first[2], last[2];
    for (int a = 0; a < 2; ++a) {
      const auto [least, most] = std::minmax_element(p.at[a], p.at[a] + p.count);
      first[a] = std::clamp(int(*least), 0, size - 1), last[a] = std::clamp(int(*most), 0, size - 1);
    }
    add_parts(size, f, p, first[0], last[0], first[1], last[1], out);
  }
}

void add_texel(int size, const Corner* const (&corners)[4], Parts& out) {
  const Corner &a = *corners[0], &b = *corners[1], &c = *corners[2], &d = *corners[3];
  out.count = 0, out.total = 0;
  if (a.face != b.face || a.face != c.face || a.face != d.face) {
    add_over_edges(size, corners, out);
  } else {
    const auto [first_column, last_column] = std::minmax({a.column, b.column, c.column, d.column});
    const auto [first_row, last_row] = std::minmax({a.row, b.row, c.row, d.row});
    if (first_column != last_column || first_row != last_row) {
      Polygon p;
      for (const Corner* corner : corners) p.add(0, corner->at.x, corner->at.y);
      add_parts(size, a.face, p, first_column, last_column, first_row, last_row, out);
    }
  }
  if (out.count > 0) return;
  // Within one texel of the cube, or too thin for floats to have an area.
  out.at[out.count++] = {cube_texel(size, a.face, a.column, a.row), 1, 0.25f * (a.d + b.d + c.d + d.d)};
  out.total = 1;
}

}  // namespace

CubeLight cube_light(const Environment& env, int size, const Mat3& rotation) {
  LAMBENT_CHECK(is_cube_size(size));
  // Texels of the map are cut so small that the arcs of their parallels are straight.
  const int w = env.image.width, h = env.image.height, split = std::max(1, (4 * size + w - 1) / w);
  const int fine_w = w * split, fine_h = h * split;
  constexpr size_t pieces = 4;  // whose sums are added in order, so that the result does not depend on threads
  struct Sum {
    Vec3 energy;
    Vec3 moment;  // sum of channels of energy, times direction
  };
  std::vector<std::vector<Sum>> sums(pieces);
  std::vector<Vec3> meridians;  // on the equator, turned
  for (int x = 0; x <= fine_w; ++x)
    meridians.push_back(rotation * latlong_direction(Vec2(float(x) / float(fine_w), 0.5f)));
  parallel_for(pieces, 1, [&](size_t begin, size_t end) {
    for (size_t piece = begin; piece < end; ++piece) {
      std::vector<Sum>& sum = sums[piece];
      sum.assign(cube_texels(size), {Vec3(0), Vec3(0)});
      Parts parts;
      std::vector<Corner> above(size_t(fine_w) + 1), below(size_t(fine_w) + 1);
      auto set_corners = [&](int row, std::vector<Corner>& corners) {
        const double theta = std::numbers::pi * row / fine_h;
        const float sine = float(std::sin(theta));
        const Vec3 up = float(std::cos(theta)) * rotation[1];
        for (size_t x = 0; x < corners.size(); ++x) corners[x] = make_corner(size, sine * meridians[x] + up);
      };
      const int first = int(size_t(fine_h) * piece / pieces), last = int(size_t(fine_h) * (piece + 1) / pieces);
      if (first < last) set_corners(first, below);
      for (int y = first; y < last; ++y) {
        std::swap(above, below);
        set_corners(y + 1, below);
        const float solid_angle = float(texel_solid_angle(y, fine_w, fine_h));
        const Vec3* row = &env.image.at(0, y / split);
        for (int x = 0; x < fine_w; ++x) {
          const Vec3 radiance = row[x / split];
          if (radiance == Vec3(0)) continue;
          const size_t i = size_t(x);
          add_texel(size, {&above[i], &above[i + 1], &below[i + 1], &below[i]}, parts);
          const float scale = solid_angle / parts.total, channels = radiance.x + radiance.y + radiance.z;
          for (int k = 0; k < parts.count; ++k) {
            const Part& part = parts.at[k];
            const float share = part.solid_angle * scale;
            sum[part.texel].energy += share * radiance;
            sum[part.texel].moment += share * channels * part.direction;
          }
        }
      }
    }
  });
  CubeLight light{size, std::vector<Vec3>(cube_texels(size)), std::vector<Vec3>(cube_texels(size))};
  parallel_for(size_t(6 * size), 16, [&](size_t begin, size_t end) {
    for (size_t line = begin; line < end; ++line)
      for (int column = 0; column < size; ++column) {
        const int face = int(line) / size, row = int(line) % size;
        const size_t t = cube_texel(size, face, column, row);
        Sum total = sums[0][t];
        for (size_t piece = 1; piece < pieces; ++piece)
          total.energy += sums[piece][t].energy, total.moment += sums[piece][t].moment;
        const auto place = [&](int k) { return (2 * float(k) + 1) / float(size) - 1; };
        light.energy[t] = total.energy;
        light.direction[t] = normalize_or(total.moment, normalize(cube_point(face, place(column), place(row))));
      }
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
      Vec3d sum(0);
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i)
          sum += Vec3d(env.image.at(x * factor + i, y * factor + j)) * texel_solid_angle(y * factor + j, w, h);
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

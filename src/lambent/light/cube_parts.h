#pragma once
// Texels of a lat-long map, cut along the texels of a cube of `size` a side. Follows: locally-adaptive-products,
// section 4 (cubemap texels weighted by their solid angles).
#include <lambent/basis/cubemap.h>

#include <algorithm>

namespace lambent {

// A convex polygon: a quad, cut by at most two lines a side and once more by each of two.
struct FacePolygon {
  float at[2][12];  // by axis
  int count = 0;

  FacePolygon() {}  // corners are set as they come
  void add(int axis, float along, float across) { at[axis][count] = along, at[1 - axis][count++] = across; }
};

// What of the polygon lies below and above `place` on an axis.
inline void cut_polygon(const FacePolygon& p, int axis, float place, FacePolygon& low, FacePolygon& high) {
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

// What one texel of the map is cut into: where in the cube, with its solid angle and the direction of its middle.
struct CubePart {
  int face, column, row;
  float solid_angle;
  Vec3 direction;
};
struct CubeParts {
  CubePart at[64];
  int count = 0;
  float total = 0;

  CubeParts() {}
};

inline void add_cube_part(int size, int face, int column, int row, const FacePolygon& p, CubeParts& out) {
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
  out.at[out.count++] = {face, column, row, solid_angle, point * inverse};
  out.total += solid_angle;
}

// The polygon on a face, in texels, along their grid, which it meets in these columns and rows.
inline void cut_along_grid(int size, int face, const FacePolygon& p, int first_column, int last_column, int first_row,
                           int last_row, CubeParts& out) {
  FacePolygon right = p, column, lower, cell;
  for (int x = first_column; x <= last_column; ++x) {
    if (x < last_column) {
      const FacePolygon whole = right;
      cut_polygon(whole, 0, float(x + 1), column, right);
    }
    const FacePolygon& strip = x < last_column ? column : right;
    if (first_row == last_row) {
      add_cube_part(size, face, x, first_row, strip, out);
      continue;
    }
    lower = strip;
    for (int y = first_row; y < last_row; ++y) {
      const FacePolygon whole = lower;
      cut_polygon(whole, 1, float(y + 1), cell, lower);
      add_cube_part(size, face, x, y, cell, out);
    }
    add_cube_part(size, face, x, last_row, lower, out);
  }
}

// A corner of a texel of the map.
struct CubeCorner {
  Vec3 d;
  int face;
  Vec2 at;  // on it, in texels
  int column, row;
};
inline CubeCorner cube_corner(int size, Vec3 d) {
  const CubePlace place = cube_place(d);
  const Vec2 at = (Vec2(place.u, place.v) + 1.0f) * (0.5f * float(size));
  return {d, place.face, at, std::min(int(at.x), size - 1), std::min(int(at.y), size - 1)};
}

// A texel whose corners lie on several faces: on each that it may touch, what lies within the face.
inline void cut_over_edges(int size, const CubeCorner* const (&corners)[4], CubeParts& out) {
  const float end = float(size);
  for (int f = 0; f < 6; ++f) {
    const Vec3 axis = cube_point(f, 0, 0), u = cube_point(f, 1, 0) - axis, v = cube_point(f, 0, 1) - axis;
    FacePolygon p, inside, outside;
    bool near = true;
    for (const CubeCorner* c : corners) {
      const float along = dot(axis, c->d);
      near &= along > 0.4f;  // on the face it would be 0.577 at least
      p.add(0, (dot(u, c->d) / along + 1) * 0.5f * end, (dot(v, c->d) / along + 1) * 0.5f * end);
    }
    if (!near) continue;
    for (int axis_of_face = 0; axis_of_face < 2; ++axis_of_face) {
      cut_polygon(p, axis_of_face, end, inside, outside);
      cut_polygon(inside, axis_of_face, 0, outside, p);
    }
    if (p.count < 3) continue;
    int first[2], last[2];
    for (int a = 0; a < 2; ++a) {
      const auto [least, most] = std::minmax_element(p.at[a], p.at[a] + p.count);
      first[a] = std::clamp(int(*least), 0, size - 1), last[a] = std::clamp(int(*most), 0, size - 1);
    }
    cut_along_grid(size, f, p, first[0], last[0], first[1], last[1], out);
  }
}

// The parts of the texel between these corners of the map, in order around it; their solid angles are to scale.
inline void cut_texel(int size, const CubeCorner* const (&corners)[4], CubeParts& out) {
  const CubeCorner &a = *corners[0], &b = *corners[1], &c = *corners[2], &d = *corners[3];
  out.count = 0, out.total = 0;
  if (a.face != b.face || a.face != c.face || a.face != d.face) {
    cut_over_edges(size, corners, out);
  } else {
    const auto [first_column, last_column] = std::minmax({a.column, b.column, c.column, d.column});
    const auto [first_row, last_row] = std::minmax({a.row, b.row, c.row, d.row});
    if (first_column != last_column || first_row != last_row) {
      FacePolygon p;
      for (const CubeCorner* corner : corners) p.add(0, corner->at.x, corner->at.y);
      cut_along_grid(size, a.face, p, first_column, last_column, first_row, last_row, out);
    }
  }
  if (out.count > 0) return;
  // Within one texel of the cube, or too thin for floats to have an area.
  out.at[out.count++] = {a.face, a.column, a.row, 1, 0.25f * (a.d + b.d + c.d + d.d)};
  out.total = 1;
}

}  // namespace lambent

#include <lambent/core/parallel.h>
#include <lambent/light/cube_parts.h>
#include <lambent/light/environment.h>
#include <lambent/light/sphere_map.h>

#include <array>

namespace lambent {
namespace {

// Where a face (of cube_point's, which are OpenGL's) lies in the picture, in faces, and along which axes it is flipped.
struct Cell {
  int x, y;
  bool flip_x = false, flip_y = false;
};

struct CubeLayout {
  int columns, rows;
  bool turned_z;  // their +Z is our -Z
  std::array<Cell, 6> faces;
};

CubeLayout layout_of(SphereMap map) {
  switch (map) {
    case SphereMap::horizontal_cross: return {4, 3, true, {{{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {3, 1}}}};
    case SphereMap::vertical_cross: return {3, 4, true, {{{2, 1}, {0, 1}, {1, 0}, {1, 2}, {1, 1}, {1, 3, true, true}}}};
    case SphereMap::row: return {6, 1, true, {{{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}, {5, 0}}}};
    case SphereMap::column: return {1, 6, true, {{{0, 0}, {0, 1}, {0, 2}, {0, 3}, {0, 4}, {0, 5}}}};
    default:  // OpenEXR's, seen from within: OpenGL's mirrored
      return {1,
              6,
              false,
              {{{0, 0, true, false},
                {0, 1, true, false},
                {0, 2, false, true},
                {0, 3, false, true},
                {0, 4, true, false},
                {0, 5, true, false}}}};
  }
}

// Moves every column to the right by a quarter of the width; where that is no whole number, texels are cut.
Image turned_by_a_quarter(const Image& image) {
  const int whole = image.width / 4;
  const float part = float(image.width % 4) / 4;
  Image out(image.width, image.height);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Vec3& near = image.at((x + image.width - whole) % image.width, y);
      if (part == 0) out.at(x, y) = near;
      else out.at(x, y) = (1 - part) * near + part * image.at((x + 2 * image.width - whole - 1) % image.width, y);
    }
  return out;
}

Image latlong_of_cube(const Image& image, const CubeLayout& layout) {
  const int size = image.width / layout.columns, height = std::clamp(2 * size, 64, 8192), width = 2 * height;
  const Vec3 axes(1, 1, layout.turned_z ? -1.0f : 1.0f);
  const auto pixel = [&](const CubePart& part) {
    const Cell& cell = layout.faces[size_t(part.face)];
    return image.at(cell.x * size + (cell.flip_x ? size - 1 - part.column : part.column),
                    cell.y * size + (cell.flip_y ? size - 1 - part.row : part.row));
  };
  Image out(width, height);
  parallel_for(size_t(height), 8, [&](size_t begin, size_t end) {
    CubeParts parts;
    std::vector<CubeCorner> above(size_t(width) + 1), below(size_t(width) + 1);
    const auto set_corners = [&](size_t row, std::vector<CubeCorner>& corners) {
      for (size_t x = 0; x < corners.size(); ++x)
        corners[x] = cube_corner(size, axes * latlong_direction({float(x) / float(width), float(row) / float(height)}));
    };
    set_corners(begin, below);
    for (size_t y = begin; y < end; ++y) {
      std::swap(above, below);
      set_corners(y + 1, below);
      for (size_t x = 0; x < size_t(width); ++x) {
        cut_texel(size, {&above[x], &above[x + 1], &below[x + 1], &below[x]}, parts);
        Vec3 sum(0);
        for (int k = 0; k < parts.count; ++k) sum += parts.at[k].solid_angle / parts.total * pixel(parts.at[k]);
        out.at(int(x), int(y)) = sum;
      }
    }
  });
  return out;
}

}  // namespace

Result<SphereMap> sphere_map_of(int width, int height, Envmap envmap, const std::string& path) {
  const int64_t w = width, h = height;
  const bool latlong = std::abs(w - 2 * h) <= 1;
  const std::string size = std::to_string(w) + " x " + std::to_string(h);
  if (envmap == Envmap::cube) {
    if (h == 6 * w) return SphereMap::exr_cube;
    return Error{path, "is a cube map by its envmap attribute, whose faces stand in a column of 1:6, not " + size};
  }
  if (latlong) return envmap == Envmap::latlong ? SphereMap::exr_latlong : SphereMap::latlong;
  if (envmap == Envmap::latlong)
    return Error{path, "is a lat-long map by its envmap attribute, which is twice as wide as high, not " + size};
  if (w == 6 * h) return SphereMap::row;
  if (h == 6 * w) return SphereMap::column;
  if (3 * w == 4 * h) return SphereMap::horizontal_cross;
  if (4 * w == 3 * h) return SphereMap::vertical_cross;
  return Error{path, "a picture of " + size +
                         " is no map of the whole sphere: 2:1 is a lat-long map, 4:3 and 3:4 are " +
                         "crosses and 6:1 and 1:6 strips of cube maps; a part of a panorama needs black where it ends"};
}

Image latlong_of(Image image, SphereMap map) {
  if (map == SphereMap::latlong) return image;
  if (map == SphereMap::exr_latlong) return turned_by_a_quarter(image);
  return latlong_of_cube(image, layout_of(map));
}

}  // namespace lambent

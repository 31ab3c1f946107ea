// Follows: locally-adaptive-products, section 4 (cubemap texels weighted by their solid angles).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/cube_parts.h>

#include <algorithm>
#include <numbers>

namespace lambent {
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
      CubeParts parts;
      std::vector<CubeCorner> above(size_t(fine_w) + 1), below(size_t(fine_w) + 1);
      auto set_corners = [&](int row, std::vector<CubeCorner>& corners) {
        const double theta = std::numbers::pi * row / fine_h;
        const float sine = float(std::sin(theta));
        const Vec3 up = float(std::cos(theta)) * rotation[1];
        for (size_t x = 0; x < corners.size(); ++x) corners[x] = cube_corner(size, sine * meridians[x] + up);
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
          cut_texel(size, {&above[i], &above[i + 1], &below[i + 1], &below[i]}, parts);
          const float scale = solid_angle / parts.total, channels = radiance.x + radiance.y + radiance.z;
          for (int k = 0; k < parts.count; ++k) {
            const CubePart& part = parts.at[k];
            const float share = part.solid_angle * scale;
            Sum& of = sum[cube_texel(size, part.face, part.column, part.row)];
            of.energy += share * radiance;
            of.moment += share * channels * part.direction;
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

// Follows: locally-adaptive-products, section 4 (cubemap texels weighted by their solid angles).
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/cube_cut.h>
#include <lambent/light/cube_light.h>

#include <algorithm>
#include <numbers>

namespace lambent {
CubeLight cube_light(const Environment& env, int size, const Mat3& rotation) {
  LAMBENT_CHECK(is_cube_size(size));
  // Texels of the map are cut so small that the arcs of their parallels are straight.
  const int w = env.image.width, h = env.image.height, split = std::max(1, (4 * size + w - 1) / w);
  const int fine_w = w * split, fine_h = h * split;
  constexpr size_t pieces = 4;  // whose sums are added in order, so that the result does not depend on threads
  std::vector<AlignedVector<CubeSum>> sums(pieces);
  DirectionArray meridians;  // on the equator, turned; and copies of the last for whole lanes
  const size_t padded = (size_t(fine_w) + 1 + 16 + 15) / 16 * 16;
  for (size_t x = 0; x < padded; ++x)
    meridians.push(rotation * latlong_direction(Vec2(float(std::min(x, size_t(fine_w))) / float(fine_w), 0.5f)));
  parallel_for(pieces, 1, [&](size_t begin, size_t end) {
    for (size_t piece = begin; piece < end; ++piece) {
      AlignedVector<CubeSum>& sum = sums[piece];
      sum.assign(cube_texels(size), CubeSum{});
      CornerRow above, below;
      above.resize(padded), below.resize(padded);
      auto set_corners = [&](int row, CornerRow& corners) {
        const double theta = std::numbers::pi * row / fine_h;
        const float sine = float(std::sin(theta));
        const Vec3 up = float(std::cos(theta)) * rotation[1];
        for (size_t x = 0; x < padded; ++x)
          corners.x[x] = sine * meridians.x[x] + up.x, corners.y[x] = sine * meridians.y[x] + up.y,
          corners.z[x] = sine * meridians.z[x] + up.z;
        place_corners(size, padded, corners);
      };
      const int first = int(size_t(fine_h) * piece / pieces), last = int(size_t(fine_h) * (piece + 1) / pieces);
      if (first < last) set_corners(first, below);
      for (int y = first; y < last; ++y) {
        std::swap(above, below);
        set_corners(y + 1, below);
        add_texels(size, above, below, &env.image.at(0, y / split), split, fine_w,
                   float(texel_solid_angle(y, fine_w, fine_h)), sum.data());
      }
    }
  });
  CubeLight light{size, std::vector<Vec3>(cube_texels(size)), std::vector<Vec3>(cube_texels(size))};
  parallel_for(size_t(6 * size), 16, [&](size_t begin, size_t end) {
    for (size_t line = begin; line < end; ++line)
      for (int column = 0; column < size; ++column) {
        const int face = int(line) / size, row = int(line) % size;
        const size_t t = cube_texel(size, face, column, row);
        Vec3 energy(0), moment(0);
        for (const AlignedVector<CubeSum>& sum : sums)
          for (int c = 0; c < 3; ++c) energy[size_t(c)] += sum[t].energy[c], moment[size_t(c)] += sum[t].moment[c];
        const auto place = [&](int k) { return (2 * float(k) + 1) / float(size) - 1; };
        light.energy[t] = energy;
        light.direction[t] = normalize_or(moment, normalize(cube_point(face, place(column), place(row))));
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

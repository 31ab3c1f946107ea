#include <lambent/bake/directions.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>

#include <algorithm>

namespace lambent {
namespace {

uint32_t morton2(Vec2 u) {
  auto spread = [](float x) {
    uint32_t v = uint32_t(x * 65536.0f);
    v = (v | v << 8) & 0x00ff00ffu;
    v = (v | v << 4) & 0x0f0f0f0fu;
    v = (v | v << 2) & 0x33333333u;
    return (v | v << 1) & 0x55555555u;
  };
  return spread(u.x) | spread(u.y) << 1;
}

// Fills in `excess`; `table` and `weights` are there.
void measure_excess(DirectionSets& s) {
  const size_t coefficients = size_t(sh_count(s.order)), n = size_t(s.samples);
  s.excess.assign(size_t(s.sets) * 2 * coefficients, 0);
  for (size_t set = 0; set < size_t(s.sets); ++set)
    for (size_t k = 0; k < coefficients; ++k) {
      const int l = sh_band(int(k));
      // About +z, the axis of the cosine, only the middle of a band is not zero.
      const double open = int(k) == l * l + l
                            ? clamped_cosine(l) / std::numbers::pi * std::sqrt((2 * l + 1) / (4 * std::numbers::pi))
                            : 0;
      const float* y = s.table.data() + (set * coefficients + k) * s.stride;
      double sum = 0, first = 0;
      for (size_t i = 0; i < n; ++i) {
        sum += double(y[i]) * (s.weights.empty() ? 1.0 : double(s.weights[i]));
        if (i + 1 == std::min(s.half, n)) first = sum;
      }
      s.excess[set * 2 * coefficients + k] = float(sum / double(n) - open);
      s.excess[(set * 2 + 1) * coefficients + k] = float(first / double(std::min(s.half, n)) - open);
    }
}

}  // namespace

FixedFan::FixedFan(Vec3 normal) {
  const Mat3 frame = frame_about(normal);
  for (size_t k = 0; k < count; ++k) {
    const Vec3 d = frame * square_to_cosine_hemisphere(sobol_owen(uint32_t(k), 0));
    x[k] = d.x, y[k] = d.y, z[k] = d.z;
  }
}

std::vector<Vec2> sorted_points(size_t count, size_t half, uint32_t key) {
  std::vector<Vec2> points(count);
  for (size_t i = 0; i < count; ++i) points[i] = sobol_owen(uint32_t(i), key);
  auto along_curve = [](Vec2 a, Vec2 b) { return morton2(a) < morton2(b); };
  std::sort(points.begin(), points.begin() + ptrdiff_t(half), along_curve);
  std::sort(points.begin() + ptrdiff_t(half), points.end(), along_curve);
  return points;
}

DirectionSets make_direction_sets(int order, int samples, int sets, uint32_t seed, DirectionWarp warp,
                                  Progress* progress) {
  DirectionSets s{order, samples, sets, pad_lanes(size_t(samples)), 0, {}, {}, {}, {}, {}};
  const size_t n = size_t(samples), coefficients = size_t(sh_count(order));
  s.half = n >= 2 * lane_multiple ? pad_lanes(n / 2) : n;
  s.x.assign(s.stride * size_t(sets), 0), s.y = s.x, s.z.assign(s.stride * size_t(sets), 1);
  s.table.assign(s.stride * size_t(sets) * coefficients, 0);
  constexpr size_t piece = 4096;
  ProgressStage stage(progress, "directions", size_t(sets) * n);
  parallel_for(size_t(sets), 1, [&](size_t set, size_t) {
    if (stage.cancelled()) return;
    float y[sh_count(max_sh_order)];
    const std::vector<Vec2> points = sorted_points(n, s.half, uint32_t(hash64(seed, uint64_t(set))));
    const size_t base = set * s.stride;
    for (size_t i = 0; i < n; ++i) {
      if (i % piece == 0) {
        if (stage.cancelled()) return;
        stage.advance(std::min(piece, n - i));
      }
      const Vec3 d = warp(points[i]);
      s.x[base + i] = d.x, s.y[base + i] = d.y, s.z[base + i] = d.z;
      evaluate_sh(order, d, y);
      for (size_t k = 0; k < coefficients; ++k) s.table[(set * coefficients + k) * s.stride + i] = y[k];
    }
  });
  if (warp == square_to_cosine_hemisphere && !stage.cancelled()) measure_excess(s);
  return s;
}

DirectionSets make_hemicube_set(int order, int samples) {
  const int n = 2 * std::max(1, int(std::lround(std::sqrt(double(samples) / 3) / 2)));
  struct Pixel {
    Vec3 direction;
    double form_factor;
  };
  std::vector<Pixel> pixels;
  // Integrals of cos / pi per solid angle over [0, a] x [0, b] of the top face, z = 1, and of a side, x = 1, from its
  // foot up.
  auto top = [](double a, double b) {
    const double p = std::sqrt(1 + a * a), q = std::sqrt(1 + b * b);
    return (a / p * std::atan(b / p) + b / q * std::atan(a / q)) / (2 * std::numbers::pi);
  };
  auto side = [](double y, double z) {
    const double q = std::sqrt(1 + z * z);
    return (std::atan(y) - std::atan(y / q) / q) / (2 * std::numbers::pi);
  };
  auto over_pixel = [](auto f, double a0, double a1, double b0, double b1) {
    return f(a1, b1) - f(a0, b1) - f(a1, b0) + f(a0, b0);
  };
  auto edge = [&](int i) { return 2.0 * i / n - 1; };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const double x0 = edge(i), x1 = edge(i + 1), y0 = edge(j), y1 = edge(j + 1);
      pixels.push_back({normalize(Vec3(float(x0 + x1) / 2, float(y0 + y1) / 2, 1)), over_pixel(top, x0, x1, y0, y1)});
    }
  for (int face = 0; face < 4; ++face)
    for (int j = n / 2; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const double y0 = edge(i), y1 = edge(i + 1), z0 = edge(j), z1 = edge(j + 1);
        const Vec3 d = normalize(Vec3(1, float(y0 + y1) / 2, float(z0 + z1) / 2));
        const Vec3 turned[4] = {d, {-d.y, d.x, d.z}, {-d.x, -d.y, d.z}, {d.y, -d.x, d.z}};
        pixels.push_back({turned[face], over_pixel(side, y0, y1, z0, z1)});
      }
  const size_t count = pixels.size(), coefficients = size_t(sh_count(order));
  DirectionSets s{.order = order, .samples = int(count), .sets = 1, .stride = pad_lanes(count), .half = count};
  s.x.assign(s.stride, 0), s.y = s.x, s.z.assign(s.stride, 1), s.table.assign(s.stride * coefficients, 0);
  float y[sh_count(max_sh_order)];
  for (size_t i = 0; i < count; ++i) {
    const Vec3 d = pixels[i].direction;
    s.x[i] = d.x, s.y[i] = d.y, s.z[i] = d.z;
    s.weights.push_back(float(pixels[i].form_factor * double(count)));
    evaluate_sh(order, d, y);
    for (size_t k = 0; k < coefficients; ++k) s.table[k * s.stride + i] = y[k];
  }
  measure_excess(s);
  return s;
}

DirectionChoice choose_directions(const DirectionSets& sets, Vec3 n, uint32_t seed, size_t receiver) {
  const uint64_t bits = hash64(hash64(seed, 0x5e7), receiver);
  DirectionChoice choice;
  choice.set = int(bits % uint64_t(sets.sets));
  // The rotation is built from the same angles that turn the harmonics, so both agree to rounding.
  const float sin_b = std::sqrt(n.x * n.x + n.y * n.y);
  choice.a = sin_b > 0 ? std::atan2(n.y, n.x) : 0.0f;
  choice.b = std::atan2(sin_b, n.z);
  choice.c = 2 * pi * to_unit_float(uint32_t(bits >> 32));
  auto turn_z = [](float t) {
    return Mat3(Vec3(std::cos(t), std::sin(t), 0), Vec3(-std::sin(t), std::cos(t), 0), Vec3(0, 0, 1));
  };
  const Mat3 turn_y(Vec3(std::cos(choice.b), 0, -std::sin(choice.b)), Vec3(0, 1, 0),
                    Vec3(std::sin(choice.b), 0, std::cos(choice.b)));
  choice.rotation = turn_z(choice.a) * turn_y * turn_z(choice.c);
  return choice;
}

}  // namespace lambent

#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/environment.h>

#include <cstdio>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;

// Index of the cell of [0, 1] that x falls in; also for x at the ends or beyond, and NaN.
int cell(float x, int count) {
  float scaled = x * float(count);
  return scaled > 0 ? int(std::min(scaled, float(count - 1))) : 0;
}

// Integral of the direction over a texel, without the factor of the azimuth: (equatorial, vertical) for rows y.
Vec2d row_moments(int y, int height) {
  double top = pi_d * y / height, bottom = pi_d * (y + 1) / height;
  auto equatorial = [](double t) { return 0.5 * (t - std::sin(t) * std::cos(t)); };  // of sin^2
  return {equatorial(bottom) - equatorial(top),
          0.5 * (std::cos(top) * std::cos(top) - std::cos(bottom) * std::cos(bottom))};
}

}  // namespace

namespace {

std::string pixels_with(size_t count, const char* what) {
  return std::to_string(count) + (count == 1 ? " pixel" : " pixels") + " with a channel that is " + what;
}

std::string number_text(float value) {
  char text[32];  // not std::to_chars, which the C++ library of WebAssembly has for integers alone
  return {text, size_t(std::snprintf(text, sizeof text, "%.6g", double(value)))};
}

bool has_nan(const Vec3& c) { return std::isnan(c.x) || std::isnan(c.y) || std::isnan(c.z); }

// Calls f(index) for the up to eight texels around texel i of a map that closes around.
template <class F>
void around(const Image& image, size_t i, F&& f) {
  const int w = image.width, x = int(i % size_t(w)), y = int(i / size_t(w));
  for (int v = std::max(0, y - 1); v <= std::min(image.height - 1, y + 1); ++v)
    for (int u : {x == 0 ? w - 1 : x - 1, x, x + 1 == w ? 0 : x + 1}) {
      const size_t j = size_t(v) * size_t(w) + size_t(u);
      if (j != i) f(j);
    }
}

}  // namespace

void clamp_radiance(Image& image, float largest, std::vector<std::string>& warnings) {
  size_t negative = 0, infinite = 0, missing = 0;
  float most = 0;
  for (const Vec3& c : image.rgb) {
    bool below = false, beyond = false;
    for (int k = 0; k < 3; ++k) {
      below |= c[k] < 0, beyond |= std::isinf(c[k]) && c[k] > 0;
      if (std::isfinite(c[k])) most = std::max(most, c[k]);
    }
    negative += below, infinite += beyond, missing += has_nan(c);
  }
  if (negative + infinite + missing == 0) return;
  constexpr float half_max = 65504;
  const float stand_in = largest > 0 ? largest : most > 0 ? most : half_max;
  for (Vec3& c : image.rgb)
    for (int k = 0; k < 3; ++k)
      if (c[k] < 0) c[k] = 0;
      else if (std::isinf(c[k])) c[k] = stand_in;
  if (negative > 0) warnings.push_back(pixels_with(negative, "negative: taken as 0"));
  if (infinite > 0)
    warnings.push_back(pixels_with(infinite, "infinite: taken as ") + number_text(stand_in) +
                       (largest > 0 ? ", the largest that its half floats hold" : ", the largest of the others"));
  if (missing > 0) warnings.push_back(pixels_with(missing, "not a number: taken as the mean of their neighbours"));
}

void fill_missing(Image& image) {
  // Layer by layer from what is known: a texel takes the mean of its neighbours of earlier layers.
  enum State : uint8_t { known, missing, queued };
  std::vector<uint8_t> state;
  std::vector<size_t> layer, next;
  for (size_t i = 0; i < image.rgb.size(); ++i)
    if (has_nan(image.rgb[i])) {
      if (state.empty()) state.resize(image.rgb.size(), known);
      state[i] = missing;
    }
  if (state.empty()) return;
  for (size_t i = 0; i < state.size(); ++i)
    if (state[i] == missing) {
      bool edge = false;
      around(image, i, [&](size_t j) { edge |= state[j] == known; });
      if (edge) layer.push_back(i);
    }
  for (size_t i : layer) state[i] = queued;
  while (!layer.empty()) {
    for (size_t i : layer) {
      Vec3d sum(0);
      int count = 0;
      around(image, i, [&](size_t j) {
        if (state[j] == known) sum += Vec3d(image.rgb[j]), ++count;
      });
      for (int k = 0; k < 3; ++k)
        if (std::isnan(image.rgb[i][k])) image.rgb[i][k] = float(sum[k] / count);
    }
    for (size_t i : layer) state[i] = known;
    next.clear();
    for (size_t i : layer)
      around(image, i, [&](size_t j) {
        if (state[j] == missing) state[j] = queued, next.push_back(j);
      });
    std::swap(layer, next);
  }
  for (Vec3& c : image.rgb)
    if (has_nan(c)) c = Vec3(0);  // all of it
}

Result<Environment> environment_from_image(std::string name, Image image) {
  LAMBENT_CHECK(image.width > 0 && image.height > 0);
  if (std::abs(image.width - 2 * int64_t(image.height)) > 1)
    return Error{name, "a lat-long map is twice as wide as high, not " + std::to_string(image.width) + " x " +
                           std::to_string(image.height)};
  Environment env;
  env.name = std::move(name), env.image = std::move(image), env.image.alpha.clear();
  clamp_radiance(env.image, 0, env.warnings);
  fill_missing(env.image);
  return env;
}

Vec3 latlong_direction(Vec2 uv) {
  double phi = 2 * pi_d * (double(uv.x) - 0.5), theta = pi_d * double(uv.y), s = std::sin(theta);
  return Vec3(s * std::cos(phi), std::cos(theta), s * std::sin(phi));
}

Vec3 texel_direction(int x, int y, int width, int height) {
  double phi = 2 * pi_d * ((x + 0.5) / width - 0.5), theta = pi_d * (y + 0.5) / height, s = std::sin(theta);
  return Vec3(s * std::cos(phi), std::cos(theta), s * std::sin(phi));
}

Vec2 latlong_uv(Vec3 d) {
  // The angle from +Y by atan2: as acos(y) for unit vectors, but exact near the poles and fearless of |y| > 1.
  float u = 0.5f + std::atan2(d.z, d.x) / (2 * pi), v = std::atan2(std::hypot(d.x, d.z), d.y) / pi;
  if (!is_finite(d) || d == Vec3(0)) return Vec2(0.5f);
  return {std::clamp(u, 0.0f, 1.0f), std::clamp(v, 0.0f, 1.0f)};
}

double texel_solid_angle(int y, int width, int height) {
  // cos a - cos b = 2 sin((a + b) / 2) sin((b - a) / 2), without cancellation near the poles
  return 2 * pi_d / width * 2 * std::sin(pi_d * (y + 0.5) / height) * std::sin(0.5 * pi_d / height);
}

Vec3d texel_moment(int x, int y, int width, int height) {
  const Vec2d moments = row_moments(y, height);
  const double phi = 2 * pi_d * ((x + 0.5) / width - 0.5), column = 2 * std::sin(pi_d / width);
  return {moments.x * column * std::cos(phi), 2 * pi_d / width * moments.y, moments.x * column * std::sin(phi)};
}

Vec3 radiance(const Environment& env, Vec3 d) {
  Vec2 uv = latlong_uv(d);
  return env.image.at(cell(uv.x, env.image.width), cell(uv.y, env.image.height));
}

Vec3 radiance_bilinear(const Environment& env, Vec3 d) {
  const Image& image = env.image;
  Vec2 uv = latlong_uv(d);
  float x = uv.x * float(image.width) - 0.5f, y = uv.y * float(image.height) - 0.5f;
  float fx = std::floor(x), fy = std::floor(y);
  float wx = x - fx, wy = y - fy;
  int x0 = int(fx) < 0 ? image.width - 1 : std::min(int(fx), image.width - 1), x1 = (x0 + 1) % image.width;
  int y0 = std::clamp(int(fy), 0, image.height - 1), y1 = std::clamp(int(fy) + 1, 0, image.height - 1);
  Vec3 top = image.at(x0, y0) * (1 - wx) + image.at(x1, y0) * wx,
       bottom = image.at(x0, y1) * (1 - wx) + image.at(x1, y1) * wx;
  return top * (1 - wy) + bottom * wy;
}

Environment rotated(const Environment& env, const Mat3& R, int supersample) {
  LAMBENT_CHECK(supersample >= 1);
  Environment out;
  int width = env.image.width, height = env.image.height;
  out.name = env.name, out.warnings = env.warnings, out.image = Image(width, height);
  Mat3 inverse = transpose(R);
  parallel_for(size_t(height), 4, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      double top = std::cos(pi_d * double(row) / height), bottom = std::cos(pi_d * double(row + 1) / height);
      for (int x = 0; x < width; ++x) {
        Vec3d sum(0);
        for (int j = 0; j < supersample; ++j) {
          double c = top + (bottom - top) * (j + 0.5) / supersample, s = std::sqrt(std::max(0.0, 1 - c * c));
          for (int i = 0; i < supersample; ++i) {
            double phi = 2 * pi_d * ((x + (i + 0.5) / supersample) / width - 0.5);
            sum += Vec3d(radiance(env, inverse * Vec3(s * std::cos(phi), c, s * std::sin(phi))));
          }
        }
        out.image.at(x, int(row)) = Vec3(sum / double(supersample * supersample));
      }
    }
  });
  return out;
}

Environment make_environment(std::string name, int width, int height, const std::function<Vec3(Vec3)>& f) {
  LAMBENT_CHECK(width > 0 && height > 0);
  Environment env;
  env.name = std::move(name), env.image = Image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) env.image.at(x, y) = f(texel_direction(x, y, width, height));
  return env;
}

Vec3 irradiance(const Environment& env, Vec3 n) {
  int width = env.image.width, height = env.image.height;
  // Integral of cos(phi) or sin(phi) over a column: its centre's value times this.
  double column = 2 * std::sin(pi_d / width);
  std::vector<Vec2d> columns;
  for (int x = 0; x < width; ++x) {
    double phi = 2 * pi_d * ((x + 0.5) / width - 0.5);
    columns.push_back(column * Vec2d(std::cos(phi), std::sin(phi)));
  }
  Vec3d sum(0);
  for (int y = 0; y < height; ++y) {
    Vec2d moments = row_moments(y, height);
    double vertical = 2 * pi_d / width * moments.y * double(n.y);
    for (int x = 0; x < width; ++x) {
      const Vec2d& c = columns[size_t(x)];
      double cosine = vertical + moments.x * (double(n.x) * c.x + double(n.z) * c.y);
      if (cosine > 0) sum += cosine * Vec3d(env.image.at(x, y));
    }
  }
  return Vec3(sum);
}

}  // namespace lambent

// Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild 2020: "FLIP: a difference evaluator for alternating
// images". Contrast sensitivity: Johnson and Fairchild 2003. HyAB: Abasi et al. 2020. All its two-dimensional filters
// are products, or sums of two products, of one-dimensional ones, which is how they are applied here.
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/image/compare.h>

#include <array>

namespace lambent {
namespace {

constexpr size_t rows_a_piece = 16;

struct Plane {
  int width = 0, height = 0;
  std::vector<float> values;
  Plane(int w, int h) : width(w), height(h), values(size_t(w) * size_t(h)) {}
  float* row(int y) { return values.data() + size_t(y) * size_t(width); }
  const float* row(int y) const { return values.data() + size_t(y) * size_t(width); }
};

using Kernel = std::vector<float>;  // odd length, centred

// Correlation along rows; pixels beyond the edge repeat the edge.
Plane filter_rows(const Plane& in, const Kernel& kernel) {
  Plane out(in.width, in.height);
  size_t radius = kernel.size() / 2, width = size_t(in.width);
  parallel_for(size_t(in.height), rows_a_piece, [&](size_t begin, size_t end) {
    std::vector<float> padded(width + 2 * radius);
    for (size_t y = begin; y < end; ++y) {
      const float* from = in.row(int(y));
      float* to = out.row(int(y));
      std::fill_n(padded.begin(), radius, from[0]);
      std::copy_n(from, width, padded.begin() + ptrdiff_t(radius));
      std::fill_n(padded.begin() + ptrdiff_t(radius + width), radius, from[width - 1]);
      for (size_t k = 0; k < kernel.size(); ++k)
        for (size_t x = 0; x < width; ++x) to[x] += kernel[k] * padded[x + k];
    }
  });
  return out;
}

Plane filter_columns(const Plane& in, const Kernel& kernel) {
  Plane out(in.width, in.height);
  int radius = int(kernel.size() / 2);
  parallel_for(size_t(in.height), rows_a_piece, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y) {
      float* to = out.row(int(y));
      for (int k = -radius; k <= radius; ++k) {
        const float* from = in.row(std::clamp(int(y) + k, 0, in.height - 1));
        float weight = kernel[size_t(k + radius)];
        for (int x = 0; x < in.width; ++x) to[x] += weight * from[x];
      }
    }
  });
  return out;
}

// Scales the positive weights to sum to 1 and the negative ones to -1.
Kernel normalized(Kernel kernel) {
  double positive = 0, negative = 0;
  for (float w : kernel) (w > 0 ? positive : negative) += w;
  for (float& w : kernel) w = float(w > 0 ? w / positive : negative < 0 ? w / -negative : w);
  return kernel;
}

template <class F>
Kernel make_kernel(int radius, F f) {
  Kernel kernel;
  for (int i = -radius; i <= radius; ++i) kernel.push_back(float(f(double(i))));
  return kernel;
}

// --- Colour spaces

// Rec. 709 to XYZ, rows X, Y, Z.
const Mat3d xyz_from_rgb = transpose(
    Mat3d(0.41239080, 0.35758434, 0.18048079, 0.21263901, 0.71516868, 0.07219232, 0.01933082, 0.11919478, 0.95053215));
const Mat3 relative_xyz_from_rgb = [] {  // white is (1, 1, 1)
  Vec3d white = xyz_from_rgb * Vec3d(1);
  return Mat3(Mat3d(1 / white.x, 0, 0, 0, 1 / white.y, 0, 0, 0, 1 / white.z) * xyz_from_rgb);
}();
const Mat3 rgb_from_relative_xyz = Mat3(inverse(Mat3d(relative_xyz_from_rgb)));

// A linear version of CIELAB: luminance, red-green, blue-yellow.
Vec3 ycxcz_from_xyz(Vec3 t) { return {116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)}; }
Vec3 xyz_from_ycxcz(Vec3 c) {
  float y = (c.x + 16) / 116;
  return {y + c.y / 500, y, y - c.z / 200};
}

Vec3 lab_from_xyz(Vec3 t) {
  constexpr float delta = 6 / 29.0f;
  auto f = [](float v) { return v > delta * delta * delta ? std::cbrt(v) : v / (3 * delta * delta) + 4 / 29.0f; };
  float fx = f(t.x), fy = f(t.y), fz = f(t.z);
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

// The Hunt effect: colours look more vivid when they are brighter.
Vec3 hunt_adjusted(Vec3 lab) { return {lab.x, 0.01f * lab.x * lab.y, 0.01f * lab.x * lab.z}; }

// --- The colour pipeline, section 4.1

struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity sensitivities[3] = {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};

// One channel as the eye resolves it: a sum of two Gaussians, normalised together.
Plane contrast_filtered(const Plane& in, const Sensitivity& s, float pixels_per_degree) {
  double pi2 = double(std::numbers::pi) * std::numbers::pi;
  double widest = 0;
  for (const Sensitivity& any : sensitivities) widest = std::max({widest, any.b1, any.b2});
  int radius = int(std::ceil(3 * std::sqrt(widest / (2 * pi2)) * double(pixels_per_degree)));
  struct Term {
    double weight;
    Kernel kernel;
  };
  std::vector<Term> terms;
  double total = 0;
  for (auto [a, b] : {std::pair{s.a1, s.b1}, std::pair{s.a2, s.b2}}) {
    if (a == 0) continue;
    double ppd = double(pixels_per_degree), sum = 0;
    Kernel g = make_kernel(radius, [&, b = b](double x) { return std::exp(-pi2 * (x / ppd) * (x / ppd) / b); });
    for (float w : g) sum += w;
    for (float& w : g) w = float(w / sum);
    double weight = a * std::sqrt(std::numbers::pi / b) * sum * sum;
    terms.push_back({weight, std::move(g)}), total += weight;
  }
  Plane out(in.width, in.height);
  for (const Term& term : terms) {
    Plane part = filter_columns(filter_rows(in, term.kernel), term.kernel);
    float weight = float(term.weight / total);
    for (size_t i = 0; i < out.values.size(); ++i) out.values[i] += weight * part.values[i];
  }
  return out;
}

struct Prepared {
  std::vector<Vec3> lab;           // filtered, Hunt-adjusted
  std::vector<float> edge, point;  // feature strengths
};

// --- The feature pipeline, section 4.2: sizes of the first and second Gaussian derivatives of luminance

std::vector<float> feature(const Plane& luminance, const Kernel& derivative, const Kernel& smooth) {
  Plane x = filter_columns(filter_rows(luminance, derivative), smooth);
  Plane y = filter_columns(filter_rows(luminance, smooth), derivative);
  for (size_t i = 0; i < x.values.size(); ++i)
    x.values[i] = std::sqrt(x.values[i] * x.values[i] + y.values[i] * y.values[i]);
  return std::move(x.values);
}

Prepared prepare(const Image& displayed, float pixels_per_degree) {
  int width = displayed.width, height = displayed.height;
  std::array<Plane, 3> channels{Plane(width, height), Plane(width, height), Plane(width, height)};
  parallel_for(displayed.rgb.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Vec3 c = displayed.rgb[i];
      Vec3 linear(srgb_decode(c.x), srgb_decode(c.y), srgb_decode(c.z));
      Vec3 opponent = ycxcz_from_xyz(relative_xyz_from_rgb * linear);
      for (int k = 0; k < 3; ++k) channels[size_t(k)].values[i] = opponent[k];
    }
  });
  Plane luminance(width, height);
  for (size_t i = 0; i < luminance.values.size(); ++i) luminance.values[i] = (channels[0].values[i] + 16) / 116;

  Prepared out;
  double sigma = 0.5 * 0.082 * double(pixels_per_degree);  // w = 0.082 degrees: the width of the detectors
  int radius = int(std::ceil(3 * sigma));
  auto gauss = [sigma](double x) { return std::exp(-x * x / (2 * sigma * sigma)); };
  Kernel smooth = normalized(make_kernel(radius, gauss));
  out.edge = feature(luminance, normalized(make_kernel(radius, [&](double x) { return -x * gauss(x); })), smooth);
  out.point = feature(
      luminance, normalized(make_kernel(radius, [&](double x) { return (x * x / (sigma * sigma) - 1) * gauss(x); })),
      smooth);

  for (size_t k = 0; k < 3; ++k) channels[k] = contrast_filtered(channels[k], sensitivities[k], pixels_per_degree);
  out.lab.resize(displayed.rgb.size());
  parallel_for(out.lab.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Vec3 opponent(channels[0].values[i], channels[1].values[i], channels[2].values[i]);
      Vec3 linear = clamp(rgb_from_relative_xyz * xyz_from_ycxcz(opponent), Vec3(0), Vec3(1));
      out.lab[i] = hunt_adjusted(cielab(linear));
    }
  });
  return out;
}

}  // namespace

Vec3 cielab(Vec3 linear) { return lab_from_xyz(relative_xyz_from_rgb * linear); }

float hyab(Vec3 lab_a, Vec3 lab_b) {
  Vec3 d = lab_a - lab_b;
  return std::abs(d.x) + std::sqrt(d.y * d.y + d.z * d.z);
}

std::vector<float> flip_map(const Image& reference, const Image& test, float pixels_per_degree) {
  LAMBENT_CHECK(reference.width == test.width && reference.height == test.height && reference.width > 0 &&
                reference.height > 0);
  LAMBENT_CHECK(reference.rgb.size() == test.rgb.size() && pixels_per_degree > 0);
  constexpr float qc = 0.7f, pc = 0.4f, pt = 0.95f, qf = 0.5f;
  Prepared a = prepare(reference, pixels_per_degree), b = prepare(test, pixels_per_degree);
  // The largest error there is, between the primaries green and blue.
  const float cmax = std::pow(hyab(hunt_adjusted(cielab({0, 1, 0})), hunt_adjusted(cielab({0, 0, 1}))), qc);
  std::vector<float> error(a.lab.size());
  parallel_for(error.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float color = std::pow(hyab(a.lab[i], b.lab[i]), qc);
      // Large differences all look large: [0, pc cmax] is stretched to [0, pt], the rest squeezed above it.
      float knee = pc * cmax;
      color = color < knee ? color * pt / knee : pt + (color - knee) / (cmax - knee) * (1 - pt);
      float feature = std::max(std::abs(a.edge[i] - b.edge[i]), std::abs(a.point[i] - b.point[i]));
      feature = std::pow(feature / std::numbers::sqrt2_v<float>, qf);
      error[i] = std::pow(std::clamp(color, 0.0f, 1.0f), 1 - std::clamp(feature, 0.0f, 1.0f));
    }
  });
  return error;
}

}  // namespace lambent

#include <lambent/core/check.h>
#include <lambent/image/compare.h>

#include <array>
#include <charconv>
#include <limits>

namespace lambent {
namespace {

constexpr float lit_luminance = 0.05f, black_part = 0.1f;
constexpr double slope_step = 0.01;

bool covered(const Image& image, size_t i) { return !image.alpha.empty() && image.alpha[i] > 0; }

std::string size_text(const Image& image) { return std::to_string(image.width) + " x " + std::to_string(image.height); }

std::string number_text(float value) {
  char text[32];
  auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 4).ptr;
  return {text, end};
}

void fill(Image& image, int x0, int y0, int width, int height, Vec3 color) {
  for (int y = std::max(y0, 0); y < std::min(y0 + height, image.height); ++y)
    for (int x = std::max(x0, 0); x < std::min(x0 + width, image.width); ++x) image.at(x, y) = color;
}

// The pixels that are compared.
Result<std::vector<size_t>> counted_pixels(const Image& a, const Image& b, bool all) {
  LAMBENT_CHECK(a.alpha.empty() || a.alpha.size() == a.rgb.size());
  LAMBENT_CHECK(b.alpha.empty() || b.alpha.size() == b.rgb.size());
  if (a.width != b.width || a.height != b.height)
    return Error{"", "pictures differ in size: " + size_text(a) + " and " + size_text(b)};
  const bool everywhere = all || (a.alpha.empty() && b.alpha.empty());
  std::vector<size_t> compared;
  for (size_t i = 0; i < a.rgb.size(); ++i) {
    if (!everywhere && !covered(a, i) && !covered(b, i)) continue;
    if (!is_finite(a.rgb[i]) || !is_finite(b.rgb[i]))
      return Error{"", "pixel (" + std::to_string(i % size_t(a.width)) + ", " + std::to_string(i / size_t(a.width)) +
                           ") of the " + (is_finite(a.rgb[i]) ? "second" : "first") + " picture is not finite"};
    compared.push_back(i);
  }
  if (compared.empty()) return Error{"", "no pixel is covered"};
  return compared;
}

Image mixed(const Image& a, const Image& b, double share) {
  Image out = a;
  for (size_t i = 0; i < out.rgb.size(); ++i) out.rgb[i] += float(share) * (b.rgb[i] - a.rgb[i]);
  return out;
}

double decibels(double square) {
  return square > 0 ? -10 * std::log10(square) : std::numeric_limits<double>::infinity();
}

}  // namespace

Result<ImageDifference> compare_images(const Image& a, const Image& b, const Display& display, bool all) {
  auto counted = counted_pixels(a, b, all);
  if (!counted) return counted.error();
  const std::vector<size_t>& compared = *counted;
  Image shown_a = displayed(a, display), shown_b = displayed(b, display);
  std::vector<float> flip = flip_map(shown_b, shown_a);
  ImageDifference out;
  out.pixels = compared.size();
  double squares = 0, relative = 0, shown_squares = 0;
  size_t lit = 0, black = 0;
  for (size_t i : compared) {
    for (int c = 0; c < 3; ++c) {
      double va = a.rgb[i][c], vb = b.rgb[i][c], d = va - vb,
             shown = double(shown_a.rgb[i][c]) - double(shown_b.rgb[i][c]);
      squares += d * d, relative += d * d / (vb * vb + 0.01), shown_squares += shown * shown;
    }
    const Vec3 shown = shown_b.rgb[i];
    if (luminance(Vec3(srgb_decode(shown.x), srgb_decode(shown.y), srgb_decode(shown.z))) > lit_luminance)
      ++lit, black += luminance(a.rgb[i]) < black_part * luminance(b.rgb[i]);
    out.flip += double(flip[i]);
    out.mean_a += double(luminance(a.rgb[i])), out.mean_b += double(luminance(b.rgb[i]));
  }
  out.black = lit ? double(black) / double(lit) : 0;
  double pixels = double(compared.size()), values = 3 * pixels;
  out.rmse = std::sqrt(squares / values), out.relative_mse = relative / values;
  out.psnr = decibels(shown_squares / values);
  out.flip /= pixels, out.mean_a /= pixels, out.mean_b /= pixels;
  return out;
}

Result<UnnoisyDifference> compare_to_two(const Image& a, const Image& b, const Image& c, const Display& display,
                                         bool all) {
  auto counted = counted_pixels(a, b, all);
  if (!counted) return counted.error();
  if (auto ok = counted_pixels(a, c, all); !ok) return ok.error();
  const Image shown_a = displayed(a, display), shown_b = displayed(b, display), shown_c = displayed(c, display);
  // A hundredth of the way to each.
  const Image near_b = displayed(mixed(a, b, slope_step), display),
              near_c = displayed(mixed(a, c, slope_step), display);
  const double pixels = double(counted->size());
  double sum = 0, squares = 0, noise = 0, sloped = 0;
  for (size_t i : *counted) {
    double product = 0;
    for (int k = 0; k < 3; ++k) {
      const double va = shown_a.rgb[i][k], vb = shown_b.rgb[i][k], vc = shown_c.rgb[i][k];
      product += (va - vb) * (va - vc) / 3, noise += (vb - vc) * (vb - vc) / 12;
      if (va > 0 && va < 1)
        sloped += (double(near_b.rgb[i][k]) - va) * (double(near_c.rgb[i][k]) - va) / (3 * slope_step * slope_step);
    }
    sum += product, squares += product * product;
  }
  const double mean = sum / pixels, within = 2 * std::sqrt(std::max(0.0, squares / pixels - mean * mean) / pixels);
  return UnnoisyDifference{decibels(mean), decibels(mean + within), decibels(mean - within), decibels(sloped / pixels),
                           decibels(noise / pixels)};
}

Image difference_picture(const Image& a, const Image& b, const Display& display, float white) {
  LAMBENT_CHECK(a.width == b.width && a.height == b.height && a.rgb.size() == b.rgb.size() && white > 0);
  Image shown_a = displayed(a, display), shown_b = displayed(b, display);
  int scale = a.width >= 256 ? 2 : 1, strip = 11 * scale;
  std::array<Image, 3> panels;
  for (Image& panel : panels) panel = Image(a.width, a.height + 2 * strip);
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      Vec3 va = shown_a.at(x, y), vb = shown_b.at(x, y), d = abs(va - vb);
      for (int c = 0; c < 3; ++c)
        panels[0].at(x, y + strip)[c] = srgb_decode(va[c]), panels[1].at(x, y + strip)[c] = srgb_decode(vb[c]);
      panels[2].at(x, y + strip) = false_color(std::max({d.x, d.y, d.z}) / white);
    }
  const Vec3 ink(1);
  const char* labels[] = {"A", "B", "|A - B|"};
  for (size_t i = 0; i < 3; ++i) draw_text(panels[i], 2 * scale, 2 * scale, labels[i], ink, scale);

  // 0 [bar] white
  std::string end = number_text(white);
  int top = a.height + strip + 2 * scale, left = 10 * scale, right = a.width - int(end.size() * 6 + 6) * scale;
  draw_text(panels[2], 2 * scale, top, "0", ink, scale);
  if (right > left) {
    for (int x = left; x < right; ++x)
      fill(panels[2], x, top, 1, 7 * scale, false_color((float(x - left) + 0.5f) / float(right - left)));
    for (int y : {top - scale, top + 7 * scale}) fill(panels[2], left, y, right - left, scale, Vec3(0.5f));
  }
  draw_text(panels[2], std::max(left, right + 2 * scale), top, end, ink, scale);
  return beside(panels);
}

}  // namespace lambent

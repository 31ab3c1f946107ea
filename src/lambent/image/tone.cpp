#include <lambent/core/check.h>
#include <lambent/image/image.h>
#include <lambent/image/tone.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace lambent {
namespace {

// Rows of matrices that act on columns.
Vec3 times(const float (&m)[9], Vec3 v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
          m[6] * v.x + m[7] * v.y + m[8] * v.z};
}

Vec3 clamped(Vec3 v) { return min(max(v, Vec3(0.0f)), Vec3(1.0f)); }

Vec3 aces(Vec3 c) {
  constexpr float in[] = {0.59719f, 0.35458f, 0.04823f, 0.07600f, 0.90834f, 0.01566f, 0.02840f, 0.13383f, 0.83777f};
  constexpr float out[] = {1.60475f,  -0.53108f, -0.07367f, -0.10208f, 1.10813f,
                           -0.00605f, -0.00327f, -0.07276f, 1.07602f};
  // Beyond 1e4 the curve is flat, and its squares would overflow.
  c = each(times(in, min(c * (1 / 0.6f), Vec3(1e4f))), [](float v) {
    return (v * (v + 0.0245786f) - 0.000090537f) / (v * (0.983729f * v + 0.4329510f) + 0.238081f);
  });
  return clamped(times(out, c));
}

Vec3 agx(Vec3 c) {
  constexpr float to_rec2020[] = {0.6274f, 0.3293f, 0.0433f, 0.0691f, 0.9195f, 0.0113f, 0.0164f, 0.0880f, 0.8956f};
  constexpr float from_rec2020[] = {1.6605f,  -0.5876f, -0.0728f, -0.1246f, 1.1329f,
                                    -0.0083f, -0.0182f, -0.1006f, 1.1187f};
  constexpr float inset[] = {0.856627153f, 0.0951212405f, 0.0482516061f, 0.137318973f, 0.761241991f,
                             0.101439036f, 0.111898213f,  0.0767994186f, 0.811302368f};
  constexpr float outset[] = {1.12710058f,    -0.110606643f, -0.0164939387f, -0.141329763f, 1.15782370f,
                              -0.0164939387f, -0.141329763f, -0.110606643f,  1.25193641f};
  // 10 stops below and 6.5 above a middle grey of 0.18.
  constexpr float darkest = -12.47393f, brightest = 4.026069f;
  c = each(times(inset, times(to_rec2020, c)), [](float v) {
    const float x = std::clamp((std::log2(std::max(v, 1e-10f)) - darkest) / (brightest - darkest), 0.0f, 1.0f);
    return ((((((15.5f * x - 40.14f) * x + 31.96f) * x - 6.868f) * x + 0.4298f) * x) + 0.1191f) * x - 0.00232f;
  });
  c = each(times(outset, c), [](float v) { return std::pow(std::max(v, 0.0f), 2.2f); });
  return clamped(times(from_rec2020, c));
}

Vec3 neutral(Vec3 c) {
  constexpr float start = 0.76f, desaturation = 0.15f, room = 1 - start;
  const float least = std::min({c.x, c.y, c.z});
  c -= Vec3(least < 0.08f ? least - 6.25f * least * least : 0.04f);
  const float peak = std::max({c.x, c.y, c.z});
  if (peak < start) return c;
  const float lowered = 1 - room * room / (peak + room - start);
  const float white = 1 - 1 / (desaturation * (peak - lowered) + 1);
  return (1 - white) * (c * (lowered / peak)) + Vec3(white * lowered);
}

// How much of pixel i surfaces cover.
float coverage(const Image& image, size_t i) {
  return !image.coverage.empty() ? image.coverage[i] : !image.alpha.empty() ? image.alpha[i] : 1.0f;
}

// visit(image, pixel) of all that are covered by half, or of all where none is.
template <class F>
void for_covered(std::span<const Image> frames, F visit) {
  bool any = false;
  for (const Image& image : frames)
    for (size_t i = 0; i < image.rgb.size() && !any; ++i) any = coverage(image, i) >= 0.5f;
  for (const Image& image : frames)
    for (size_t i = 0; i < image.rgb.size(); ++i)
      if (!any || coverage(image, i) >= 0.5f) visit(image, i);
}

Result<Tone> parse_tone(const std::string& text) {
  if (text == "none") return Tone::none;
  if (text == "aces") return Tone::aces;
  if (text == "agx") return Tone::agx;
  if (text == "neutral") return Tone::neutral;
  return Error{"--tone", "must be neutral, agx, aces or none, not \"" + text + "\"", true};
}

// NaN: automatic.
Result<float> parse_exposure(const std::string& text) {
  if (text == "auto") return std::nanf("");
  float stops = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), stops);
  if (status != std::errc() || end != text.data() + text.size() || !(std::abs(stops) <= 100))
    return Error{"--exposure", "must be auto or stops from -100 to 100, not \"" + text + "\"", true};
  return stops;
}

}  // namespace

Vec3 shown(Vec3 radiance, const Display& display) {
  const float gain = std::exp2(display.exposure);
  const Vec3 c = each(radiance, [&](float v) { return std::fmin(std::fmax(v * gain, 0.0f), 1e30f); });
  switch (display.tone) {
    case Tone::none: break;
    case Tone::aces: return aces(c);
    case Tone::agx: return agx(c);
    case Tone::neutral: return clamped(neutral(c));
  }
  return clamped(c);
}

float auto_exposure(std::span<const Image> frames) {
  std::vector<float> values;
  for_covered(frames, [&](const Image& image, size_t i) {
    const float alpha = image.alpha.empty() ? 1.0f : image.alpha[i];
    const float y = luminance(max(image.rgb[i], Vec3(0.0f))) / (alpha > 0 ? alpha : 1.0f);
    values.push_back(std::isfinite(y) ? y : 0.0f);
  });
  if (values.empty()) return 0;
  const auto ninth = values.begin() + ptrdiff_t(double(values.size() - 1) * 0.9);
  std::nth_element(values.begin(), ninth, values.end());
  float level = *ninth;
  if (!(level > 0)) level = *std::max_element(ninth, values.end());  // a lamp in the dark
  return level > 0 ? std::clamp(std::log2(0.7f / level), -20.0f, 20.0f) : 0.0f;
}

Result<Display> parse_display(const std::string& exposure, const std::string& tone, std::span<const Image> frames) {
  auto stops = parse_exposure(exposure);
  if (!stops) return stops.error();
  auto curve = parse_tone(tone);
  if (!curve) return curve.error();
  return Display{std::isnan(*stops) ? auto_exposure(frames) : *stops, *curve};
}

Result<void> check_display(const std::string& exposure, const std::string& tone) {
  if (auto stops = parse_exposure(exposure); !stops) return stops.error();
  if (auto curve = parse_tone(tone); !curve) return curve.error();
  return {};
}

Clipping clipping(std::span<const Image> frames, const Display& display) {
  size_t all = 0, white = 0, negative = 0;
  for_covered(frames, [&](const Image& image, size_t i) {
    const float alpha = image.alpha.empty() || !(image.alpha[i] > 0) ? 1.0f : image.alpha[i];
    const Vec3 c = shown(image.rgb[i] / alpha, display);
    ++all, negative += luminance(image.rgb[i]) < 0;
    white += srgb_encode(std::max({c.x, c.y, c.z})) * 255 + 0.5f >= 255;
  });
  return all == 0 ? Clipping{} : Clipping{double(white) / double(all), double(negative) / double(all)};
}

}  // namespace lambent

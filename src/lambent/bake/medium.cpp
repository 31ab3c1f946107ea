// Sources: Fresnel's equations; for measured media H. W. Jensen et al. 2001, "A practical model for subsurface light
// transport", figure 5.
#include <lambent/bake/medium.h>

#include <charconv>
#include <vector>

namespace lambent {
namespace {

// Per millimetre. Scattering is the reduced one, (1 - g) sigma_s, which with g = 0 spreads light alike.
struct MeasuredMedium {
  const char* name;
  Vec3 sigma_s, sigma_a;
  float eta;
};
const MeasuredMedium measured[] = {
    {"apple", {2.29f, 2.39f, 1.97f}, {0.0030f, 0.0034f, 0.046f}, 1.3f},
    {"cream", {7.38f, 5.47f, 3.15f}, {0.0002f, 0.0028f, 0.0163f}, 1.3f},
    {"ketchup", {0.18f, 0.07f, 0.03f}, {0.061f, 0.97f, 1.45f}, 1.3f},
    {"marble", {2.19f, 2.62f, 3.00f}, {0.0021f, 0.0041f, 0.0071f}, 1.5f},
    {"potato", {0.68f, 0.70f, 0.55f}, {0.0024f, 0.0090f, 0.12f}, 1.3f},
    {"skimmilk", {0.70f, 1.22f, 1.90f}, {0.0014f, 0.0025f, 0.0142f}, 1.3f},
    {"skin", {0.74f, 0.88f, 1.01f}, {0.032f, 0.17f, 0.48f}, 1.3f},
    {"wholemilk", {2.55f, 3.21f, 3.77f}, {0.0011f, 0.0024f, 0.014f}, 1.3f},
};

// All of `text` as finite numbers between commas; empty if it is anything else.
std::vector<float> numbers(const std::string& text) {
  std::vector<float> values;
  for (const char *p = text.data(), *end = p + text.size(); p <= end;) {
    float value = 0;
    const auto [next, status] = std::from_chars(p, end, value);
    if (status != std::errc() || !std::isfinite(value) || (next != end && *next != ',')) return {};
    values.push_back(value), p = next + 1;
  }
  return values;
}

}  // namespace

Result<void> check_medium(const Medium& m) {
  constexpr float most = 1e6f;
  for (int c = 0; c < 3; ++c) {
    if (!(m.sigma_s[c] >= 0 && m.sigma_s[c] <= most)) return Error{"sigma_s", "must lie between 0 and a million"};
    if (!(m.sigma_a[c] >= 0 && m.sigma_a[c] <= most)) return Error{"sigma_a", "must lie between 0 and a million"};
  }
  if (!(std::abs(m.g) <= 0.999f)) return Error{"g", "must lie between -0.999 and 0.999"};
  if (!(m.eta >= 1 && m.eta <= 3)) return Error{"eta", "must lie between 1 and 3"};
  return {};
}

Result<Medium> parse_medium(const std::string& text) {
  Medium medium;
  if (text.find('=') == std::string::npos) {
    const size_t colon = text.find(':');
    std::string names;
    for (const MeasuredMedium& m : measured) {
      names += (names.empty() ? "" : ", ") + std::string(m.name);
      if (text.substr(0, colon) != m.name) continue;
      float scale = 1000;
      if (colon != std::string::npos) {
        const std::vector<float> mm = numbers(text.substr(colon + 1));
        if (mm.size() != 1 || !(mm[0] > 0))
          return Error{text, "expects the millimetres of one unit of the scene after the colon"};
        scale = mm[0];
      }
      medium = {m.sigma_s * scale, m.sigma_a * scale, 0, m.eta};
      if (auto ok = check_medium(medium); !ok) return Error{text, ok.error().text()};
      return medium;
    }
    return Error{text, "is no medium: give sigma_s=..,sigma_a=.. or one of " + names};
  }
  // KEY=NUMBERS, KEY=NUMBERS: a key runs back from its sign of equality to the comma before.
  bool scatters = false, absorbs = false;
  for (size_t begin = 0; begin < text.size();) {
    const size_t equals = text.find('=', begin);
    if (equals == std::string::npos) return Error{text, "expects KEY=VALUE"};
    const size_t next = text.find('=', equals + 1);
    const size_t end = next == std::string::npos ? text.size() : text.rfind(',', next);
    if (end <= equals) return Error{text, "expects a comma between one KEY=VALUE and the next"};
    const std::string key = text.substr(begin, equals - begin);
    const std::vector<float> v = numbers(text.substr(equals + 1, end - equals - 1));
    const bool colour = key == "sigma_s" || key == "sigma_a";
    if (!colour && key != "g" && key != "eta")
      return Error{text, "knows sigma_s, sigma_a, g and eta, not \"" + key + "\""};
    if (v.size() != 1 && !(colour && v.size() == 3))
      return Error{text, key + " expects " + (colour ? "one number or R,G,B" : "one number")};
    if (key == "g") medium.g = v[0];
    else if (key == "eta") medium.eta = v[0];
    else (key == "sigma_s" ? medium.sigma_s : medium.sigma_a) = v.size() == 3 ? Vec3(v[0], v[1], v[2]) : Vec3(v[0]);
    scatters |= key == "sigma_s", absorbs |= key == "sigma_a";
    begin = end + 1;
  }
  if (!scatters || !absorbs) return Error{text, "needs both sigma_s and sigma_a"};
  if (auto ok = check_medium(medium); !ok) return Error{text, ok.error().text()};
  return medium;
}

double fresnel_reflectance(double cosine, double eta) {
  const double sine2 = (1 - cosine * cosine) / (eta * eta);
  if (sine2 >= 1) return 1;
  const double far = std::sqrt(1 - sine2);
  const double s = (cosine - eta * far) / (cosine + eta * far), p = (eta * cosine - far) / (eta * cosine + far);
  return (s * s + p * p) / 2;
}

}  // namespace lambent

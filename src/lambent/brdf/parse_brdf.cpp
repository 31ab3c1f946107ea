// Text to reflection models.
#include <lambent/brdf/load_measured.h>
#include <lambent/brdf/parse_brdf.h>

#include <charconv>
#include <vector>

namespace lambent {
namespace {

// For messages: short, and on one line.
std::string quoted(std::string_view s) {
  std::string shown(s.substr(0, 64));
  for (char& c : shown)
    if (uint8_t(c) < ' ') c = '?';
  return "\"" + shown + "\"";
}

struct Setting {
  std::string_view key;
  std::vector<float> numbers;
  bool taken = false;
};

// The settings of one model: taken by name, with the first thing that was wrong.
class Settings {
 public:
  Settings(std::string_view model, std::string_view text) : model_(model) { read(text); }

  void color(std::string_view key, Vec3& value) {
    const Setting* s = take(key, 3, 1);
    if (s) value = s->numbers.size() == 1 ? Vec3(s->numbers[0]) : Vec3(s->numbers[0], s->numbers[1], s->numbers[2]);
  }
  void number(std::string_view key, float& value, float highest = 1) {
    if (Setting* s = take(key, 1, highest)) value = s->numbers[0];
  }
  void pair(std::string_view key, Vec2& value) {
    if (Setting* s = take(key, 2, 1)) value = Vec2(s->numbers.front(), s->numbers.back());
  }
  // Energy is kept.
  void check_sum(Vec3 diffuse, Vec3 specular) {
    constexpr float rounding = 1e-6f;
    const Vec3 sum = diffuse + specular;
    if (std::max({sum.x, sum.y, sum.z}) > 1 + rounding) fail("diffuse and specular add up to more than 1");
  }

  Result<Brdf> finish(Brdf brdf) {
    for (const Setting& s : settings_)
      if (!s.taken) fail("there is no " + quoted(s.key) + "; it takes " + keys_);
    if (!problem_.empty()) return Error{std::string(model_), problem_};
    return brdf;
  }

 private:
  void fail(std::string what) {
    if (problem_.empty()) problem_ = std::move(what);
  }

  void read(std::string_view text) {
    while (!text.empty() && problem_.empty()) {
      const size_t comma = std::min(text.find(','), text.size());
      std::string_view item = text.substr(0, comma);
      if (comma + 1 == text.size()) return fail("ends in a comma");
      text.remove_prefix(std::min(comma + 1, text.size()));
      if (const size_t equals = item.find('='); equals != std::string_view::npos) {
        for (const Setting& s : settings_)
          if (s.key == item.substr(0, equals)) return fail(quoted(s.key) + " is given twice");
        settings_.push_back({item.substr(0, equals), {}});
        item.remove_prefix(equals + 1);
      } else if (settings_.empty()) {
        return fail(quoted(item) + " is not of the form key=value");
      }
      float x = 0;
      auto [stop, status] = std::from_chars(item.data(), item.data() + item.size(), x);
      if (status != std::errc() || stop != item.data() + item.size() || !std::isfinite(x))
        return fail(quoted(settings_.back().key) + " is not a number: " + quoted(item));
      settings_.back().numbers.push_back(x);
    }
  }

  // `most` numbers, or one for all.
  Setting* take(std::string_view key, size_t most, float highest) {
    keys_ += (keys_.empty() ? "" : ", ") + std::string(key);
    for (Setting& s : settings_) {
      if (s.key != key) continue;
      s.taken = true;
      if (s.numbers.size() != 1 && s.numbers.size() != most) {
        fail(std::string(key) + (most == 1 ? " takes one number" : " takes one number or " + std::to_string(most)));
        return nullptr;
      }
      for (float x : s.numbers)
        if (!(x >= 0 && x <= highest)) {
          fail(std::string(key) + " must lie in [0, " + std::to_string(int(highest)) + "]");
          return nullptr;
        }
      return &s;
    }
    return nullptr;
  }

  std::string_view model_;
  std::vector<Setting> settings_;
  std::string problem_, keys_;
};

}  // namespace

Result<Brdf> parse_brdf(std::string_view text) {
  const size_t colon = std::min(text.find(':'), text.size());
  const std::string_view name = text.substr(0, colon), rest = text.substr(std::min(colon + 1, text.size()));
  if (name == "measured") {
    if (rest.empty()) return Error{"measured", "names no file"};
    auto table = load_measured(std::string(rest));
    if (!table) return table.error();
    return Brdf(Measured{std::make_shared<const MeasuredTable>(std::move(*table))});
  }
  Settings s(name, rest);
  if (name == "lambert") {
    Lambert b;
    s.color("albedo", b.albedo);
    return s.finish(b);
  }
  if (name == "phong") {
    Phong b;
    s.number("exponent", b.exponent, 1e5f), s.color("diffuse", b.diffuse), s.color("specular", b.specular);
    s.check_sum(b.diffuse, b.specular);
    return s.finish(b);
  }
  if (name == "ggx") {
    Ggx b;
    Vec2 roughness = sqrt(b.alpha);
    s.pair("roughness", roughness), s.color("f0", b.f0);
    b.alpha = roughness * roughness;
    return s.finish(b);
  }
  if (name == "cook-torrance") {
    CookTorrance b;
    s.number("roughness", b.m), s.color("f0", b.f0), s.color("diffuse", b.diffuse), s.color("specular", b.specular);
    s.check_sum(b.diffuse, b.specular);
    return s.finish(b);
  }
  if (name == "ward") {
    Ward b;
    s.number("ax", b.alpha.x), s.number("ay", b.alpha.y), s.color("diffuse", b.diffuse),
        s.color("specular", b.specular);
    s.check_sum(b.diffuse, b.specular);
    return s.finish(b);
  }
  if (name == "metallic-roughness") {
    MetallicRoughness b;
    s.color("color", b.base_color), s.number("metallic", b.metallic), s.number("roughness", b.roughness);
    return s.finish(b);
  }
  return Error{"", "no reflection model " + quoted(name) +
                       ": lambert, phong, ggx, cook-torrance, ward, metallic-roughness or measured"};
}

}  // namespace lambent

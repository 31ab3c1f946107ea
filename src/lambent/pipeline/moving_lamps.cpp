#include <lambent/pipeline/moving_lamps.h>

#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/pipeline/parse.h>
#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <tuple>

namespace lambent {
namespace {

constexpr const char* lamp_kinds[] = {"sphere", "point", "spot", "sun"};
constexpr size_t numbers_of[] = {4, 3, 7, 2};
constexpr float farthest = 1e9f;

Error wrong(const char* option, const std::string& message) { return {option, message, true}; }

// Doubles, so that a place far from the origin is moved before it is rounded.
Result<std::vector<double>> read_numbers(const std::string& text, size_t count, const char* option) {
  std::vector<double> values;
  const char *at = text.data(), *end = at + text.size();
  while (at < end) {
    double value = 0;
    const auto [next, status] = std::from_chars(at, end, value);
    if (status != std::errc() || !(std::abs(value) <= double(farthest))) break;
    values.push_back(value), at = next;
    if (at == end || *at != ',') break;
    ++at;
  }
  if (at != end || values.size() != count)
    return wrong(option,
                 "expects " + std::to_string(count) + " numbers within 1e9, separated by commas, not \"" + text + "\"");
  return values;
}

Vec3 place_at(const std::vector<double>& n, size_t first, Vec3d origin) {
  return Vec3(Vec3d(n[first], n[first + 1], n[first + 2]) - origin);
}

// Degrees.
Vec3 direction_of(double azimuth, double elevation) {
  const double a = azimuth * std::numbers::pi / 180, e = elevation * std::numbers::pi / 180;
  return Vec3(float(std::cos(e) * std::cos(a)), float(std::sin(e)), float(std::cos(e) * std::sin(a)));
}

// N of N@..., from 1, and the rest.
Result<std::pair<size_t, std::string>> read_lamp_number(const std::string& text, size_t lamps,
                                                        const std::string& expected) {
  const size_t at = text.find('@');
  size_t lamp = 0;
  const char* end = text.data() + std::min(at, text.size());
  const auto [stop, status] = std::from_chars(text.data(), end, lamp);
  if (at == std::string::npos || status != std::errc() || stop != end)
    return wrong("--move", expected + ", not \"" + text + "\"");
  if (lamp < 1 || lamp > lamps)
    return wrong("--move", "there is no lamp " + std::to_string(lamp) + " but " + std::to_string(lamps));
  return std::pair(lamp - 1, text.substr(at + 1));
}

// T:NUMBERS;T:NUMBERS;..., times that rise.
Result<std::vector<std::pair<double, std::vector<double>>>> read_keys(const std::string& text, size_t count,
                                                                      const std::string& expected) {
  std::vector<std::pair<double, std::vector<double>>> keys;
  for (size_t from = 0; from <= text.size();) {
    const size_t until = std::min(text.find(';', from), text.size());
    const std::string key = text.substr(from, until - from);
    const size_t colon = key.find(':');
    if (colon == std::string::npos) return wrong("--move", expected + ", not \"" + text + "\"");
    auto time = read_numbers(key.substr(0, colon), 1, "--move");
    if (!time) return time.error();
    auto numbers = read_numbers(key.substr(colon + 1), count, "--move");
    if (!numbers) return numbers.error();
    if (!keys.empty() && !((*time)[0] > keys.back().first)) return wrong("--move", expected);
    keys.emplace_back((*time)[0], std::move(*numbers));
    from = until + 1;
  }
  return keys;
}

// Which two of the places it is between, and how far on it is from the first.
struct Between {
  size_t from, to;
  float share;
};
Between between(const std::vector<std::pair<double, Vec3>>& places, double time) {
  for (size_t k = 0; k < places.size(); ++k)
    if (time < places[k].first) {
      if (k == 0) return {0, 0, 0};
      const double before = places[k - 1].first;
      return {k - 1, k, float((time - before) / (places[k].first - before))};
    }
  return {places.size() - 1, places.size() - 1, 0};
}

}  // namespace

bool names_moving_lamp(const std::string& text) {
  return std::any_of(std::begin(lamp_kinds), std::end(lamp_kinds),
                     [&](const char* kind) { return text.starts_with(std::string(kind) + "@"); });
}

Result<LampNumbers> read_lamp_numbers(const std::string& text) {
  const size_t at = text.find('@'), equals = text.rfind('=');
  const auto kind = std::find(std::begin(lamp_kinds), std::end(lamp_kinds), text.substr(0, at));
  if (at == std::string::npos || equals == std::string::npos || equals < at || kind == std::end(lamp_kinds))
    return wrong("--lamp", std::string("expects ") + moving_lamp_syntax + ", not \"" + text + "\"");
  LampNumbers lamp{MovingLamp::Kind(kind - std::begin(lamp_kinds)), {}, {}};
  auto n = read_numbers(text.substr(at + 1, equals - at - 1), numbers_of[int(lamp.kind)], "--lamp");
  if (!n) return n.error();
  auto color = parse_named_color(text, "--lamp");
  if (!color) return color.error();
  if (!(largest(color->color) <= 1e12f)) return wrong("--lamp", "a colour may be 1e12 at most");
  lamp.numbers = std::move(*n), lamp.color = color->color;
  return lamp;
}

std::string lamp_text(const LampNumbers& lamp) {
  const Vec3 c = lamp.color;
  return fmt::format("{}@{:.9g}={:.6g},{:.6g},{:.6g}", lamp_kinds[int(lamp.kind)], fmt::join(lamp.numbers, ","), c.x,
                     c.y, c.z);
}

void carry_lamp(LampNumbers& lamp, Vec3d by) {
  if (lamp.kind == MovingLamp::Kind::sun) return;
  for (size_t first : {size_t(0), size_t(3)})
    if (first == 0 || lamp.kind == MovingLamp::Kind::spot)
      for (size_t k = 0; k < 3; ++k) lamp.numbers.at(first + k) += by[int(k)];
}

Result<MovingLamp> parse_moving_lamp(const std::string& text, Vec3d origin) {
  auto read = read_lamp_numbers(text);
  if (!read) return read.error();
  const std::vector<double>* n = &read->numbers;
  MovingLamp lamp;
  lamp.kind = read->kind, lamp.light.intensity = read->color;
  if (lamp.kind == MovingLamp::Kind::sun) {
    if (std::abs((*n)[1]) > 90) return wrong("--lamp", "a sun's elevation lies from -90 to 90 degrees");
    lamp.light.kind = PunctualLight::Kind::directional;
    lamp.light.direction = -direction_of((*n)[0], (*n)[1]);
    return lamp;
  }
  lamp.light.position = lamp.centre = place_at(*n, 0, origin);
  if (lamp.kind == MovingLamp::Kind::sphere) {
    lamp.radius = float((*n)[3]), lamp.radiance = read->color;
    if (!(lamp.radius > 0)) return wrong("--lamp", "a sphere's radius must be above 0: point@ has none");
  }
  if (lamp.kind == MovingLamp::Kind::spot) {
    const Vec3 way = place_at(*n, 3, origin) - lamp.light.position;
    const float angle = radians(float((*n)[6]));
    if (!(dot(way, way) > 0)) return wrong("--lamp", "a spot's target is where it stands");
    if (!(angle > 0 && angle <= pi / 2)) return wrong("--lamp", "a spot's angle lies above 0 and up to 90 degrees");
    lamp.light.kind = PunctualLight::Kind::spot, lamp.light.direction = normalize(way);
    lamp.light.outer_cone = angle, lamp.light.inner_cone = angle / 2;
  }
  return lamp;
}

Result<std::vector<MovingLamp>> parse_moving_lamps(const std::vector<std::string>& texts, Vec3d origin) {
  std::vector<MovingLamp> lamps;
  for (const std::string& text : texts) {
    auto lamp = parse_moving_lamp(text, origin);
    if (!lamp) return lamp.error();
    lamps.push_back(*lamp);
  }
  return lamps;
}

Result<LampPath> parse_lamp_path(const std::string& text, const std::vector<MovingLamp>& lamps, Vec3d origin) {
  const std::string expected = "expects N@T:X,Y,Z;T:X,Y,Z;..., with N the number of a --lamp and times that rise";
  auto numbered = read_lamp_number(text, lamps.size(), expected);
  if (!numbered) return numbered.error();
  LampPath path{numbered->first, {}};
  if (lamps[path.lamp].kind == MovingLamp::Kind::sun) return wrong("--move", "a sun has no place to be moved");
  auto keys = read_keys(numbered->second, 3, expected);
  if (!keys) return keys.error();
  for (const auto& [time, place] : *keys) path.places.emplace_back(time, place_at(place, 0, origin));
  return path;
}

void move_lamp(std::vector<MovingLamp>& lamps, const LampPath& path, double time) {
  const Between b = between(path.places, time);
  const Vec3 from = path.places[b.from].second, at = from + b.share * (path.places[b.to].second - from);
  lamps[path.lamp].centre = lamps[path.lamp].light.position = at;
}

Result<LampArc> parse_lamp_arc(const std::string& text, size_t lamps) {
  const std::string expected =
      "expects N@AZIMUTH,ELEVATION or N@T:AZIMUTH,ELEVATION;..., with N the number of a lamp and times that rise";
  auto numbered = read_lamp_number(text, lamps, expected);
  if (!numbered) return numbered.error();
  const bool stands = numbered->second.find(':') == std::string::npos;
  auto keys = read_keys((stands ? "0:" : "") + numbered->second, 2, expected);
  if (!keys) return keys.error();
  LampArc arc{numbered->first, {}};
  for (const auto& [time, n] : *keys) {
    if (std::abs(n[1]) > 90) return wrong("--move", "a lamp's elevation lies from -90 to 90 degrees");
    arc.places.emplace_back(time, direction_of(n[0], n[1]));
    if (arc.places.size() > 1 && dot(arc.places.end()[-2].second, arc.places.back().second) < -0.9999f)
      return wrong("--move", "from a place to the opposite one there is no shorter arc: give one between");
  }
  return arc;
}

Vec3 direction_at(const LampArc& arc, double time) {
  const Between b = between(arc.places, time);
  const Vec3d from(arc.places[b.from].second), to(arc.places[b.to].second);
  const double angle = std::atan2(length(cross(from, to)), dot(from, to)), share = double(b.share);
  if (angle < 1e-9) return Vec3(from);
  return normalize(Vec3(std::sin((1 - share) * angle) * from + std::sin(share * angle) * to));
}

namespace {

float mean(Vec3 v) { return (v.x + v.y + v.z) / 3; }

Vec3 reaching(const Tracer& tracer, Vec3 origin, Vec3 direction, float distance) {
  if (tracer.lets_pass()) return tracer.transmittance(origin, direction, distance);
  return Vec3(tracer.closest(origin, direction, 0, distance).triangle == none ? 1.0f : 0.0f);
}

// A sphere fills a cone of directions. Their solid angle is 2 pi (1 - cos), by the squared sine where that is small.
Vec3 from_sphere(const Tracer& tracer, const MovingLamp& lamp, Vec3 origin, Vec3 normal, int samples, uint64_t key) {
  const Vec3 way = lamp.centre - origin;
  const float far = length(way);
  if (!(far > lamp.radius)) return Vec3(0.0f);
  const Vec3 axis = way / far;
  const float sine = lamp.radius / far, sine2 = sine * sine, cosine = std::sqrt(std::max(1 - sine2, 0.0f));
  const float depth = sine2 / (1 + cosine);  // 1 - cosine
  if (dot(normal, axis) < -sine) return Vec3(0.0f);
  const Mat3 frame = frame_about(axis);
  Vec3 sum(0.0f);
  for (int s = 0; s < samples; ++s) {
    const Vec2 u = sobol_owen(uint32_t(s), uint32_t(key));
    const float down = u.x * depth, turn = 2 * pi * u.y;
    const float out = std::sqrt(std::max(down * (2 - down), 0.0f));
    const Vec3 d = frame * Vec3(out * std::cos(turn), out * std::sin(turn), 1 - down);
    const float facing = dot(normal, d);
    if (facing <= 0) continue;
    // Where the ray meets the sphere.
    const float along = far * (1 - down), beside2 = far * far * out * out;
    const float distance = along - std::sqrt(std::max(lamp.radius * lamp.radius - beside2, 0.0f));
    sum += facing * reaching(tracer, origin, d, distance);
  }
  return lamp.radiance * sum * (2 * depth / float(samples));  // 2 pi depth, over pi
}

// Of a lamp without a size, with nothing in the way; and where it is from there.
Vec3 from_point(const MovingLamp& lamp, Vec3 origin, Vec3 normal, LampArrival& a) {
  a = arriving(lamp.light, origin);
  const float facing = dot(normal, a.direction);
  if (facing <= 0 || !(mean(a.irradiance) > 0) || !is_finite(a.irradiance)) return Vec3(0.0f);
  return facing / pi * a.irradiance;
}

}  // namespace

Vec3 clear_light(const MovingLamp& lamp, Vec3 origin, Vec3 normal) {
  LampArrival a;
  if (lamp.kind != MovingLamp::Kind::sphere) return from_point(lamp, origin, normal, a);
  const Vec3 way = lamp.centre - origin;
  const float far2 = dot(way, way), far = std::sqrt(far2);
  if (!(far > lamp.radius)) return Vec3(0.0f);
  // As of its middle; half of what may stand over the horizon where that does not.
  const float facing = std::max(dot(normal, way), 0.5f * (dot(normal, way) + lamp.radius)) / far;
  return facing > 0 ? lamp.radiance * (facing * lamp.radius * lamp.radius / far2) : Vec3(0.0f);
}

Vec3 direct_light(const Tracer& tracer, const MovingLamp& lamp, Vec3 origin, Vec3 normal, int samples, uint64_t key) {
  if (lamp.kind == MovingLamp::Kind::sphere) return from_sphere(tracer, lamp, origin, normal, samples, key);
  LampArrival a;
  const Vec3 clear = from_point(lamp, origin, normal, a);
  return largest(clear) > 0 ? clear * reaching(tracer, origin, a.direction, a.distance) : Vec3(0.0f);
}

Vec3 direct_light(const Tracer& tracer, std::span<const MovingLamp> lamps, Vec3 origin, Vec3 normal, int samples,
                  uint64_t key) {
  Vec3 sum(0.0f);
  for (size_t k = 0; k < lamps.size(); ++k)
    sum += direct_light(tracer, lamps[k], origin, normal, samples, hash64(key, k));
  return sum;
}

bool is_same(const MovingLamp& a, const MovingLamp& b) {
  const auto of = [](const PunctualLight& l) {
    return std::tie(l.kind, l.position, l.direction, l.intensity, l.inner_cone, l.outer_cone);
  };
  return a.kind == b.kind && of(a.light) == of(b.light) && a.centre == b.centre && a.radius == b.radius &&
         a.radiance == b.radiance;
}

void add_lamps(Scene& scene, const std::vector<MovingLamp>& lamps) {
  Scene spheres;
  for (const MovingLamp& lamp : lamps) {
    if (lamp.kind != MovingLamp::Kind::sphere) {
      scene.lights.push_back(lamp.light);
      continue;
    }
    const uint32_t material = add_material(spheres, "lamp", Vec3(0.0f));
    spheres.materials[material].emissive = lamp.radiance;
    // Corners lie on the sphere, faces within: at five levels their area is 0.1 % less.
    add_sphere(spheres, material, "lamp", lamp.centre, lamp.radius, 5);
  }
  if (!spheres.triangles.empty()) append_scene(scene, spheres);
}

}  // namespace lambent

#include <lambent/pipeline/place.h>

#include <lambent/pipeline/options.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace lambent {

using nlohmann::json;

namespace {

// Finite numbers within 1e9, separated by commas; empty where there is anything else.
std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> out;
  const char* p = text.data();
  const char* end = p + text.size();
  while (true) {
    double value = 0;
    const auto [next, status] = std::from_chars(p, end, value);
    if (status != std::errc() || !(std::abs(value) <= 1e9)) return {};
    out.push_back(value);
    if (next == end) return out;
    if (*next != ',') return {};
    p = next + 1;
  }
}

PlaceKey key_of(double time, const std::vector<double>& n) {
  PlaceKey key{time, {n[0], n[1], n[2]}, Vec3d(0.0)};
  if (n.size() >= 6) key.degrees = {n[3], n[4], n[5]};
  return key;
}

Vec3d between(Vec3d a, Vec3d b, double t) { return a + t * (b - a); }

}  // namespace

Result<PlacedFile> parse_place(const std::string& text) {
  const size_t equals = text.find('='), at = text.rfind('@');
  const Error wrong{
      "--place",
      "expects NAME=FIELD@X,Y,Z, NAME=FIELD@X,Y,Z,YAW,PITCH,ROLL or the same and ,SCALE, not \"" + text + "\"", true};
  if (equals == std::string::npos || equals == 0 || at == std::string::npos || at <= equals + 1) return wrong;
  const std::vector<double> n = numbers_in(text.substr(at + 1));
  if (n.size() != 3 && n.size() != 6 && n.size() != 7) return wrong;
  PlacedFile out{text.substr(0, equals), text.substr(equals + 1, at - equals - 1), key_of(0, n)};
  if (n.size() == 7) out.scale = float(n[6]);
  if (!(out.scale >= 1e-6f && out.scale <= 1e6f))
    return Error{"--place", "the scale of " + out.name + " must be from 1e-6 to 1e6: an object is not mirrored", true};
  return out;
}

std::string place_text(const PlacedFile& o) {
  const Vec3d &p = o.at.position, &d = o.at.degrees;
  return fmt::format("{}={}@{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}", o.name, o.path, p.x, p.y, p.z, d.x, d.y,
                     d.z, o.scale);
}

Result<std::vector<PlaceKey>> load_path(const std::string& path) {
  auto object = load_json(path);
  if (!object) return object.error();
  const auto list = [&](const char* name) -> const json* {
    const auto it = object->is_object() ? object->find(name) : object->end();
    return object->is_object() && it != object->end() && it->is_array() ? &*it : nullptr;
  };
  const json *times = list("times"), *places = list("places");
  if (!times || !places || times->empty() || times->size() != places->size())
    return Error{path, "expects \"times\" and \"places\", lists as long as each other and not empty"};
  for (const auto& [key, value] : object->items())
    if (key != "times" && key != "places") return Error{path, "\"" + key + "\" is neither \"times\" nor \"places\""};
  std::vector<PlaceKey> keys;
  for (size_t i = 0; i < times->size(); ++i) {
    const json &time = (*times)[i], &place = (*places)[i];
    if (!time.is_number() || !(std::abs(time.get<double>()) <= 1e9))
      return Error{path, fmt::format("time {} is no number within 1e9", i)};
    if (!keys.empty() && !(time.get<double>() > keys.back().time))
      return Error{path,
                   fmt::format("times must rise: number {} is {}, after {}", i, time.get<double>(), keys.back().time)};
    std::vector<double> n;
    if (place.is_array())
      for (const json& x : place)
        if (x.is_number() && std::abs(x.get<double>()) <= 1e9) n.push_back(x.get<double>());
    if (!place.is_array() || n.size() != place.size() || (n.size() != 3 && n.size() != 6))
      return Error{path, fmt::format("place {} is not X, Y, Z or X, Y, Z, YAW, PITCH, ROLL, within 1e9", i)};
    keys.push_back(key_of(time.get<double>(), n));
  }
  return keys;
}

Result<std::vector<PlacedFile>> parse_places(const std::vector<std::string>& places,
                                             const std::vector<std::string>& moves,
                                             const std::vector<std::string>& poses) {
  if (places.size() > max_placed_objects)
    return Error{"--place", fmt::format("{} objects are more than {}", places.size(), max_placed_objects), true};
  std::vector<PlacedFile> out;
  const auto named = [&](const std::string& name) {
    return std::find_if(out.begin(), out.end(), [&](const PlacedFile& f) { return f.name == name; });
  };
  for (const std::string& text : places) {
    auto placed = parse_place(text);
    if (!placed) return placed.error();
    if (named(placed->name) != out.end()) return Error{"--place", "the name " + placed->name + " is there twice", true};
    out.push_back(std::move(*placed));
  }
  for (const std::string& text : moves) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      return Error{"--move", "expects NAME=PATH.json, not \"" + text + "\"", true};
    const auto object = named(text.substr(0, equals));
    if (object == out.end()) return Error{"--move", "no --place is named " + text.substr(0, equals), true};
    if (!object->keys.empty()) return Error{"--move", object->name + " has a path already", true};
    auto keys = load_path(text.substr(equals + 1));
    if (!keys) return keys.error();
    object->keys = std::move(*keys);
  }
  for (const std::string& text : poses) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      return Error{"--pose", "expects NAME=ANIMATION, not \"" + text + "\"", true};
    const auto object = named(text.substr(0, equals));
    if (object == out.end()) return Error{"--pose", "no --place is named " + text.substr(0, equals), true};
    if (!object->animation.empty()) return Error{"--pose", object->name + " has an animation already", true};
    object->animation = text.substr(equals + 1);
  }
  return out;
}

RigidPlace place_at(const PlacedFile& object, double time, Vec3d origin) {
  PlaceKey at = object.at;
  if (!object.keys.empty()) {
    const auto after =
        std::find_if(object.keys.begin(), object.keys.end(), [&](const PlaceKey& k) { return k.time > time; });
    if (after == object.keys.begin()) at = object.keys.front();
    else if (after == object.keys.end()) at = object.keys.back();
    else {
      const PlaceKey& before = after[-1];
      const double t = (time - before.time) / (after->time - before.time);
      at.position = between(before.position, after->position, t);
      at.degrees = between(before.degrees, after->degrees, t);
    }
  }
  const Vec3d turn(std::remainder(at.degrees.x, 360.0), std::remainder(at.degrees.y, 360.0),
                   std::remainder(at.degrees.z, 360.0));
  return {Vec3(at.position - origin), rotation_from_yaw_pitch_roll(Vec3(turn)), object.scale};
}

}  // namespace lambent

#include "hold.h"

#include "session.h"

#include <lambent/pipeline/place.h>
#include <lambent/scene/pose.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lambent::tool {
namespace {

constexpr float lamp_reach = 14;  // pixels within which a hand takes hold of a lamp

// Numbers short enough to be read, of the scene's scale.
double rounded(double value, double scale) {
  const double step = std::pow(10.0, std::floor(std::log10(std::max(scale, 1e-9))) - 3);
  return std::round(value / step) * step;
}

}  // namespace

std::optional<Vec3> lamp_place(const std::string& text, Vec3d origin) {
  auto lamp = read_lamp_numbers(text);
  if (!lamp || lamp->kind == MovingLamp::Kind::sun) return std::nullopt;
  const std::vector<double>& n = lamp->numbers;
  return Vec3(Vec3d(n[0], n[1], n[2]) - origin);
}

std::string lamp_over(const Scene& scene, const std::string& kind) {
  const Bounds box = bounds(scene);
  const Vec3 size = box.max - box.min;
  const double scale = double(box.diagonal());
  const Vec3d middle = Vec3d(0.5f * (box.min + box.max)) + scene.origin;
  const double x = rounded(middle.x, scale), z = rounded(middle.z, scale),
               y = rounded(middle.y + 0.25 * double(size.y), scale), foot = rounded(y - 0.5 * double(size.y), scale);
  const double flux = rounded(0.2 * scale * scale, 0.2 * scale * scale);
  if (kind == "sun") return "sun@40,50=3";
  if (kind == "spot")
    return fmt::format("spot@{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},35={:.6g}", x, y, z, x, foot, z, 2 * flux);
  if (kind == "point") return fmt::format("point@{:.9g},{:.9g},{:.9g}={:.6g}", x, y, z, flux);
  const double radius = rounded(0.02 * scale, 0.02 * scale);
  return fmt::format("sphere@{:.9g},{:.9g},{:.9g},{:.6g}=150", x, y, z, radius);
}

std::vector<std::string> Session::standing_lamps() const {
  std::vector<std::string> out;
  if (kind_of(bakes[shown_bake]->surface) == DrawKind::indirect)
    for (const std::string& text : live->request().lamp)
      if (names_moving_lamp(text)) out.push_back(text);
  return out;
}

Result<void> Session::set_lamp(size_t index, const std::string& text) {
  DrawRequest request = live->request();
  size_t count = 0;
  auto at = request.lamp.begin();
  for (; at != request.lamp.end(); ++at)
    if (names_moving_lamp(*at) && count++ == index) break;
  if (at == request.lamp.end() && (count != index || text.empty()))
    return Error{"lamp", fmt::format("there are lamps 1 to {}", count), true};
  for (const std::string& path : request.move)
    if (path.starts_with(fmt::format("{}@", index + 1))) return Error{"lamp", "is where its path has it: --move", true};
  if (text.empty()) request.lamp.erase(at);
  else if (at == request.lamp.end()) request.lamp.push_back(text);
  else *at = text;
  return ask(request);
}

std::string Session::new_lamp(const std::string& kind) const { return lamp_over(live->scene(), kind); }

std::optional<Vec2> Session::lamp_in_picture(const std::string& text) const {
  const auto place = lamp_place(text, live->scene().origin);
  if (!place) return std::nullopt;
  const View& view = live->view();
  const CameraRays rays(view.camera, view.width, view.height);
  // place - eye = t (corner + x dx + y dy).
  const Vec3 way = *place - rays.eye, normal = cross(rays.dx, rays.dy);
  const float volume = dot(rays.corner, normal), t = dot(way, normal) / volume;
  if (!(t > 0)) return std::nullopt;
  const Vec2 at(dot(way, cross(rays.dy, rays.corner)) / (volume * t),
                dot(way, cross(rays.corner, rays.dx)) / (volume * t));
  const Vec2 share = at / Vec2(float(view.width), float(view.height));
  if (!(share.x >= 0 && share.x <= 1 && share.y >= 0 && share.y <= 1)) return std::nullopt;
  return share;
}

namespace {

// When what moves has come to its end.
double end_of_motion(const DrawRequest& request, const Scene& scene) {
  double end = 0;
  if (!request.animation.empty()) {
    const auto animation = find_animation(scene, request.animation);
    const auto all = list_animations(scene);
    if (animation && all) end = all->at(*animation).to;
  }
  if (auto objects = parse_places(request.place, request.move); objects && !request.place.empty())
    for (const PlacedFile& object : *objects)
      if (!object.keys.empty()) end = std::max(end, object.keys.back().time);
  auto lamps = parse_moving_lamps({}, scene.origin);
  for (const std::string& text : request.lamp)
    if (auto lamp = parse_moving_lamp(text, scene.origin); lamp && names_moving_lamp(text)) lamps->push_back(*lamp);
  for (const std::string& text : request.move)
    if (auto arc = parse_lamp_arc(text, SIZE_MAX)) end = std::max(end, arc->places.back().first);
  for (const std::string& text : request.move)
    if (auto path = parse_lamp_path(text, *lamps, scene.origin)) end = std::max(end, path->places.back().first);
  return end;
}

}  // namespace

Result<void> Session::advance(double seconds) {
  if (!moves_by_itself()) return {};
  DrawRequest request = live->request();
  const double end = end_of_motion(request, bakes[shown_bake]->scene);
  request.time += seconds;
  if (request.time > end) request.time = 0;
  return ask(request);
}

std::string Session::material_at(Vec2 at) const {
  const Hit hit = live->pick(at);
  if (hit.triangle == none) return "";
  const Scene& scene = live->scene();
  return scene.materials[scene.parts[scene.triangles[hit.triangle].part].material].name;
}

bool Session::grab(Vec2 at) {
  const std::vector<std::string> lamps = standing_lamps();
  const View& view = live->view();
  for (size_t i = 0; i < lamps.size(); ++i)
    if (const auto seen = lamp_in_picture(lamps[i])) {
      const Vec2 apart = (*seen - at) * Vec2(float(view.width), float(view.height));
      if (dot(apart, apart) > lamp_reach * lamp_reach) continue;
      return held_ = {decltype(held_)::Of::lamp, i, *lamp_place(lamps[i], live->scene().origin)}, true;
    }
  const Hit hit = live->pick(at);
  const auto object = live->object_of(hit);
  if (!object) return false;
  const bool inserted = !live->request().insert.empty();
  using Of = decltype(held_)::Of;
  held_ = {inserted ? Of::inserted : Of::placed, *object,
           interpolate(live->scene().positions, live->scene().triangles[hit.triangle], hit.u, hit.v)};
  return true;
}

Result<void> Session::carry(Vec2 at, bool lift) {
  const View& view = live->view();
  const CameraRays rays(view.camera, view.width, view.height);
  const Vec3 along = rays.direction(at.x * float(view.width), at.y * float(view.height)), eye = view.camera.eye;
  const Vec3 upright(eye.x - held_.at.x, 0, eye.z - held_.at.z), normal = lift ? upright : Vec3(0, 1, 0);
  const float t = dot(held_.at - eye, normal) / dot(along, normal);
  if (!(t > 0 && t < 100 * bounds(live->scene()).diagonal())) return {};  // beyond the horizon
  Vec3 by = eye + t * along - held_.at;
  if (lift) by.x = by.z = 0;
  if (auto ok = move_held(by); !ok) return ok;
  held_.at += by;
  return {};
}

Result<void> Session::move_held(Vec3 by) {
  using Of = decltype(held_)::Of;
  DrawRequest request = live->request();
  const Vec3d origin = live->scene().origin;
  if (held_.of == Of::lamp) {
    const std::vector<std::string> lamps = standing_lamps();
    auto lamp = read_lamp_numbers(lamps.at(held_.index));
    if (!lamp) return lamp.error();
    carry_lamp(*lamp, Vec3d(by));
    return set_lamp(held_.index, lamp_text(*lamp));
  }
  if (held_.of == Of::inserted) {
    std::string& text = request.insert.at(held_.index);
    auto object = parse_insertion(text, origin);
    if (!object) return object.error();
    const Vec3d p = Vec3d(object->foot + by) + origin;
    text = fmt::format("{}@{:.9g},{:.9g},{:.9g},{:.9g}", object->path, p.x, p.y, p.z, object->scale);
  } else {
    auto objects = parse_places(request.place, request.move);
    if (!objects) return objects.error();
    PlacedFile& object = objects->at(held_.index);
    if (!object.keys.empty()) return Error{object.name, "is where its path has it: --move"};
    object.at.position += Vec3d(by);
    request.place[held_.index] = place_text(object);
  }
  return ask(request);
}

}  // namespace lambent::tool

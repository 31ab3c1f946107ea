#include <lambent/pipeline/bake_rooms.h>

#include <lambent/core/file.h>
#include <lambent/pipeline/text.h>

#include <fmt/format.h>

#include <set>

namespace lambent {
namespace {

using nlohmann::json;

constexpr size_t most_rooms = 64;

Result<Vec3> read_corner(const json& room, const char* key, const Scene& scene, const std::string& where) {
  const json corner = room.value(key, json());
  if (!corner.is_array() || corner.size() != 3 ||
      !std::all_of(corner.begin(), corner.end(), [](const json& x) { return x.is_number(); }))
    return Error{where, std::string("needs \"nodes\", or \"min\" and \"max\" of three numbers each")};
  return Vec3(Vec3d(corner[0].get<double>(), corner[1].get<double>(), corner[2].get<double>()) - scene.origin);
}

// What nodes of these names span.
Result<Bounds> span_of(const json& nodes, const Scene& scene, const std::string& where) {
  Bounds box;
  for (const json& name : nodes) {
    bool found = false;
    for (const Part& part : scene.parts) {
      if (!name.is_string() || part.name != name.get<std::string>()) continue;
      found = true;
      for (size_t v = 0; v < part.vertex_count; ++v) box.extend(scene.positions[part.first_vertex + v]);
    }
    if (!found) return Error{where, "there is no node " + name.dump(-1, ' ', false, json::error_handler_t::replace)};
  }
  if (box.empty()) return Error{where, "names no node with a surface"};
  return box;
}

Result<Room> read_room(const json& room, const Scene& scene, const std::string& where) {
  if (!room.is_object()) return Error{where, "is not an object"};
  Room out;
  const json name = room.value("name", json());
  if (!name.is_string()) return Error{where, "has no \"name\""};
  out.name = name.get<std::string>();
  for (const auto& item : room.items())
    if (!std::set<std::string>{"name", "nodes", "min", "max"}.contains(item.key()))
      return Error{where, "\"" + item.key() + "\" is not known"};
  if (const auto nodes = room.find("nodes"); nodes != room.end()) {
    if (!nodes->is_array()) return Error{where, "\"nodes\" is no list of names"};
    auto box = span_of(*nodes, scene, where);
    if (!box) return box.error();
    out.box = *box;
    return out;
  }
  auto low = read_corner(room, "min", scene, where), high = read_corner(room, "max", scene, where);
  for (const auto* corner : {&low, &high})
    if (!*corner) return corner->error();
  out.box = {*low, *high};
  if (!(low->x < high->x && low->y < high->y && low->z < high->z)) return Error{where, "is an empty box"};
  return out;
}

}  // namespace

Result<std::vector<Room>> rooms_of_request(const BakeRequest& request, const Scene& scene) {
  if (request.rooms == "auto") return find_rooms(scene, most_rooms);
  auto bytes = read_file(request.rooms);
  if (!bytes) return bytes.error();
  const json document = json::parse(bytes->begin(), bytes->end(), nullptr, false);
  if (!document.is_object() || !document.contains("rooms") || !document["rooms"].is_array())
    return Error{request.rooms, "is no JSON object with a list of \"rooms\""};
  const json& list = document["rooms"];
  if (list.empty() || list.size() > 1024) return Error{request.rooms, "has no rooms, or more than 1,024"};
  std::vector<Room> asked;
  for (size_t i = 0; i < list.size(); ++i) {
    auto room = read_room(list[i], scene, request.rooms + ": room " + std::to_string(i));
    if (!room) return room.error();
    asked.push_back(std::move(*room));
  }
  return part_rooms(room_bounds(scene), asked);
}

Result<Transfer> bake_rooms_of_request(const BakeRequest& request, const BakeOptions& options, const Scene& scene,
                                       const Receivers& receivers, const Job& job, BakeReport& report, Summary& summary,
                                       json& told) {
  auto rooms = rooms_of_request(request, scene);
  if (!rooms) return rooms.error();
  RoomsOptions how;
  how.residual = how.loss = request.rooms_error, how.cheapest = true;
  how.own_part = request.compress.empty() && request.fix_light.empty();
  if (job.progress) how.scratch = job.progress->scratch;
  RoomsReport found;
  auto transfer = bake_rooms(scene, receivers, *rooms, options, how, &report, &found, job.progress);
  if (!transfer) return transfer;
  if (!found.converged)
    job.warn(fmt::format("the rooms are not joined to {:.3g}%: {:.3g}% after {} sweeps", 100 * how.residual,
                         100 * found.residuals.back(), found.residuals.size()));
  summary.json["rooms"] = {{"rooms", found.rooms},     {"openings", found.openings},       {"nodes", found.nodes},
                           {"largest", found.largest}, {"residuals", found.residuals},     {"lost", found.lost},
                           {"handed", found.handed},   {"handed_rays", found.handed_rays}, {"loss", found.loss}};
  if (found.loss_of_all >= 0) summary.json["rooms"]["loss_of_all"] = found.loss_of_all;
  told["rooms"] = {{"rooms", found.rooms}, {"residual", found.residuals.empty() ? 0.0 : found.residuals.back()}};
  summary.lines.emplace_back("rooms",
                             fmt::format("{}, the largest of {} receivers; {} nodes in {} openings", found.rooms,
                                         human_count(found.largest), human_count(found.nodes), found.openings));
  if (found.handed > 0)
    summary.lines.emplace_back(
        "", fmt::format("rays of {} openings are handed on, {} in all: light fields there would {}", found.handed,
                        human_count(found.handed_rays),
                        found.loss_of_all < 0 ? "be more work" : fmt::format("lose {:.2g}%", 100 * found.loss_of_all)));
  if (!found.residuals.empty())
    summary.lines.emplace_back(
        "joined", fmt::format("to {:.2g}% in {} sweeps", 100 * found.residuals.back(), found.residuals.size()));
  return transfer;
}

}  // namespace lambent

#include <lambent/baked/extension.h>
#include <lambent/basis/sh.h>

namespace lambent {

using nlohmann::json;

namespace {

Result<Shells> decode_places(const json& object, const std::string& where) {
  auto side = read_count(object, "side", size_t(max_shell_side), where);
  if (!side) return side.error();
  auto center = read_numbers(object, "center", 3, where);
  if (!center) return center.error();
  const auto radii = object.find("radii"), radius = object.find("radius");
  if (radii == object.end() || !radii->is_array() || radii->size() > size_t(max_shells))
    return Error{where, "\"radii\" is not a list, or too long a one"};
  auto numbers = read_numbers(object, "radii", radii->size(), where);
  if (!numbers) return numbers.error();
  if (radius == object.end() || !radius->is_number()) return Error{where, "\"radius\" is not a number"};
  Shells s{{(*center)[0], (*center)[1], (*center)[2]}, radius->get<float>(), std::move(*numbers), int(*side)};
  if (!is_consistent(s)) return Error{where, "its shells are none, or do not rise, or have fewer than 2 x 2 points"};
  return s;
}

Result<Field> decode_dense_field(const BlobReader& in, const json& object, const Shells& shells, Transfer t, Rows rows,
                                 const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  const int channels = t.channels;
  if (auto ok = decode_dense(in, object, t, where); !ok) return ok.error();
  if (t.channels != channels) return Error{where, "must have " + std::to_string(channels) + " channels"};
  Field field{ShellPlacement{shells}, std::move(t), std::move(rows)};
  if (!is_consistent(field)) return Error{where, "its rows do not fit"};
  return field;
}

Result<Field> decode_reflecting(const BlobReader& in, const json& object, const Shells& shells,
                                const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  auto incident = read_count(object, "incidentOrder", size_t(max_sh_order), where);
  if (!incident) return incident.error();
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  if (*incident < 1 || *order < 1) return Error{where, "an order is 0"};
  return decode_dense_field(in, object, shells,
                            Transfer{{.order = int(*incident)}, sh_count(int(*order)), 3, shells.count()},
                            IncidentRows{int(*order)}, where);
}

}  // namespace

json encode_shells(const Field& hidden, const Field* shining, const Field* reflecting, BlobWriter& out) {
  const Shells& s = std::get<ShellPlacement>(hidden.where).shells;
  json object{{"center", {s.center.x, s.center.y, s.center.z}},
              {"radius", s.radius},
              {"radii", s.radii},
              {"side", s.side},
              {"order", light_of(hidden.store).order},
              {"hidden", encode_dense(std::get<Transfer>(hidden.store), out)}};
  if (shining) object["shining"] = encode_dense(std::get<Transfer>(shining->store), out);
  if (reflecting) {
    json& said = object["reflecting"] = encode_dense(std::get<Transfer>(reflecting->store), out);
    said["incidentOrder"] = light_of(reflecting->store).order;
    said["order"] = std::get<IncidentRows>(reflecting->rows).order;
  }
  return object;
}

Result<std::vector<Field>> decode_shells(const BlobReader& in, const json& object, const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  auto shells = decode_places(object, where);
  if (!shells) return shells.error();
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  if (*order < 1) return Error{where, "its order is 0"};
  if (!object.contains("hidden")) return Error{where, "\"hidden\" is missing"};
  const size_t count = shells->count();
  std::vector<Field> fields;
  auto hidden = decode_dense_field(in, object["hidden"], *shells, Transfer{{.order = int(*order)}, 1, 1, count},
                                   HiddenRows{}, where + ": hidden");
  if (!hidden) return hidden.error();
  fields.push_back(std::move(*hidden));
  if (object.contains("shining")) {
    auto shining = decode_dense_field(in, object["shining"], *shells,
                                      Transfer{{.groups = {"all"}}, sh_count(int(*order)), 3, count},
                                      IncidentRows{int(*order)}, where + ": shining");
    if (!shining) return shining.error();
    fields.push_back(std::move(*shining));
  }
  if (object.contains("reflecting")) {
    auto reflecting = decode_reflecting(in, object["reflecting"], *shells, where + ": reflecting");
    if (!reflecting) return reflecting.error();
    fields.push_back(std::move(*reflecting));
  }
  return fields;
}

}  // namespace lambent

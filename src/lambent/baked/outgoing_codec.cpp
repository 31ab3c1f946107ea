// The last reflection as bulk data: view maps as halves [map][y][x][row][a.r, a.g, a.b, b]; by receiver, the map and a
// frame's tangent and normal.
#include <lambent/baked/extension.h>
#include <lambent/basis/sh.h>
#include <lambent/core/half.h>

#include <algorithm>

namespace lambent {

using nlohmann::json;

json encode_outgoing(const Outgoing& o, BlobWriter& out) {
  std::vector<Vec3> frames;
  for (const Mat3& f : o.frames) frames.push_back(f[0]), frames.push_back(f[2]);
  json object{{"kind", outgoing_names[int(o.kind)]}, {"order", o.order}, {"frames", out.add_copy(frames)}};
  if (o.kind == OutgoingKind::directional) {
    object["lobes"] = json::array();
    for (const Lobe& l : o.lobes) object["lobes"].push_back({l.axis.x, l.axis.y, l.axis.z, l.sharpness});
  }
  if (o.maps.empty()) {
    object["hasB"] = o.has_b;
    return object;
  }
  std::vector<uint16_t> maps;
  for (const ViewMap& map : o.maps)
    for (const ViewWeights& w : map.values)
      for (size_t c = 0; c < 4; ++c) maps.push_back(float_to_half(w[c]));
  object["grid"] = o.maps[0].grid, object["mapCount"] = o.maps.size();
  object["maps"] = out.add_copy(maps), object["mapOf"] = out.add_copy(o.map_of);
  return object;
}

namespace {

Result<void> decode_maps(const BlobReader& in, const json& object, int rows, size_t receivers, Outgoing& o,
                         const std::string& where) {
  auto grid = read_count(object, "grid", 256, where), maps = read_count(object, "mapCount", 65535, where);
  for (const auto* count : {&grid, &maps})
    if (!*count) return count->error();
  if (*grid < 2 || *maps < 1) return Error{where, "view maps have no size"};
  const size_t each = *grid * *grid * size_t(rows);
  if (*maps > in.buffers.room() / (8 * each)) return Error{where, "there is no room for so many view maps"};
  auto halves = read_values<uint16_t>(in, object, "maps", *maps * each * 4, where);
  if (!halves) return halves.error();
  const uint16_t* p = halves->data();
  for (size_t m = 0; m < *maps; ++m) {
    ViewMap map{int(*grid), rows, std::vector<ViewWeights>(each)};
    for (ViewWeights& w : map.values)
      for (size_t c = 0; c < 4; ++c) w[c] = half_to_float(*p++);
    o.maps.push_back(std::move(map));
  }
  auto map_of = read_values<uint16_t>(in, object, "mapOf", receivers, where);
  if (!map_of) return map_of.error();
  for (uint16_t m : *map_of)
    if (m >= *maps) return Error{where, "view map " + std::to_string(m) + " does not exist"};
  o.map_of = std::move(*map_of);
  return {};
}

}  // namespace

Result<Outgoing> decode_outgoing(const BlobReader& in, const json& object, int rows, size_t receivers,
                                 const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  Outgoing o;
  const auto kind = std::find_if(std::begin(outgoing_names), std::end(outgoing_names),
                                 [&](const char* name) { return object.contains("kind") && object["kind"] == name; });
  if (kind == std::end(outgoing_names)) return Error{where, "the outgoing basis is not known to this program"};
  o.kind = OutgoingKind(kind - std::begin(outgoing_names));
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  o.order = int(*order);
  if (const auto b = object.find("hasB"); b != object.end()) {
    if (!b->is_boolean()) return Error{where, "\"hasB\" is neither true nor false"};
    o.has_b = b->get<bool>();
  }
  if (o.order < 1) return Error{where, "the outgoing order is 0"};
  if (o.kind == OutgoingKind::map || o.kind == OutgoingKind::svd)
    if (auto ok = decode_maps(in, object, rows, receivers, o, where); !ok) return ok.error();
  if (o.kind == OutgoingKind::directional) {
    auto lobes = decode_lobes(object, LobeKind::compact, size_t(rows), where);
    if (!lobes) return lobes.error();
    o.lobes = std::move(*lobes);
  }
  auto frames = read_values<Vec3>(in, object, "frames", 2 * receivers, where);
  if (!frames) return frames.error();
  for (size_t r = 0; r < receivers; ++r) {
    const Vec3 t = (*frames)[2 * r], n = (*frames)[2 * r + 1];
    if (!is_finite(t) || !is_finite(n) || dot(t, t) > 2 || dot(n, n) > 2)
      return Error{where, "a receiver's frame is broken"};
    o.frames.push_back(Mat3(t, cross(n, t), n));
  }
  if (o.rows() != rows) return Error{where, "\"rows\" does not fit the outgoing basis"};
  return o;
}

}  // namespace lambent

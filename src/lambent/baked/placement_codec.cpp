#include <lambent/baked/extension.h>
#include <lambent/basis/sh.h>
#include <lambent/core/overloaded.h>

#include <algorithm>
#include <numeric>

namespace lambent {

using nlohmann::json;

namespace {

// What parts hold: vertices, a receiver a vertex; patches, a receiver a triangle; texels, a place in the atlas a
// vertex.
template <class T>
void encode_sides(const std::vector<T>& front, const std::vector<T>& back, std::span<const BakedPart> parts,
                  json& extension, BlobWriter& out) {
  json list = json::array();
  auto piece = [&](const std::vector<T>& side, const BakedPart& part) {
    return out.add({reinterpret_cast<const uint8_t*>(side.data() + part.first), part.count * sizeof(T)});
  };
  for (const BakedPart& part : parts) {
    json entry{{"front", piece(front, part)}};
    if (!back.empty()) entry["back"] = piece(back, part);
    list.push_back(std::move(entry));
  }
  extension["parts"] = std::move(list);
}

// Where the vertices are the input's, as they come, their number says so.
void encode_inputs(const VertexPlacement& p, std::span<const BakedPart> parts, json& extension, BlobWriter& out) {
  if (p.input.empty()) return;
  extension["inputVertices"] = p.input_count;
  bool as_they_come = p.input.size() == p.input_count;
  for (size_t v = 0; v < p.input.size() && as_they_come; ++v) as_they_come = p.input[v] == v;
  for (size_t i = 0; i < parts.size() && !as_they_come; ++i)
    extension["parts"][i]["input"] =
        out.add({reinterpret_cast<const uint8_t*>(p.input.data() + parts[i].first), parts[i].count * 4});
}

json encode_view(const FixedView& v, BlobWriter& out) {
  const Vec3 e = v.camera.eye, at = v.camera.target;
  return {{"width", v.width},
          {"height", v.height},
          {"eye", {e.x, e.y, e.z}},
          {"target", {at.x, at.y, at.z}},
          {"fov", v.camera.fov},
          {"coverage", out.add({reinterpret_cast<const uint8_t*>(v.coverage.data()), v.coverage.size() * 4})}};
}

Result<FixedView> decode_view(const BlobReader& in, const json& object, size_t receivers, const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  FixedView view;
  auto width = read_count(object, "width", 1 << 16, where), height = read_count(object, "height", 1 << 16, where);
  for (const auto* count : {&width, &height})
    if (!*count) return count->error();
  if (*width < 1 || *height < 1 || *width * *height != receivers)
    return Error{where, "has not as many pixels as there are receivers"};
  view.width = int(*width), view.height = int(*height);
  auto eye = read_numbers(object, "eye", 3, where), target = read_numbers(object, "target", 3, where);
  for (const auto* list : {&eye, &target})
    if (!*list) return list->error();
  const auto fov = object.find("fov");
  if (fov == object.end() || !fov->is_number() || !(fov->get<double>() > 0 && fov->get<double>() < 180))
    return Error{where, "\"fov\" is out of range"};
  view.camera.eye = {(*eye)[0], (*eye)[1], (*eye)[2]};
  view.camera.target = {(*target)[0], (*target)[1], (*target)[2]};
  view.camera.fov = fov->get<float>();
  auto coverage = read_values<float>(in, object, "coverage", receivers, where);
  if (!coverage) return coverage.error();
  for (float c : *coverage)
    if (!(c >= 0 && c <= 1)) return Error{where, "a pixel's coverage is out of range"};
  view.coverage = std::move(*coverage);
  return view;
}

Result<void> check_receivers(std::span<const uint32_t> map, size_t receivers, const std::string& where) {
  for (uint32_t r : map)
    if (r != no_receiver && r >= receivers) return Error{where, "receiver " + std::to_string(r) + " is out of range"};
  return {};
}

// Both sides of all parts, one after another. `check` is given each piece; `nothing` stands where a part has no back.
template <class T>
Result<void> decode_sides(const BlobReader& in, const json& extension, T nothing, std::vector<T>& front,
                          std::vector<T>& back, std::vector<BakedPart>& parts, const std::string& where, auto check) {
  const auto list = extension.find("parts");
  if (list == extension.end() || !list->is_array()) return Error{where, "\"parts\" is missing"};
  for (const json& entry : *list) {
    auto node = read_count(entry, "node", 0x7fffffff, where),
         primitive = read_count(entry, "primitive", 0x7fffffff, where);
    for (const auto* count : {&node, &primitive})
      if (!*count) return count->error();
    const std::string place = where + ": node " + std::to_string(*node) + ", primitive " + std::to_string(*primitive);
    auto values = read_all_values<T>(in, entry, "front", place);
    if (!values) return values.error();
    if (auto ok = check(std::span<const T>(*values), place); !ok) return ok;
    BakedPart part{int(*node), int(*primitive), front.size(), values->size()};
    front.insert(front.end(), values->begin(), values->end());
    if (entry.contains("back")) {
      auto behind = read_values<T>(in, entry, "back", part.count, place);
      if (!behind) return behind.error();
      if (auto ok = check(std::span<const T>(*behind), place); !ok) return ok;
      back.resize(part.first, nothing);
      back.insert(back.end(), behind->begin(), behind->end());
    }
    parts.push_back(part);
  }
  if (!back.empty()) back.resize(front.size(), nothing);
  return {};
}

Result<Placement> decode_texels(const BlobReader& in, const json& extension, size_t receivers,
                                std::vector<BakedPart>& parts, const std::string& where) {
  const json& surface = extension["surface"];
  auto w = read_count(surface, "width", 1 << 16, where), h = read_count(surface, "height", 1 << 16, where);
  for (const auto* count : {&w, &h})
    if (!*count) return count->error();
  if (*w < 1 || *h < 1) return Error{where, "the atlas is empty"};
  auto texels = read_values<uint32_t>(in, surface, "texels", *w * *h, where);
  if (!texels) return texels.error();
  if (auto ok = check_receivers(*texels, receivers, where); !ok) return ok.error();
  TexelPlacement placement{int(*w), int(*h), std::move(*texels), {}, {}};
  auto inside = [&](std::span<const Vec2> places, const std::string& place) -> Result<void> {
    for (Vec2 p : places)
      if (!(p.x >= 0 && p.x <= float(*w) && p.y >= 0 && p.y <= float(*h)))
        return Error{place, "a place lies outside the atlas"};
    return {};
  };
  if (auto ok = decode_sides(in, extension, Vec2(0), placement.front, placement.back, parts, where, inside); !ok)
    return ok.error();
  return Placement(std::move(placement));
}

template <class T>
Result<Placement> decode_maps(const BlobReader& in, const json& extension, size_t receivers,
                              std::vector<BakedPart>& parts, const std::string& where) {
  T placement;
  auto check = [&](std::span<const uint32_t> map, const std::string& place) {
    return check_receivers(map, receivers, place);
  };
  if (auto ok = decode_sides(in, extension, no_receiver, placement.front, placement.back, parts, where, check); !ok)
    return ok.error();
  return Placement(std::move(placement));
}

Result<void> decode_inputs(const BlobReader& in, const json& extension, std::span<const BakedPart> parts,
                           VertexPlacement& p, const std::string& where) {
  if (!extension.contains("inputVertices")) return {};
  auto count = read_count(extension, "inputVertices", 0xfffffffe, where);
  if (!count) return count.error();
  p.input_count = uint32_t(*count);
  const json& list = extension["parts"];
  const bool as_they_come = std::none_of(list.begin(), list.end(), [](const json& e) { return e.contains("input"); });
  if (as_they_come) {
    if (*count != p.front.size())
      return Error{where, "\"inputVertices\" is " + std::to_string(*count) + " where there are " +
                              std::to_string(p.front.size()) + " vertices as they came"};
    p.input.resize(*count);
    std::iota(p.input.begin(), p.input.end(), 0u);
    return {};
  }
  for (size_t i = 0; i < parts.size(); ++i) {
    auto numbers = read_values<uint32_t>(in, list[i], "input", parts[i].count, where);
    if (!numbers) return numbers.error();
    for (uint32_t n : *numbers)
      if (n != no_receiver && n >= *count)
        return Error{where, "vertex " + std::to_string(n) + " of the input is not there"};
    p.input.insert(p.input.end(), numbers->begin(), numbers->end());
  }
  return {};
}

Result<Placement> decode_vertices(const BlobReader& in, const json& extension, size_t receivers,
                                  std::vector<BakedPart>& parts, const std::string& where) {
  auto placement = decode_maps<VertexPlacement>(in, extension, receivers, parts, where);
  if (!placement) return placement;
  if (auto ok = decode_inputs(in, extension, parts, std::get<VertexPlacement>(*placement), where); !ok)
    return ok.error();
  return placement;
}

Result<std::array<int, 3>> read_points(const json& object, const std::string& where) {
  const auto points = object.find("points");
  if (points == object.end() || !points->is_array() || points->size() != 3)
    return Error{where, "\"points\" is not three numbers"};
  std::array<int, 3> out{};
  for (size_t k = 0; k < 3; ++k) {
    const json& n = (*points)[k];
    if (!n.is_number_unsigned() || n.get<uint64_t>() < 1 || n.get<uint64_t>() > uint64_t(max_lattice_points))
      return Error{where, "an axis must have from 1 to " + std::to_string(max_lattice_points) + " points"};
    out[k] = n.get<int>();
  }
  return out;
}

}  // namespace

void encode_placement(const Placement& where, std::span<const BakedPart> parts, json& extension, BlobWriter& out) {
  extension["parts"] = json::array();
  std::visit(
      Overloaded{[&](const VertexPlacement& p) {
                   encode_sides(p.front, p.back, parts, extension, out), encode_inputs(p, parts, extension, out);
                 },
                 [&](const TexelPlacement& p) {
                   encode_sides(p.front, p.back, parts, extension, out);
                   const std::span<const uint8_t> texels(reinterpret_cast<const uint8_t*>(p.texels.data()),
                                                         p.texels.size() * 4);
                   extension["surface"] = {
                       {"kind", "texels"}, {"width", p.width}, {"height", p.height}, {"texels", out.add(texels)}};
                 },
                 [&](const PatchPlacement& p) {
                   encode_sides(p.front, p.back, parts, extension, out);
                   extension["surface"] = {{"kind", "patches"}};
                 },
                 [&](const LatticePlacement&) {}, [&](const ShellPlacement&) {},
                 [&](const FixedView& v) { extension["view"] = encode_view(v, out); }},
      where);
}

Result<Placement> decode_placement(const BlobReader& in, const json& extension, size_t receivers,
                                   std::vector<BakedPart>& parts, const std::string& where) {
  if (const auto view = extension.find("view"); view != extension.end()) {
    auto decoded = decode_view(in, *view, receivers, where + ": view");
    if (!decoded) return decoded.error();
    return Placement(std::move(*decoded));
  }
  const auto surface = extension.find("surface");
  if (surface == extension.end()) return decode_vertices(in, extension, receivers, parts, where);
  if (!surface->is_object() || !surface->contains("kind")) return Error{where, "\"surface\" has no kind"};
  const json& kind = (*surface)["kind"];
  if (kind == "texels") return decode_texels(in, extension, receivers, parts, where);
  if (kind == "patches") return decode_maps<PatchPlacement>(in, extension, receivers, parts, where);
  if (kind == "vertices") return decode_vertices(in, extension, receivers, parts, where);
  return Error{where, "receivers of this kind are not known to this program"};
}

json encode_points(const Lattice& l, int order, const std::vector<uint8_t>& valid, BlobWriter& out) {
  return {{"min", {l.min.x, l.min.y, l.min.z}},
          {"max", {l.max.x, l.max.y, l.max.z}},
          {"points", {l.nx, l.ny, l.nz}},
          {"order", order},
          {"valid", out.add(valid)}};
}

json encode_lattice(const Field& field, BlobWriter& out) {
  const auto& place = std::get<LatticePlacement>(field.where);
  json object = encode_dense(std::get<Transfer>(field.store), out);
  object.update(encode_points(place.lattice, std::get<IncidentRows>(field.rows).order, place.valid, out));
  return object;
}

Result<Lattice> decode_points(const json& object, int& order, const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  auto min = read_numbers(object, "min", 3, where), max = read_numbers(object, "max", 3, where);
  for (const auto* list : {&min, &max})
    if (!*list) return list->error();
  Lattice l;
  l.min = {(*min)[0], (*min)[1], (*min)[2]}, l.max = {(*max)[0], (*max)[1], (*max)[2]};
  if (!all_at_most(l.min, l.max)) return Error{where, "its box is empty"};
  auto points = read_points(object, where);
  if (!points) return points.error();
  l.nx = (*points)[0], l.ny = (*points)[1], l.nz = (*points)[2];
  auto bands = read_count(object, "order", size_t(max_sh_order), where);
  if (!bands) return bands.error();
  if (*bands < 1) return Error{where, "its order is 0"};
  order = int(*bands);
  return l;
}

Result<Field> decode_lattice(const BlobReader& in, const json& object, const LightBasis& light,
                             const std::string& where) {
  int order = 0;
  auto l = decode_points(object, order, where);
  if (!l) return l.error();
  Transfer transfer{light, sh_count(order), 1, l->count()};
  if (auto ok = decode_dense(in, object, transfer, where); !ok) return ok.error();
  auto valid = read_values<uint8_t>(in, object, "valid", l->count(), where);
  if (!valid) return valid.error();
  return Field{LatticePlacement{*l, std::move(*valid)}, std::move(transfer), IncidentRows{order}};
}

}  // namespace lambent

#include <lambent/baked/extension.h>
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh.h>
#include <lambent/core/half.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace lambent {

using nlohmann::json;

Result<std::vector<Lobe>> decode_lobes(const json& object, LobeKind kind, size_t most, const std::string& where) {
  const auto lobes = object.find("lobes");
  if (lobes == object.end() || !lobes->is_array() || lobes->size() > most)
    return Error{where, "\"lobes\" is not a list, or too long a one"};
  std::vector<Lobe> out;
  for (const json& l : *lobes) {
    if (!l.is_array() || l.size() != 4 || !std::all_of(l.begin(), l.end(), [](const json& x) { return x.is_number(); }))
      return Error{where, "a lobe is not four numbers"};
    const Lobe lobe{{l[0].get<float>(), l[1].get<float>(), l[2].get<float>()}, l[3].get<float>()};
    if (!is_lobe(kind, lobe)) return Error{where, "a lobe has no unit axis, or a sharpness out of range"};
    out.push_back(lobe);
  }
  return out;
}

namespace {

void encode_light(json& object, const LightBasis& light) {
  object["basis"] = "sh", object["order"] = light.order;
  if (!light.lobes.empty()) {
    json lobes = json::array();
    for (const Lobe& l : light.lobes) lobes.push_back({l.axis.x, l.axis.y, l.axis.z, l.sharpness});
    object["lobeKind"] = lobe_names[int(light.lobe_kind)];
    object["lobes"] = std::move(lobes);
  }
  if (!light.groups.empty()) object["groups"] = light.groups;
}

// Those of the light.
Result<void> decode_lobes(const json& object, LightBasis& light, const std::string& where) {
  const auto name = std::find_if(std::begin(lobe_names), std::end(lobe_names),
                                 [&](const char* n) { return object.contains("lobeKind") && object["lobeKind"] == n; });
  if (name == std::end(lobe_names)) return Error{where, "the kind of lobes is not known to this program"};
  const LobeKind kind = LobeKind(name - std::begin(lobe_names));
  auto lobes = decode_lobes(object, kind, max_columns, where);
  if (!lobes) return lobes.error();
  light.lobe_kind = kind, light.lobes = std::move(*lobes);
  return {};
}

Result<LightBasis> decode_light(const json& object, const std::string& where) {
  LightBasis light;
  if (!object.contains("basis") || object["basis"] != "sh")
    return Error{where, "the light basis is not known to this program"};
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  light.order = int(*order);
  if (object.contains("lobes"))
    if (auto ok = decode_lobes(object, light, where); !ok) return ok.error();
  if (const auto groups = object.find("groups"); groups != object.end()) {
    if (!groups->is_array() || groups->size() > max_columns ||
        !std::all_of(groups->begin(), groups->end(), [](const json& x) { return x.is_string(); }))
      return Error{where, "\"groups\" is not a list of names, or too long a one"};
    light.groups = groups->get<std::vector<std::string>>();
  }
  if (light.count() < 1 || light.count() > max_columns) return Error{where, "the transfer has no columns, or too many"};
  return light;
}

// Precision, channels and the bulk data of a store whose light, rows and receivers are set.
template <class T>
json encode_values(const T& t, BlobWriter& out) {
  return {{"channels", t.channels},
          {"precision", t.precision == Precision::half ? "half" : "single"},
          {"bufferView", out.add(t.data, 64)}};
}
template <class T>
Result<void> decode_values(const BlobReader& in, const json& object, T& t, const std::string& where) {
  const auto precision = object.find("precision");
  const bool half = precision != object.end() && *precision == "half";
  if (!half && (precision == object.end() || *precision != "single"))
    return Error{where, "\"precision\" must be half or single"};
  auto channels = read_count(object, "channels", 3, where);
  if (!channels) return channels.error();
  if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" is out of range"};
  t.channels = int(*channels), t.precision = half ? Precision::half : Precision::single;
  auto view = read_view(in, object, "bufferView", where);
  if (!view) return view.error();
  const std::span<const uint8_t> data = view->bytes;
  if (data.size() != t.bytes())
    return Error{where, "the transfer holds " + std::to_string(data.size()) + " bytes where its header makes " +
                            std::to_string(t.bytes())};
  if (reinterpret_cast<uintptr_t>(data.data()) % t.value_bytes()) return Error{where, "the transfer is not aligned"};
  t.data = data;
  t.storage = std::make_shared<MappedFile>(std::move(view->file));
  return {};
}

json encode(const Transfer& t, BlobWriter& out) {
  json object = encode_values(t, out);
  encode_light(object, t.light);
  return object;
}

json encode(const CpcaTransfer& t, BlobWriter& out) {
  json object{{"channels", t.channels}, {"precision", "half"}, {"bufferView", out.add(bytes_of(t.vectors), 64)}};
  encode_light(object, t.light);
  object["cpca"] = {{"clusters", t.clusters},
                    {"rank", t.rank},
                    {"clusterOf", out.add(bytes_of(t.cluster_of))},
                    {"weights", out.add(bytes_of(t.weights))}};
  return object;
}

Result<CpcaTransfer> decode_cpca(const json& transfer, const std::string& where) {
  CpcaTransfer c;
  const json& object = transfer["cpca"];
  auto clusters = read_count(object, "clusters", size_t(max_cpca_clusters), where),
       rank = read_count(object, "rank", size_t(max_cpca_rank), where),
       channels = read_count(transfer, "channels", 3, where);
  for (const auto* count : {&clusters, &rank, &channels})
    if (!*count) return count->error();
  if (*clusters < 1) return Error{where, "there are no clusters"};
  if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" is out of range"};
  c.clusters = int(*clusters), c.rank = int(*rank), c.channels = int(*channels);
  return c;
}

// Light, rows and receivers are set.
Result<void> decode_clusters(const BlobReader& in, const json& transfer, CpcaTransfer& c, const std::string& where) {
  const json& object = transfer["cpca"];
  if (c.receivers > in.buffers.room() / 2) return Error{where, "there is no room for so many receivers"};
  auto vectors = read_values<float>(in, transfer, "bufferView",
                                    size_t(c.clusters) * size_t(1 + c.rank) * c.receiver_values(), where);
  if (!vectors) return vectors.error();
  if (!std::all_of(vectors->begin(), vectors->end(), [](float v) { return std::isfinite(v); }))
    return Error{where, "a cluster's vector is not finite"};
  auto cluster_of = read_values<uint16_t>(in, object, "clusterOf", c.receivers, where);
  if (!cluster_of) return cluster_of.error();
  for (uint16_t k : *cluster_of)
    if (k >= c.clusters) return Error{where, "cluster " + std::to_string(k) + " does not exist"};
  auto weights = read_values<uint16_t>(in, object, "weights", c.receivers * size_t(c.rank), where);
  if (!weights) return weights.error();
  for (uint16_t w : *weights)
    if (!std::isfinite(half_to_float(w))) return Error{where, "a cluster's weight is not finite"};
  c.vectors = std::move(*vectors), c.cluster_of = std::move(*cluster_of), c.weights = std::move(*weights);
  return {};
}

json encode(const ZonalTransfer& t, BlobWriter& out) {
  json object = encode_values(t, out);
  encode_light(object, {.order = t.order});
  object["lobeCount"] = t.lobes;
  return object;
}

Result<ZonalTransfer> decode_zonal(const json& object, const std::string& where) {
  auto light = decode_light(object, where);
  if (!light) return light.error();
  auto lobes = read_count(object, "lobeCount", size_t(max_stored_lobes), where);
  if (!lobes) return lobes.error();
  if (*lobes < 1) return Error{where, "there are no lobes"};
  if (light->order < 1 || light->count() != size_t(sh_count(light->order)))
    return Error{where, "zonal transfer is of spherical harmonics alone"};
  ZonalTransfer zonal;
  zonal.order = light->order, zonal.lobes = int(*lobes);
  return zonal;
}

json encode(const HaarTransfer& t, BlobWriter& out) { return encode_wavelets(t, out); }
json encode(const FactoredTransfer& t, BlobWriter& out) { return encode(t.visibility, out); }

json encode(const Visibility& v, BlobWriter& out) {
  std::vector<uint8_t> lengths;
  for (size_t r = 0; r < v.receivers; ++r) append_varint(lengths, v.begin[r + 1] - v.begin[r]);
  json object{{"cube", v.size}, {"bits", v.bits}, {"bufferView", out.add(v.data, 64)}};
  object["lengths"] = out.add_copy(lengths);
  return object;
}

Result<Visibility> decode_visibility_store(const BlobReader& in, const json& object, size_t receivers,
                                           const std::string& where) {
  Visibility v;
  auto size = read_count(object, "cube", size_t(max_cube_size), where),
       bits = read_count(object, "bits", size_t(max_visibility_bits), where);
  for (const auto* count : {&size, &bits})
    if (!*count) return count->error();
  if (!is_cube_size(int(*size)))
    return Error{where, "\"cube\" must be a multiple of 16 up to " + std::to_string(max_cube_size)};
  if (*bits < 1) return Error{where, "\"bits\" is 0"};
  auto data = read_view(in, object, "bufferView", where), lengths = read_view(in, object, "lengths", where);
  for (const auto* view : {&data, &lengths})
    if (!*view) return view->error();
  const std::span<const uint8_t> records = data->bytes, numbers = lengths->bytes;
  if (receivers > numbers.size()) return Error{where, "there are fewer lengths than receivers"};
  v.size = int(*size), v.bits = int(*bits), v.receivers = receivers, v.data = records;
  v.begin.reserve(receivers + 1), v.begin.push_back(0);
  size_t at = 0;
  for (size_t r = 0; r < receivers; ++r) {
    uint64_t length = 0;
    if (!read_varint(numbers, at, length) || length > records.size() - v.begin.back())
      return Error{where, "the length of receiver " + std::to_string(r) + " is broken"};
    v.begin.push_back(v.begin.back() + length);
  }
  if (at != numbers.size()) return Error{where, "there are more lengths than receivers"};
  if (auto ok = check_visibility(v, where); !ok) return ok.error();
  v.storage = std::make_shared<MappedFile>(std::move(data->file));
  return v;
}

json encode(const IndirectTransfer& t, BlobWriter& out) { return encode_indirect(t, out); }

// Rows of a transfer matrix, as its header says.
Result<int> read_rows(const json& transfer, const std::string& where) {
  auto count = read_count(transfer, "rows", 2 * sh_count(max_sh_order), where);
  if (!count) return count.error();
  if (*count < 1) return Error{where, "the transfer has no rows"};
  return int(*count);
}

Result<Outgoing> decode_last_reflection(const BlobReader& in, const json& transfer, int rows, size_t receivers,
                                        const std::string& where) {
  if (!transfer.contains("outgoing")) return Error{where, "\"outgoing\" is missing"};
  return decode_outgoing(in, transfer["outgoing"], rows, receivers, where + ": outgoing");
}

Result<Field> decode_blocks(const BlobReader& in, const json& t, size_t receivers, const std::string& where) {
  auto visibility = decode_visibility_store(in, t, receivers, where);
  if (!visibility) return visibility.error();
  return Field{{}, std::move(*visibility), SightRows{}};
}

Result<Field> decode_lobes_of_rows(const BlobReader& in, const json& t, size_t receivers, const std::string& where) {
  auto zonal = decode_zonal(t, where);
  if (!zonal) return zonal.error();
  zonal->receivers = receivers;
  Field field{{}, Store{}, DiffuseRows{}};
  if (t.contains("outgoing")) {
    auto rows = read_rows(t, where);
    if (!rows) return rows.error();
    zonal->rows = *rows;
    auto outgoing = decode_last_reflection(in, t, *rows, receivers, where);
    if (!outgoing) return outgoing.error();
    field.rows = std::move(*outgoing);
  }
  if (auto ok = decode_values(in, t, *zonal, where); !ok) return ok.error();
  field.store = std::move(*zonal);
  if (t.contains("fitErrors")) {
    auto errors = read_values<float>(in, t, "fitErrors", receivers, where);
    if (!errors) return errors.error();
    if (!std::all_of(errors->begin(), errors->end(), [](float e) { return std::isfinite(e); }))
      return Error{where, "the error of a fit is not finite"};
    field.fit_errors = std::move(*errors);
  }
  return field;
}

Result<Field> decode_factors(const BlobReader& in, const json& t, size_t receivers, const std::string& where) {
  if (!t.contains("outgoing") || !t["outgoing"].is_object()) return Error{where, "\"outgoing\" is missing"};
  auto order = read_count(t["outgoing"], "order", size_t(max_incident_order), where + ": outgoing");
  if (!order) return order.error();
  FactoredTransfer factored{{}, int(*order)};
  auto light = decode_light(t, where);
  if (!light) return light.error();
  if (light->count() != size_t(sh_count(light->order)) || t.contains("cpca"))
    return Error{where, "visibility as a factor is of harmonics alone, with one row"};
  factored.visibility.light = std::move(*light), factored.visibility.receivers = receivers;
  if (auto ok = decode_values(in, t, factored.visibility, where); !ok) return ok.error();
  auto outgoing = decode_last_reflection(in, t, sh_count(int(*order)), receivers, where);
  if (!outgoing) return outgoing.error();
  if (outgoing->kind != OutgoingKind::map || factored.light_order() < 1 || factored.visibility.channels != 1)
    return Error{where,
                 "visibility as a factor has too few bands, or a last reflection of another kind, or more than "
                 "one channel"};
  return Field{{}, std::move(factored), std::move(*outgoing)};
}

// Dense or in clusters, diffuse or a matrix.
Result<Field> decode_rows_of_columns(const BlobReader& in, const json& t, bool matrix, size_t receivers,
                                     const std::string& where) {
  Field field{{}, Store{}, DiffuseRows{}};
  int rows = 1;
  if (matrix) {
    auto count = read_rows(t, where);
    if (!count) return count.error();
    auto outgoing = decode_last_reflection(in, t, rows = *count, receivers, where);
    if (!outgoing) return outgoing.error();
    field.rows = std::move(*outgoing);
  }
  if (t.contains("directional")) {
    const auto kind = decode_directional(t, where);
    if (!kind) return kind.error();
    if (matrix && *kind != DirectionalKind::none) return Error{where, "directional light is of diffuse transfer alone"};
    if (*kind != DirectionalKind::none) field.rows = DirectionalRows{*kind}, rows = directional_rows(*kind);
  }
  auto light = decode_light(t, where);
  if (!light) return light.error();
  if (t.contains("cpca")) {
    auto clusters = decode_cpca(t, where + ": cpca");
    if (!clusters) return clusters.error();
    clusters->light = std::move(*light), clusters->receivers = receivers, clusters->rows = rows;
    if (auto ok = decode_clusters(in, t, *clusters, where + ": cpca"); !ok) return ok.error();
    field.store = std::move(*clusters);
  } else {
    Transfer dense{std::move(*light), rows, 1, receivers};
    if (auto ok = decode_values(in, t, dense, where); !ok) return ok.error();
    field.store = std::move(dense);
  }
  return field;
}

const char* kind_of(const Field& field) {
  if (std::holds_alternative<Visibility>(field.store)) return "blocks";
  if (std::holds_alternative<HaarTransfer>(field.store)) return "wavelets";
  if (std::holds_alternative<IndirectTransfer>(field.store)) return "indirect";
  if (std::holds_alternative<FactoredTransfer>(field.store)) return "factors";
  if (std::holds_alternative<ZonalTransfer>(field.store)) return "zonal";
  return outgoing_of(field) ? "matrix" : "diffuse";
}

}  // namespace

Result<DirectionalKind> decode_directional(const json& t, const std::string& where) {
  const auto name = t.find("directional");
  if (name == t.end()) return DirectionalKind::none;
  const auto kind = directional_kind(name->is_string() ? name->get<std::string>() : "");
  if (!kind) return Error{where, "directional light \"" + name->dump() + "\" is not known to this program"};
  return *kind;
}

json encode_dense(const Transfer& t, BlobWriter& out) { return encode_values(t, out); }
Result<void> decode_dense(const BlobReader& in, const json& object, Transfer& t, const std::string& where) {
  return decode_values(in, object, t, where);
}

json encode_transfer(const Field& field, BlobWriter& out) {
  json t = std::visit([&](const auto& store) { return encode(store, out); }, field.store);
  t["kind"] = kind_of(field), t["receivers"] = receivers_of(field.store);
  if (const DirectionalKind kind = directional_of(field); kind != DirectionalKind::none)
    t["directional"] = directional_name(kind);
  if (const Outgoing* outgoing = outgoing_of(field)) {
    if (!std::holds_alternative<FactoredTransfer>(field.store)) t["rows"] = rows_of(field.store);
    t["outgoing"] = encode_outgoing(*outgoing, out);
  }
  if (!field.fit_errors.empty()) t["fitErrors"] = out.add(bytes_of(field.fit_errors));
  return t;
}

Result<Field> decode_transfer(const BlobReader& in, const json& t, const std::string& where) {
  const std::string kind = t.contains("kind") && t["kind"].is_string() ? t["kind"].get<std::string>() : "";
  auto receivers = read_count(t, "receivers", 0xfffffffe, where);
  if (!receivers) return receivers.error();
  if (kind != "diffuse" && kind != "indirect" && t.contains("directional") && t["directional"] != "none")
    return Error{where, "directional light is of diffuse transfer alone"};
  if (kind == "indirect") return decode_indirect(in, t, *receivers, where);
  if (kind == "blocks") return decode_blocks(in, t, *receivers, where);
  if (kind == "wavelets") {
    auto wavelets = decode_wavelets(in, t, *receivers, where);
    if (!wavelets) return wavelets.error();
    return Field{{}, std::move(*wavelets), DiffuseRows{}};
  }
  if (kind == "zonal") return decode_lobes_of_rows(in, t, *receivers, where);
  if (kind == "factors") return decode_factors(in, t, *receivers, where);
  if (kind == "matrix" || kind == "diffuse") return decode_rows_of_columns(in, t, kind == "matrix", *receivers, where);
  return Error{where, "transfer of kind \"" + kind + "\" is not known to this program"};
}

}  // namespace lambent

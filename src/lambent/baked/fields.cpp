#include <lambent/baked/extension.h>

#include <lambent/basis/sh.h>
#include <lambent/core/check.h>

#include <algorithm>

namespace lambent {

using nlohmann::json;

namespace {

constexpr size_t most_terms = 65;  // direct light and 64 bounces

bool is_surface(const Placement& where) { return !std::holds_alternative<FixedView>(where); }

// Kinds that stand on vertices alone, and meanings that other placements have.
Result<void> check_placement(Field& field, const std::string& where) {
  const bool at_vertices = std::holds_alternative<VertexPlacement>(field.where);
  if (std::holds_alternative<ZonalTransfer>(field.store) && !at_vertices)
    return Error{where, "zonal transfer is baked at vertices"};
  if (std::holds_alternative<Visibility>(field.store) && !at_vertices)
    return Error{where, "visibility in blocks is baked at vertices"};
  if (std::holds_alternative<IndirectTransfer>(field.store) && !is_surface(field.where))
    return Error{where, "direct-to-indirect transport is baked on surfaces"};
  if (!is_surface(field.where)) {
    if (!std::holds_alternative<DiffuseRows>(field.rows)) return Error{where, "a fixed view has one row a pixel"};
    field.rows = PixelRows{};
  }
  if (!is_consistent(field)) return Error{where, "receivers and rows do not fit one another"};
  return {};
}

Result<std::vector<Transfer>> read_terms(const BlobReader& in, const json& list, const Field& surface,
                                         const std::string& where) {
  if (!list.is_array() || list.size() > most_terms) return Error{where, "\"terms\" is not a list, or too long a one"};
  std::vector<Transfer> terms;
  for (const json& object : list) {
    Transfer t{light_of(surface.store), rows_of(surface.store), 1, receivers_of(surface.store)};
    if (!object.is_object()) return Error{where, "a term is not an object"};
    if (auto ok = decode_dense(in, object, t, where + ": terms"); !ok) return ok.error();
    terms.push_back(std::move(t));
  }
  return terms;
}

}  // namespace

bool has_extension(const json& document) {
  const auto extensions = document.find("extensions");
  return extensions != document.end() && extensions->is_object() && extensions->contains(extension_name);
}

namespace {

// Fit for one line.
std::string short_name(std::string text) {
  constexpr size_t longest = 60;
  if (text.size() > longest) text.resize(longest);
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

}  // namespace

json written_state(const json& document) {
  const auto member = [](const json& parent, auto key) { return parent.contains(key) ? parent.at(key) : json(); };
  json written{{"bufferViews", document.contains("bufferViews") ? document["bufferViews"].size() : 0}};
  if (const auto generator = document.find("asset"); generator != document.end() && generator->is_object())
    if (const json& name = member(*generator, "generator"); name.is_string()) written["generator"] = name;
  const auto buffers = document.find("buffers");
  if (buffers != document.end() && buffers->is_array() && !buffers->empty() && buffers->front().is_object())
    written["byteLength"] = member(buffers->front(), "byteLength");
  return written;
}

std::optional<Error> find_rewritten(const json& document, const std::string& path) {
  const json now = written_state(document);
  json then;
  if (has_extension(document)) {
    const json& extension = document["extensions"][extension_name];
    if (!extension.is_object() || !extension.contains("written") || !extension["written"].is_object()) return {};
    then = extension["written"];
    if (then.value("bufferViews", json()) == now["bufferViews"] &&
        then.value("byteLength", json()) == now.value("byteLength", json()))
      return {};
  } else {
    const auto used = document.find("extensionsUsed");
    if (used == document.end() || !used->is_array() ||
        std::find(used->begin(), used->end(), json(extension_name)) == used->end())
      return {};
  }
  const json name = now.value("generator", json());
  const bool other = name.is_string() && (!then.is_object() || then.value("generator", json()) != name);
  return Error{path, "was rewritten by " + (other ? short_name(name.get<std::string>()) + ", " : std::string()) +
                         "a tool that does not know LAMBENT_transfer; bake again"};
}

Result<BakedFields> read_fields(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return read_fields(*file, path);
}

Result<BakedFields> read_fields(const MappedFile& file, const std::string& path) {
  auto buffers = GltfBuffers::open(file, path, folder_of(path));
  if (!buffers) return buffers.error();
  return read_fields(*buffers, path);
}

Result<BakedFields> read_fields(const GltfBuffers& buffers, const std::string& path) {
  const json& document = buffers.json();
  if (auto rewritten = find_rewritten(document, path)) return *rewritten;
  if (!has_extension(document))
    return Error{path, "is not a baked file: it has no LAMBENT_transfer extension (make one with `lambent bake`)"};
  const json& extension = document["extensions"][extension_name];
  const std::string where = path + ": " + extension_name;
  auto version = read_count(extension, "version", 0x7fffffff, where);
  if (!version) return version.error();
  if (*version != size_t(baked_file_version))
    return Error{path, "was baked with file version " + std::to_string(*version) + "; this program reads version " +
                           std::to_string(baked_file_version)};
  if (extension.contains("packed"))
    return Error{path, "is packed for browsers (`lambent export --web --pack`): read the file that it was made from"};
  const auto t = extension.find("transfer");
  if (t == extension.end() || !t->is_object()) return Error{where, "\"transfer\" is missing"};
  const BlobReader in{buffers};
  auto surface = decode_transfer(in, *t, where);
  if (!surface) return surface.error();
  BakedFields fields{std::move(*surface), {}, {}, {}, {}, "{}"};
  auto placement = decode_placement(in, extension, receivers_of(fields.surface.store), fields.parts, where);
  if (!placement) return placement.error();
  fields.surface.where = std::move(*placement);
  if (auto ok = check_placement(fields.surface, where); !ok) return ok.error();
  // Stores of columns alone have light in free space, and terms, by the same ones.
  const bool by_columns = light_of(fields.surface.store).count() > 0;
  if (const auto object = extension.find("lattice"); object != extension.end() && by_columns) {
    auto lattice = decode_lattice(in, *object, light_of(fields.surface.store), where + ": lattice");
    if (!lattice) return lattice.error();
    fields.more.push_back(std::move(*lattice));
  }
  if (const auto object = extension.find("shells"); object != extension.end()) {
    auto shells = decode_shells(in, *object, where + ": shells");
    if (!shells) return shells.error();
    for (Field& field : *shells) fields.more.push_back(std::move(field));
  }
  if (const auto list = extension.find("terms"); list != extension.end() && by_columns) {
    auto terms = read_terms(in, *list, fields.surface, where);
    if (!terms) return terms.error();
    fields.terms = std::move(*terms);
  }
  if (const auto list = extension.find("excluded"); list != extension.end()) {
    if (!list->is_array() || !std::all_of(list->begin(), list->end(), [](const json& v) { return v.is_string(); }))
      return Error{where, "\"excluded\" is not a list of names"};
    fields.excluded = list->get<std::vector<std::string>>();
  }
  if (const auto provenance = extension.find("provenance"); provenance != extension.end())
    fields.provenance = provenance->dump(-1, ' ', false, json::error_handler_t::replace);
  return fields;
}

json encode_fields(const BakedFields& fields, BlobWriter& out) {
  LAMBENT_CHECK(is_consistent(fields.surface));
  json extension{{"version", baked_file_version}, {"transfer", encode_transfer(fields.surface, out)}};
  encode_placement(fields.surface.where, fields.parts, extension, out);
  const Field *hidden = nullptr, *shining = nullptr, *reflecting = nullptr;
  for (const Field& field : fields.more) {
    LAMBENT_CHECK(is_consistent(field));
    if (std::holds_alternative<ShellPlacement>(field.where)) {
      (std::holds_alternative<HiddenRows>(field.rows) ? hidden
       : light_of(field.store).order > 0              ? reflecting
                                                      : shining) = &field;
      continue;
    }
    LAMBENT_CHECK(light_of(field.store).count() == light_of(fields.surface.store).count());
    extension["lattice"] = encode_lattice(field, out);
  }
  LAMBENT_CHECK(hidden || (!shining && !reflecting));
  if (hidden) extension["shells"] = encode_shells(*hidden, shining, reflecting, out);
  for (const Transfer& term : fields.terms) {
    LAMBENT_CHECK(term.receivers == receivers_of(fields.surface.store) && term.rows == rows_of(fields.surface.store));
    extension["terms"].push_back(encode_dense(term, out));
  }
  if (!fields.excluded.empty()) extension["excluded"] = fields.excluded;
  extension["provenance"] = json::parse(fields.provenance, nullptr, false);
  LAMBENT_CHECK(!extension["provenance"].is_discarded());
  return extension;
}

}  // namespace lambent

// EXT_meshopt_compression, KHR_meshopt_compression. How far a stream can expand: in blocks of 256 elements a byte of
// the attribute codec takes at least 4 bytes; a triangle takes at least one, and so does an index of a sequence.
#include <lambent/scene/gltf_compressed.h>
#include <lambent/core/uri.h>
#include <lambent/scene/gltf_extensions.h>
#include <lambent/scene/meshopt_v1.h>

#include <meshoptimizer.h>

#include <algorithm>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr const char* names[] = {"KHR_meshopt_compression", "EXT_meshopt_compression"};

constexpr uint8_t attribute_codec = 0xa0;

struct Stream {
  std::span<const uint8_t> bytes;
  size_t count = 0, stride = 0;
  std::string mode, filter;
  int version() const { return bytes.empty() ? 0 : bytes[0] - attribute_codec; }  // of the attribute codec
};

bool read_stream(GltfCheck& check, const GltfDocument& document, const Json& json, const GltfWhere& where, Stream& s) {
  constexpr uint64_t largest_stride = 256;
  const auto buffer = check.index(json, "buffer", document.buffers.size(), where);
  const uint64_t offset = check.integer(json, "byteOffset", 0, UINT64_MAX, where),
                 length = check.integer(json, "byteLength", 0, UINT64_MAX, where);
  s.count = check.integer(json, "count", 0, uint64_t{1} << 32, where);
  s.stride = check.integer(json, "byteStride", 0, largest_stride + 1, where);
  s.mode = check.text(json, "mode", where), s.filter = check.text(json, "filter", where);
  if (s.filter.empty()) s.filter = "NONE";
  if (!check.ok()) return false;
  if (!buffer) return check.fail(where, "its compressed stream names no buffer");
  const std::span<const uint8_t> bytes = document.buffers[*buffer];
  if (offset > bytes.size() || length > bytes.size() - offset)
    return check.fail(where, "its compressed stream reaches past the end of buffer " + std::to_string(*buffer));
  s.bytes = bytes.subspan(offset, length);
  return true;
}

// What the extensions ask of a stream: the decoder takes it for granted. Empty where all is well.
std::string broken_rule(const Stream& s) {
  const bool indices = s.mode == "TRIANGLES" || s.mode == "INDICES";
  if (!indices && s.mode != "ATTRIBUTES") return "mode " + in_quotes(s.mode) + " does not exist";
  if (s.count == 0) return "holds nothing";
  if (indices && s.stride != 2 && s.stride != 4)
    return "indices of " + std::to_string(s.stride) + " bytes do not exist";
  if (!indices && (s.stride == 0 || s.stride % 4 != 0)) return "its byteStride is not a multiple of 4";
  if (s.mode == "TRIANGLES" && s.count % 3 != 0) return "its count is not a multiple of 3";
  const bool filtered = s.filter != "NONE";
  if (indices && filtered) return "indices have a filter";
  if (s.filter == "OCTAHEDRAL" && s.stride != 4 && s.stride != 8) return "OCTAHEDRAL goes with a stride of 4 or 8";
  if (s.filter == "COLOR" && s.stride != 4 && s.stride != 8) return "COLOR goes with a stride of 4 or 8";
  if (s.filter == "QUATERNION" && s.stride != 8) return "QUATERNION goes with a stride of 8";
  const uint64_t expansion = s.version() == 1 ? 1024 : 64;
  const uint64_t most = s.mode == "ATTRIBUTES" ? s.bytes.size() * expansion / s.stride
                      : s.mode == "TRIANGLES"  ? s.bytes.size() * uint64_t{3}
                                               : s.bytes.size();
  if (s.count > most) return "is broken: too few bytes for its count";
  return {};
}

// What of streams is not read. Empty where all is.
std::string unread_kind(const Stream& s) {
  constexpr int versions = 16;
  if (s.mode == "ATTRIBUTES" && s.version() > 1 && s.version() < versions)
    return "version " + std::to_string(s.version()) + " of the attribute codec";
  for (const char* known : {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"})
    if (s.filter == known) return {};
  return "the filter " + in_quotes(s.filter);
}

bool decode(const Stream& s, std::vector<uint8_t>& out) {
  out.resize(s.count * s.stride);
  if (s.mode == "TRIANGLES")
    return meshopt_decodeIndexBuffer(out.data(), s.count, s.stride, s.bytes.data(), s.bytes.size()) == 0;
  if (s.mode == "INDICES")
    return meshopt_decodeIndexSequence(out.data(), s.count, s.stride, s.bytes.data(), s.bytes.size()) == 0;
  if (s.version() == 1) {
    if (!decode_attributes_v1(s.bytes, s.count, s.stride, out)) return false;
  } else if (meshopt_decodeVertexBuffer(out.data(), s.count, s.stride, s.bytes.data(), s.bytes.size()) != 0) {
    return false;
  }
  if (s.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), s.count, s.stride);
  if (s.filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), s.count, s.stride);
  if (s.filter == "COLOR") decode_color_filter(out, s.stride);
  if (s.filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), s.count, s.stride);
  return true;
}

bool decode_view(GltfCheck& check, GltfDocument& document, size_t index, const char* name, DecodeBudget& budget) {
  Json& view = document.json["bufferViews"][index];
  const GltfWhere where{"buffer view", index};
  const Json* extensions = check.object(view, "extensions", where);
  const Json* json = extensions ? check.object(*extensions, name, where) : nullptr;
  if (!json) return check.ok();
  Stream stream;
  if (!read_stream(check, document, *json, where, stream)) return false;
  const auto refuse = [&](const std::string& why) { return check.fail(where, std::string(name) + ": " + why); };
  if (const std::string kind = unread_kind(stream); !kind.empty()) {
    GltfCheck fallback("");
    if (read_buffer_view(fallback, document, index, nullptr).empty()) return refuse(kind + " is not supported");
    take_extension(view, name);
    return true;
  }
  if (const std::string why = broken_rule(stream); !why.empty()) return refuse(why);
  if (!budget.take(stream.count * stream.stride)) return refuse("the file expands to more than it may");
  std::vector<uint8_t> bytes;
  if (!decode(stream, bytes)) return refuse("is broken");
  view["byteOffset"] = 0u, view["byteLength"] = bytes.size();
  view["buffer"] = add_buffer(document, std::move(bytes));
  take_extension(view, name);
  return true;
}

}  // namespace

std::vector<bool> find_placeholders(const GltfDocument& document) {
  std::vector<bool> placeholders(gltf_count(document.json, "buffers"));
  for (const char* name : names) {
    for (size_t i = 0; i < placeholders.size(); ++i) {
      const Json* extension = find_extension(gltf_item(document.json, "buffers", i), name);
      if (extension && extension->is_object() && extension->value("fallback", Json()) == true) placeholders[i] = true;
    }
    for (size_t i = 0; i < gltf_count(document.json, "bufferViews"); ++i) {
      const Json& view = gltf_item(document.json, "bufferViews", i);
      GltfCheck check("");
      const auto buffer = check.index(view, "buffer", placeholders.size(), {});
      if (buffer && find_extension(view, name)) placeholders[*buffer] = true;
    }
  }
  return placeholders;
}

bool decode_meshopt_views(GltfCheck& check, GltfDocument& document, DecodeBudget& budget) {
  for (const char* name : names) {
    for (size_t i = 0; i < gltf_count(document.json, "bufferViews"); ++i)
      if (!decode_view(check, document, i, name, budget)) return false;
    for (size_t i = 0; i < gltf_count(document.json, "buffers"); ++i) take_extension(document.json["buffers"][i], name);
    drop_extension_name(document.json, name);
  }
  return true;
}

}  // namespace lambent

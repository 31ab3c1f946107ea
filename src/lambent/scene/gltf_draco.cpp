// KHR_draco_mesh_compression. Draco's decoder takes memory for the counts that a stream states: they are looked at
// first. A face costs the decoder some hundred bytes, and as much again for each attribute with seams of its own.
#include <lambent/scene/gltf_compressed.h>
#include <lambent/scene/gltf_extensions.h>

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include <map>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr const char* name = "KHR_draco_mesh_compression";

// Faces and vertices that a stream may state: a million, and 256 for each byte.
constexpr uint64_t free_faces = uint64_t{1} << 20, faces_a_byte = 256;
constexpr unsigned most_seams = 16;

uint16_t version_of(int major, int minor) { return uint16_t(major << 8 | minor); }

// The next count of a stream; older streams have plain integers.
bool read_count(draco::DecoderBuffer& buffer, bool plain, uint32_t& count) {
  return plain ? buffer.Decode(&count) : draco::DecodeVarint(&count, &buffer);
}

// A decoder that looks before it takes memory.
template <class Base>
class Bounded : public Base {
 public:
  Bounded(uint64_t most, DecodeBudget& budget) : most_(most), budget_(budget) {}
  bool too_large() const { return too_large_; }

 protected:
  bool DecodeConnectivity() override {
    draco::DecoderBuffer ahead = *this->buffer();
    const uint16_t version = this->bitstream_version();
    uint32_t first = 0, second = 0, skipped = 0;
    uint8_t seams = 0;
    if constexpr (std::is_same_v<Base, draco::MeshEdgebreakerDecoder>) {
      const bool plain = version < version_of(2, 0);
      if (version < version_of(2, 2) && !read_count(ahead, plain, skipped)) return false;
      if (!read_count(ahead, plain, first) || !read_count(ahead, plain, second) || !ahead.Decode(&seams)) return false;
    } else {
      const bool plain = version < version_of(2, 2);
      if (!read_count(ahead, plain, first) || !read_count(ahead, plain, second)) return false;
    }
    too_large_ = first > most_ || second > most_ || seams > most_seams;
    return !too_large_ && Base::DecodeConnectivity();
  }

  bool DecodeAllAttributes() override {
    const draco::PointCloud& points = *this->point_cloud();
    uint64_t bytes = 0;
    for (int i = 0; i < points.num_attributes(); ++i) {
      const draco::PointAttribute& a = *points.attribute(i);
      bytes += uint64_t(points.num_points()) * (uint64_t(a.byte_stride()) + a.num_components() * sizeof(int32_t));
    }
    too_large_ = !budget_.take(bytes);
    return !too_large_ && Base::DecodeAllAttributes();
  }

 private:
  uint64_t most_;
  DecodeBudget& budget_;
  bool too_large_ = false;
};

template <class Decoder>
std::string decode_with(std::span<const uint8_t> bytes, DecodeBudget& budget, draco::Mesh& mesh) {
  Bounded<Decoder> decoder(free_faces + faces_a_byte * bytes.size(), budget);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const draco::DecoderOptions options;
  if (decoder.Decode(options, &buffer, &mesh).ok()) return {};
  return decoder.too_large() ? "states more than its bytes may expand to" : "is broken";
}

// "" or what is wrong.
std::string decode_mesh(std::span<const uint8_t> bytes, DecodeBudget& budget, draco::Mesh& mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::DracoHeader header;
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) return "is broken";
  if (header.encoder_type != draco::TRIANGULAR_MESH) return "is no mesh";
  try {
    if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING)
      return decode_with<draco::MeshSequentialDecoder>(bytes, budget, mesh);
    if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING)
      return decode_with<draco::MeshEdgebreakerDecoder>(bytes, budget, mesh);
  } catch (const std::exception&) {  // std::bad_alloc, std::length_error of its containers
    return "is broken";
  }
  return "is of a method that does not exist";
}

// Values of all points, one after another, elements at multiples of `stride`; false where the stream lies.
template <class T>
bool copy_values(const draco::Mesh& mesh, const draco::PointAttribute& from, int components, size_t stride,
                 std::vector<uint8_t>& out) {
  const bool mapped = from.is_mapping_identity() || from.indices_map_size() >= mesh.num_points();
  if (!mapped || from.buffer()->data_size() < from.size() * size_t(from.byte_stride())) return false;
  const size_t first = out.size();
  out.resize(first + mesh.num_points() * stride);
  for (uint32_t i = 0; i < mesh.num_points(); ++i) {
    const draco::AttributeValueIndex value = from.mapped_index(draco::PointIndex(i));
    T element[16] = {};
    if (value.value() >= from.size() || !from.ConvertValue<T>(value, int8_t(components), element)) return false;
    std::memcpy(out.data() + first + i * stride, element, size_t(components) * sizeof(T));
  }
  return true;
}

bool copy_values(const draco::Mesh& mesh, const draco::PointAttribute& from, const GltfAccessor& as, size_t stride,
                 std::vector<uint8_t>& out) {
  switch (as.type) {
    case GltfType::i8: return copy_values<int8_t>(mesh, from, as.components, stride, out);
    case GltfType::u8: return copy_values<uint8_t>(mesh, from, as.components, stride, out);
    case GltfType::i16: return copy_values<int16_t>(mesh, from, as.components, stride, out);
    case GltfType::u16: return copy_values<uint16_t>(mesh, from, as.components, stride, out);
    case GltfType::u32: return copy_values<uint32_t>(mesh, from, as.components, stride, out);
    case GltfType::f32: return copy_values<float>(mesh, from, as.components, stride, out);
    case GltfType::none: break;
  }
  return false;
}

// Decoded geometry of one primitive, put into the document.
class PrimitiveDecoder {
 public:
  PrimitiveDecoder(GltfCheck& check, GltfDocument& document, const GltfWhere& where)
      : check_(check), document_(document), where_(where) {}

  bool decode(const Json& extension, DecodeBudget& budget, Json& primitive) {
    const auto view = check_.index(extension, "bufferView", gltf_count(document_.json, "bufferViews"), where_);
    const Json* ids = check_.object(extension, "attributes", where_);
    const Json* attributes = check_.object(primitive, "attributes", where_);
    if (!check_.ok()) return false;
    if (!view || !ids || !attributes) return fail("lacks a bufferView or attributes");
    const std::span<const uint8_t> bytes = read_buffer_view(check_, document_, *view, nullptr);
    if (!check_.ok()) return false;
    draco::Mesh mesh;
    if (const std::string why = decode_mesh(bytes, budget, mesh); !why.empty()) return fail(why);
    if (!budget.take(uint64_t(mesh.num_faces()) * 3 * sizeof(uint32_t))) return fail("the file expands too far");
    Json decoded = *attributes;
    for (auto id = ids->begin(); id != ids->end(); ++id) {
      if (!decoded.contains(id.key())) continue;
      const auto unique = check_.index(*ids, id.key().c_str(), UINT32_MAX, where_);
      const auto accessor = check_.index(decoded, id.key().c_str(), gltf_count(document_.json, "accessors"), where_);
      if (!check_.ok() || !add_attribute(mesh, id.key(), uint32_t(*unique), *accessor, budget, decoded)) return false;
    }
    add_indices(mesh, primitive);
    const size_t buffer = add_buffer(document_, std::move(bytes_));
    for (size_t v : views_) document_.json["bufferViews"][v]["buffer"] = buffer;
    primitive["attributes"] = std::move(decoded);
    primitive.erase("mode");  // strips come as triangles, too
    return true;
  }

 private:
  static constexpr unsigned array_buffer = 34962, element_array_buffer = 34963;

  bool fail(const std::string& why) { return check_.fail(where_, std::string(name) + " " + why); }

  bool add_attribute(const draco::Mesh& mesh, const std::string& key, uint32_t id, size_t accessor,
                     DecodeBudget& budget, Json& decoded) {
    const GltfAccessor as = read_accessor(check_, document_, accessor);
    if (!check_.ok()) return false;
    const draco::PointAttribute* from = mesh.GetAttributeByUniqueId(id);
    if (!from || as.is_matrix) return fail("has no " + key);
    const size_t stride = (as.element_size + 3) / 4 * 4, at = bytes_.size();
    if (!budget.take(uint64_t(mesh.num_points()) * stride)) return fail("the file expands too far");
    if (!copy_values(mesh, *from, as, stride, bytes_)) return fail("is broken");
    Json json = gltf_item(document_.json, "accessors", accessor);  // with its bounds
    json.erase("byteOffset"), json.erase("sparse");
    json["count"] = mesh.num_points(), json["bufferView"] = add_view(at, array_buffer);
    if (stride != as.element_size) document_.json["bufferViews"].back()["byteStride"] = stride;
    document_.json["accessors"].push_back(std::move(json));
    decoded[key] = document_.json["accessors"].size() - 1;
    return true;
  }

  void add_indices(const draco::Mesh& mesh, Json& primitive) {
    const size_t at = bytes_.size(), count = size_t(mesh.num_faces()) * 3;
    bytes_.resize(at + count * sizeof(uint32_t));
    for (uint32_t f = 0; f < mesh.num_faces(); ++f)
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t index = mesh.face(draco::FaceIndex(f))[k].value();
        std::memcpy(bytes_.data() + at + (size_t(f) * 3 + k) * sizeof index, &index, sizeof index);
      }
    document_.json["accessors"].push_back({{"bufferView", add_view(at, element_array_buffer)},
                                           {"componentType", unsigned(GltfType::u32)},
                                           {"count", count},
                                           {"type", "SCALAR"}});
    primitive["indices"] = document_.json["accessors"].size() - 1;
  }

  size_t add_view(size_t at, unsigned target) {
    document_.json["bufferViews"].push_back(
        {{"byteOffset", at}, {"byteLength", bytes_.size() - at}, {"target", target}});
    views_.push_back(document_.json["bufferViews"].size() - 1);
    return views_.back();
  }

  GltfCheck& check_;
  GltfDocument& document_;
  GltfWhere where_;
  std::vector<uint8_t> bytes_;
  std::vector<size_t> views_;
};

}  // namespace

bool decode_draco_primitives(GltfCheck& check, GltfDocument& document, DecodeBudget& budget) {
  std::map<std::string, Json> known;  // primitives of the same stream share what came out of it
  for (size_t m = 0; m < gltf_count(document.json, "meshes"); ++m) {
    const Json& mesh = gltf_item(document.json, "meshes", m);
    const size_t count = mesh.contains("primitives") && mesh["primitives"].is_array() ? mesh["primitives"].size() : 0;
    for (size_t p = 0; p < count; ++p) {
      Json& primitive = document.json["meshes"][m]["primitives"][p];
      const Json extension = take_extension(primitive, name);
      if (!extension.is_object()) continue;
      const std::string key = Json::array({extension, primitive.value("attributes", Json())}).dump();
      if (const auto twin = known.find(key); twin != known.end()) {
        primitive["attributes"] = twin->second[0], primitive["indices"] = twin->second[1], primitive.erase("mode");
        continue;
      }
      Json decoded = primitive;  // lists of the document grow while it is made
      PrimitiveDecoder decoder(check, document, {"mesh", m, "primitive", p});
      if (!decoder.decode(extension, budget, decoded)) return false;
      known[key] = Json::array({decoded["attributes"], decoded["indices"]});
      document.json["meshes"][m]["primitives"][p] = std::move(decoded);
    }
  }
  drop_extension_name(document.json, name);
  return true;
}

}  // namespace lambent

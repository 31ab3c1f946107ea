#pragma once
// One small scene, plain and compressed by the encoders of the libraries that we decode with.
#include <lambent/scene/gltf_test-inl.h>

#include <draco/compression/encode.h>
#include <meshoptimizer.h>
#include <webp/encode.h>

#include <functional>

namespace lambent::test {

// A hilly square of side x side vertices with all that a vertex may have.
struct Hills {
  static constexpr uint32_t side = 5;
  std::vector<float> positions, normals, texcoords;  // 3, 3, 2 a vertex
  std::vector<uint8_t> colors;                       // 4 a vertex
  std::vector<uint16_t> indices;

  Hills() {
    for (uint32_t y = 0; y < side; ++y)
      for (uint32_t x = 0; x < side; ++x) {
        const float u = float(x) / (side - 1), v = float(y) / (side - 1);
        const Vec3 n = normalize(Vec3(0.3f * u, 1, 0.2f - 0.4f * v));
        positions.insert(positions.end(), {4 * u - 2, u * (1 - v) + 0.25f * v, 3 * v});
        normals.insert(normals.end(), {n.x, n.y, n.z}), texcoords.insert(texcoords.end(), {u, 1 - v});
        for (uint32_t c : {10 * x, 255 - 20 * y, 60u, 255u}) colors.push_back(uint8_t(c));
      }
    for (uint32_t y = 0; y + 1 < side; ++y)
      for (uint32_t x = 0; x + 1 < side; ++x) {
        const auto at = [](uint32_t column, uint32_t row) { return uint16_t(row * side + column); };
        for (uint16_t i : {at(x, y), at(x, y + 1), at(x + 1, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)})
          indices.push_back(i);
      }
  }
  uint32_t count() const { return side * side; }

  Builder plain() const {
    Builder b;
    const Json attributes = {{"POSITION", b.floats(positions, "VEC3")},
                             {"NORMAL", b.floats(normals, "VEC3")},
                             {"TEXCOORD_0", b.floats(texcoords, "VEC2")},
                             {"COLOR_0", b.accessor(colors, type_u8, "VEC4", true)}};
    b.json["meshes"] = {{{"primitives", {{{"attributes", attributes}, {"indices", b.indices(indices)}}}}}};
    b.json["nodes"] = {{{"mesh", 0}}};
    return b;
  }
};

// An attribute of a mesh for Draco; gives its unique number.
template <class T>
uint32_t add_draco(draco::Mesh& mesh, draco::GeometryAttribute::Type kind, draco::DataType type, int components,
                   bool normalized, const std::vector<T>& values) {
  draco::GeometryAttribute a;
  a.Init(kind, nullptr, uint8_t(components), type, normalized, int64_t(sizeof(T)) * components, 0);
  const int id = mesh.AddAttribute(a, true, mesh.num_points());
  for (uint32_t i = 0; i < mesh.num_points(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[size_t(i) * size_t(components)]);
  return mesh.attribute(id)->unique_id();
}

struct DracoStream {
  Bytes bytes;
  uint32_t position, normal, texcoord, color;  // unique numbers
};
// `bits`: of quantisation; 0 keeps floats as they are.
inline DracoStream draco_of(const Hills& hills, bool edgebreaker, int bits) {
  using Attribute = draco::GeometryAttribute;
  draco::Mesh mesh;
  mesh.set_num_points(hills.count());
  mesh.SetNumFaces(hills.indices.size() / 3);
  for (uint32_t f = 0; f < mesh.num_faces(); ++f) {
    draco::Mesh::Face face;
    for (uint32_t k = 0; k < 3; ++k) face[k] = hills.indices[3 * f + k];
    mesh.SetFace(draco::FaceIndex(f), face);
  }
  DracoStream out;
  out.position = add_draco(mesh, Attribute::POSITION, draco::DT_FLOAT32, 3, false, hills.positions);
  out.normal = add_draco(mesh, Attribute::NORMAL, draco::DT_FLOAT32, 3, false, hills.normals);
  out.texcoord = add_draco(mesh, Attribute::TEX_COORD, draco::DT_FLOAT32, 2, false, hills.texcoords);
  out.color = add_draco(mesh, Attribute::COLOR, draco::DT_UINT8, 4, true, hills.colors);
  draco::Encoder encoder;
  encoder.SetEncodingMethod(edgebreaker ? draco::MESH_EDGEBREAKER_ENCODING : draco::MESH_SEQUENTIAL_ENCODING);
  for (auto kind : {Attribute::POSITION, Attribute::NORMAL, Attribute::TEX_COORD})
    if (bits) encoder.SetAttributeQuantization(kind, bits);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) std::abort();
  out.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  return out;
}

inline Builder draco_file(const Hills& hills, bool edgebreaker, int bits) {
  const DracoStream stream = draco_of(hills, edgebreaker, bits);
  Builder b;
  const auto described = [&](int type, const char* shape, bool normalized) {
    Json a = {{"componentType", type}, {"count", hills.count()}, {"type", shape}};
    if (normalized) a["normalized"] = true;
    return b.accessor(a);
  };
  const Json attributes = {{"POSITION", described(type_f32, "VEC3", false)},
                           {"NORMAL", described(type_f32, "VEC3", false)},
                           {"TEXCOORD_0", described(type_f32, "VEC2", false)},
                           {"COLOR_0", described(type_u8, "VEC4", true)}};
  const size_t indices = b.accessor({{"componentType", type_u16}, {"count", hills.indices.size()}, {"type", "SCALAR"}});
  const Json extension = {{"bufferView", b.view(stream.bytes)},
                          {"attributes",
                           {{"POSITION", stream.position},
                            {"NORMAL", stream.normal},
                            {"TEXCOORD_0", stream.texcoord},
                            {"COLOR_0", stream.color}}}};
  b.json["meshes"] = {{{"primitives",
                        {{{"attributes", attributes},
                          {"indices", indices},
                          {"extensions", {{"KHR_draco_mesh_compression", extension}}}}}}}};
  b.json["nodes"] = {{{"mesh", 0}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return b;
}

inline Bytes meshopt_attributes(const void* values, size_t count, size_t stride) {
  Bytes out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), values, count, stride));
  return out;
}
inline Bytes meshopt_triangles(const std::vector<uint16_t>& indices, size_t vertices) {
  const std::vector<unsigned> wide(indices.begin(), indices.end());
  Bytes out(meshopt_encodeIndexBufferBound(wide.size(), vertices));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), wide.data(), wide.size()));
  return out;
}
inline Bytes meshopt_sequence(const std::vector<uint16_t>& indices, size_t vertices) {
  const std::vector<unsigned> wide(indices.begin(), indices.end());
  Bytes out(meshopt_encodeIndexSequenceBound(wide.size(), vertices));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), wide.data(), wide.size()));
  return out;
}

// A file of compressed views in the making: buffer 0 has the streams, buffer 1 is a fallback without bytes.
struct MeshoptBuilder {
  Builder file;
  const char* name = "EXT_meshopt_compression";
  size_t expanded = 0;

  size_t view(const Bytes& stream, size_t count, size_t stride, const char* mode, const char* filter = nullptr) {
    const size_t v = file.view(stream);
    Json& view = file.json["bufferViews"][v];
    Json extension = {{"buffer", 0},
                      {"byteOffset", view["byteOffset"]},
                      {"byteLength", stream.size()},
                      {"byteStride", stride},
                      {"count", count},
                      {"mode", mode}};
    if (filter) extension["filter"] = filter;
    view = {{"buffer", 1}, {"byteOffset", expanded}, {"byteLength", count * stride}};
    if (mode == std::string("ATTRIBUTES")) view["byteStride"] = stride;
    view["extensions"][name] = extension;
    expanded += (count * stride + 3) / 4 * 4;
    return v;
  }
  Json finished() const {
    Json json = file.finished();
    json["buffers"].push_back({{"byteLength", expanded}});
    json["buffers"][1]["extensions"][name]["fallback"] = true;
    json["extensionsUsed"] = json["extensionsRequired"] = Json::array({name});
    return json;
  }
  Bytes glb() const { return make_glb(finished(), file.binary); }
};

inline MeshoptBuilder meshopt_file(const Hills& hills, const char* name = "EXT_meshopt_compression") {
  MeshoptBuilder m;
  m.name = name;
  const size_t count = hills.count();
  const auto accessor = [&](size_t view, int type, const char* shape, size_t elements) {
    return m.file.accessor({{"bufferView", view}, {"componentType", type}, {"count", elements}, {"type", shape}});
  };
  const auto attribute = [&](const void* values, size_t stride, int type, const char* shape) {
    return accessor(m.view(meshopt_attributes(values, count, stride), count, stride, "ATTRIBUTES"), type, shape, count);
  };
  const Json attributes = {{"POSITION", attribute(hills.positions.data(), 12, type_f32, "VEC3")},
                           {"NORMAL", attribute(hills.normals.data(), 12, type_f32, "VEC3")},
                           {"TEXCOORD_0", attribute(hills.texcoords.data(), 8, type_f32, "VEC2")},
                           {"COLOR_0", attribute(hills.colors.data(), 4, type_u8, "VEC4")}};
  m.file.json["accessors"].back()["normalized"] = true;
  const size_t indices = m.view(meshopt_triangles(hills.indices, count), hills.indices.size(), 2, "TRIANGLES");
  m.file.json["meshes"] = {
      {{"primitives",
        {{{"attributes", attributes}, {"indices", accessor(indices, type_u16, "SCALAR", hills.indices.size())}}}}}};
  m.file.json["nodes"] = {{{"mesh", 0}}};
  return m;
}

// WebP without loss, of rows of three bytes a pixel.
inline Bytes make_webp(int width, int height, const Bytes& samples) {
  uint8_t* encoded = nullptr;
  const size_t size = WebPEncodeLosslessRGB(samples.data(), width, height, 3 * width, &encoded);
  Bytes out(encoded, encoded + size);
  WebPFree(encoded);
  return out;
}

}  // namespace lambent::test

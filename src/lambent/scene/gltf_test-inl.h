#pragma once
// Small glTF files and PNG images for tests, made byte by byte.
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <unistd.h>

#include "temporary_folder.h"
#include "test_meshes.h"

namespace lambent::test {

using Json = nlohmann::json;
using Bytes = std::vector<uint8_t>;

inline void put_u32(Bytes& out, uint32_t v, bool big_endian = false) {
  for (int i = 0; i < 4; ++i) out.push_back(uint8_t(v >> (big_endian ? 24 - 8 * i : 8 * i)));
}

inline Bytes copy_bytes(const std::string& text) { return Bytes(text.begin(), text.end()); }

inline std::string base64(const Bytes& bytes) {
  const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    size_t n = std::min<size_t>(3, bytes.size() - i);
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) bits = bits << 8 | (k < n ? bytes[i + k] : 0);
    for (size_t k = 0; k < 4; ++k) out += k <= n ? digits[bits >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

inline Bytes make_glb(const Json& json, const Bytes& binary) {
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  Bytes padded = binary;
  padded.resize((padded.size() + 3) / 4 * 4, 0);
  Bytes out = copy_bytes("glTF");
  put_u32(out, 2), put_u32(out, uint32_t(12 + 8 + text.size() + 8 + padded.size()));
  put_u32(out, uint32_t(text.size())), put_u32(out, 0x4e4f534a);
  out.insert(out.end(), text.begin(), text.end());
  put_u32(out, uint32_t(padded.size())), put_u32(out, 0x004e4942);
  out.insert(out.end(), padded.begin(), padded.end());
  return out;
}

constexpr int type_i8 = 5120, type_u8 = 5121, type_i16 = 5122, type_u16 = 5123, type_u32 = 5125, type_f32 = 5126;

// A document in the making; views and accessors are appended, the rest is written into `json` as needed.
struct Builder {
  Json json = {{"asset", {{"version", "2.0"}}}};
  Bytes binary;

  template <class T>
  size_t view(const std::vector<T>& values) {
    binary.resize((binary.size() + 3) / 4 * 4, 0);
    size_t offset = binary.size(), size = values.size() * sizeof(T);
    binary.resize(offset + size);
    if (size) std::memcpy(binary.data() + offset, values.data(), size);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", size}});
    return json["bufferViews"].size() - 1;
  }
  size_t accessor(Json description) {
    json["accessors"].push_back(std::move(description));
    return json["accessors"].size() - 1;
  }
  template <class T>
  size_t accessor(const std::vector<T>& values, int component_type, const std::string& shape, bool normalized = false) {
    size_t components = shape == "SCALAR" ? 1 : shape == "MAT4" ? 16 : size_t(shape.back() - '0');
    Json a = {{"bufferView", view(values)},
              {"componentType", component_type},
              {"count", values.size() / components},
              {"type", shape}};
    if (normalized) a["normalized"] = true;
    return accessor(std::move(a));
  }
  size_t floats(const std::vector<float>& values, const std::string& shape) {
    return accessor(values, type_f32, shape);
  }
  size_t indices(const std::vector<uint16_t>& values) { return accessor(values, type_u16, "SCALAR"); }

  Json finished() const {
    Json out = json;
    if (!binary.empty()) out["buffers"] = Json::array({{{"byteLength", binary.size()}}});
    return out;
  }
  Bytes glb() const { return make_glb(finished(), binary); }
  Bytes gltf() const {
    Json out = finished();
    if (!binary.empty()) out["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(binary);
    return copy_bytes(out.dump());
  }
  Result<Scene> load() const { return load_gltf(glb(), "test.glb", ""); }
};

// One triangle of one node, with normals: corners (0,0,0), (2,0,0), (0,1,0).
inline Builder triangle() {
  Builder b;
  size_t positions = b.floats({0, 0, 0, 2, 0, 0, 0, 1, 0}, "VEC3");
  size_t normals = b.floats({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  size_t indices = b.indices({0, 1, 2});
  b.json["meshes"] = {
      {{"primitives", {{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}, {"indices", indices}}}}}};
  b.json["nodes"] = {{{"mesh", 0}}};
  return b;
}

// PNG of 8- or 16-bit samples (stored high byte first) in rows of `channels` (1, 3 or 4), in an uncompressed deflate
// stream.
inline Bytes make_png(int width, int height, int channels, int depth, const Bytes& samples) {
  auto crc = [](const uint8_t* p, size_t n) {
    uint32_t c = ~0u;
    for (size_t i = 0; i < n; ++i) {
      c ^= p[i];
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320u ^ (c >> 1) : c >> 1;
    }
    return ~c;
  };
  Bytes out = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  auto chunk = [&](const char* type, const Bytes& data) {
    put_u32(out, uint32_t(data.size()), true);
    size_t start = out.size();
    out.insert(out.end(), type, type + 4);
    out.insert(out.end(), data.begin(), data.end());
    put_u32(out, crc(out.data() + start, out.size() - start), true);
  };
  Bytes header;
  put_u32(header, uint32_t(width), true), put_u32(header, uint32_t(height), true);
  for (int v : {depth, channels == 1 ? 0 : channels == 3 ? 2 : 6, 0, 0, 0}) header.push_back(uint8_t(v));
  chunk("IHDR", header);
  Bytes rows;
  size_t row = size_t(width * channels * depth / 8);
  for (size_t y = 0; y < size_t(height); ++y) {
    rows.push_back(0);
    rows.insert(rows.end(), samples.begin() + ptrdiff_t(y * row), samples.begin() + ptrdiff_t((y + 1) * row));
  }
  uint32_t s1 = 1, s2 = 0;
  for (uint8_t v : rows) s1 = (s1 + v) % 65521, s2 = (s2 + s1) % 65521;
  uint16_t n = uint16_t(rows.size());  // one stored block: up to 64 KiB
  Bytes stream = {0x78, 0x01, 0x01, uint8_t(n), uint8_t(n >> 8), uint8_t(~n), uint8_t(uint16_t(~n) >> 8)};
  stream.insert(stream.end(), rows.begin(), rows.end());
  put_u32(stream, s2 << 16 | s1, true);
  chunk("IDAT", stream);
  chunk("IEND", {});
  return out;
}

// Rounding of a few float operations on values of order one.
constexpr float rounding = 1e-6f;

inline void expect_near(Vec3 a, Vec3 b, float tolerance = rounding) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], tolerance) << "component " << c;
}

// The scene; a failed test and a triangle where it does not load.
inline Scene loaded(const Builder& b) {
  auto scene = b.load();
  if (scene) return std::move(*scene);
  ADD_FAILURE() << scene.error().text();
  return *triangle().load();
}

// Why it does not load.
inline std::string message(const Builder& b) {
  auto scene = b.load();
  return scene ? "loaded" : scene.error().text();
}

inline Json& primitive(Builder& b, size_t p = 0) { return b.json["meshes"][0]["primitives"][p]; }

// 2 x 2 pixels: red green / blue white.
inline const Bytes four_colors = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};

inline Builder textured_triangle(const Bytes& image) {
  Builder b = triangle();
  primitive(b)["attributes"]["TEXCOORD_0"] = b.floats({0.25f, 0.25f, 0.75f, 0.25f, 0.25f, 0.75f}, "VEC2");
  primitive(b)["material"] = 0;
  b.json["images"] = {{{"bufferView", b.view(image)}, {"mimeType", "image/png"}, {"name", "colours"}}};
  b.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  return b;
}

inline void write_bytes(const std::string& path, const Bytes& bytes) {
  std::span<const uint8_t> piece(bytes);
  Result<void> written = write_file_atomically(path, {&piece, 1});
  if (!written) std::abort();
}

}  // namespace lambent::test

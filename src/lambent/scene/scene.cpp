// sRGB transfer curve: IEC 61966-2-1.
#include <lambent/scene/scene.h>
#include <lambent/scene/see_through.h>

#include <numeric>

namespace lambent {
namespace {

// Linear values of the 256 encoded bytes.
const std::array<float, 256>& decode_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (size_t i = 0; i < t.size(); ++i) t[i] = srgb_to_linear(float(i) / 255.0f);
    return t;
  }();
  return table;
}

const std::array<float, 256>& linear_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (size_t i = 0; i < t.size(); ++i) t[i] = float(i) / 255.0f;
    return t;
  }();
  return table;
}

// Brings a coordinate into one period, so that the texel index below cannot overflow.
float wrap_coordinate(float u, Wrap wrap) {
  if (!std::isfinite(u)) return 0.0f;
  if (wrap == Wrap::clamp) return std::clamp(u, 0.0f, 1.0f);
  if (wrap == Wrap::mirror) return u - 2.0f * std::floor(0.5f * u);
  return u - std::floor(u);
}

int wrap_texel(int i, int size, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::clamp(i, 0, size - 1);
  int period = wrap == Wrap::mirror ? 2 * size : size;
  i = ((i % period) + period) % period;
  return i < size ? i : period - 1 - i;
}

// The two texels about a coordinate, and the share of the second.
struct Tap {
  size_t first, second;
  float share;
};

Tap tap(float u, int size, Wrap wrap) {
  float x = wrap_coordinate(u, wrap) * float(size) - 0.5f;
  float whole = std::floor(x);
  int i = int(whole);
  return {size_t(wrap_texel(i, size, wrap)), size_t(wrap_texel(i + 1, size, wrap)), x - whole};
}

Vec3 sample_bytes(const Texture& texture, Vec2 uv, const std::array<float, 256>& linear) {
  if (texture.width <= 0 || texture.height <= 0 || texture.rgb.empty()) return Vec3(1.0f);
  Tap s = tap(uv.x, texture.width, texture.wrap_s), t = tap(uv.y, texture.height, texture.wrap_t);
  auto texel = [&](size_t x, size_t y) {
    const uint8_t* p = texture.rgb.data() + (y * size_t(texture.width) + x) * 3;
    return Vec3(linear[p[0]], linear[p[1]], linear[p[2]]);
  };
  Vec3 top = mix(texel(s.first, t.first), texel(s.second, t.first), s.share);
  Vec3 bottom = mix(texel(s.first, t.second), texel(s.second, t.second), s.share);
  return mix(top, bottom, t.share);
}

}  // namespace

float srgb_to_linear(float e) { return e <= 0.04045f ? e / 12.92f : std::pow((e + 0.055f) / 1.055f, 2.4f); }

float linear_to_srgb(float l) { return l <= 0.0031308f ? 12.92f * l : 1.055f * std::pow(l, 1.0f / 2.4f) - 0.055f; }

void number_inputs(Scene& scene) {
  scene.input_count = uint32_t(scene.positions.size());
  scene.input.resize(scene.positions.size());
  std::iota(scene.input.begin(), scene.input.end(), 0u);
}

Bounds bounds(const Scene& scene) {
  Bounds box;
  for (const Triangle& t : scene.triangles) {
    for (uint32_t v : t.v) box.extend(scene.positions[v]);
  }
  return box;
}

Vec2 texture_place(const Scene& scene, const Triangle& triangle, float u, float v, int set,
                   const std::array<float, 6>& m) {
  const std::vector<Vec2>& texcoords = scene.texcoords[size_t(set)];
  Vec2 uv = texcoords.empty() ? Vec2(0.0f) : interpolate(texcoords, triangle, u, v);
  return {m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5]};
}

Vec3 sample_texture(const Texture& texture, Vec2 uv) { return sample_bytes(texture, uv, decode_table()); }

Vec3 sample_linear_texture(const Texture& texture, Vec2 uv) { return sample_bytes(texture, uv, linear_table()); }

float sample_alpha(const Texture& texture, Vec2 uv) {
  if (texture.width <= 0 || texture.height <= 0 || texture.alpha.empty()) return 1.0f;
  const Tap s = tap(uv.x, texture.width, texture.wrap_s), t = tap(uv.y, texture.height, texture.wrap_t);
  auto texel = [&](size_t x, size_t y) { return float(texture.alpha[y * size_t(texture.width) + x]) / 255.0f; };
  auto row = [&](size_t y) { return texel(s.first, y) + s.share * (texel(s.second, y) - texel(s.first, y)); };
  return row(t.first) + t.share * (row(t.second) - row(t.first));
}

Vec3 base_color(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Material& material = scene.materials[scene.parts[triangle.part].material];
  Vec3 color = material.base_color;
  if (material.base_color_texture >= 0) {
    color *= sample_texture(scene.textures[size_t(material.base_color_texture)],
                            texture_place(scene, triangle, u, v, material.texcoord_set, material.uv_transform));
  }
  if (!scene.colors.empty()) color *= interpolate(scene.colors, triangle, u, v);
  return clamp(color, Vec3(0.0f), Vec3(1.0f));
}

Vec3 albedo(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Vec3 color = base_color(scene, triangle, u, v);
  const Material& material = scene.materials[scene.parts[triangle.part].material];
  return material.transmission > 0 ? color * (1 - transmission(scene, triangle, u, v)) : color;
}

Vec3 emission_texel(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Material& m = scene.materials[scene.parts[triangle.part].material];
  if (m.emissive_texture < 0) return Vec3(1.0f);
  return sample_texture(scene.textures[size_t(m.emissive_texture)],
                        texture_place(scene, triangle, u, v, m.emissive_set, m.emissive_transform));
}

Vec3 emission(const Scene& scene, const Triangle& triangle, float u, float v) {
  return scene.materials[scene.parts[triangle.part].material].emissive * emission_texel(scene, triangle, u, v);
}

Vec2 metallic_roughness(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Material& material = scene.materials[scene.parts[triangle.part].material];
  Vec2 value(material.metallic, material.roughness);
  if (material.metallic_roughness_texture >= 0) {
    Vec3 texel = sample_linear_texture(
        scene.textures[size_t(material.metallic_roughness_texture)],
        texture_place(scene, triangle, u, v, material.metallic_roughness_set, material.metallic_roughness_transform));
    value *= Vec2(texel.z, texel.y);
  }
  return clamp(value, Vec2(0.0f), Vec2(1.0f));
}

}  // namespace lambent

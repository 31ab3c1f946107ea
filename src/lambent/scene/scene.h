#pragma once
// ONE scene of plain structs and indices, flattened to world space in the rest pose. Loaders fill it, everything reads
// it.
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace lambent {

// No such vertex, part, material, receiver, ...
inline constexpr uint32_t none = 0xffffffffu;

// Sets of texture coordinates that a scene may have.
inline constexpr size_t max_texcoord_sets = 32;

// What a texture is beyond [0, 1].
enum class Wrap : uint8_t { repeat, clamp, mirror };

// A texture: kept encoded (PNG, JPEG or WebP) to be written back as it came, and decoded to bytes for look-ups.
struct Texture {
  std::string name;
  std::string mime_type;         // "image/png", "image/jpeg" or "image/webp"
  std::vector<uint8_t> encoded;  // may be empty for a scene whose document already holds the bytes
  int width = 0, height = 0;
  std::vector<uint8_t>
      rgb;  // width * height * 3, first row is v = 0 (glTF: the image's top row); colours are sRGB-encoded
  std::vector<uint8_t> alpha;  // width * height, linear; empty: 255 all over
  Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;
};

// What alpha means (glTF 2.0, section 3.9.4): nothing; a hole below the cutoff; the share of a surface that is there.
enum class AlphaMode : uint8_t { opaque, mask, blend };

// glTF metallic-roughness. The diffuse pipeline reads base colour and emission; reflection.h says what else there is.
struct Material {
  std::string name;
  Vec3 base_color{1.0f};        // linear, [0, 1]
  int base_color_texture = -1;  // into Scene::textures
  int texcoord_set = 0;         // into Scene::texcoords
  // KHR_texture_transform of the base colour: uv' = (uv_matrix rows) * (u, v, 1).
  std::array<float, 6> uv_transform{1, 0, 0, 0, 1, 0};
  // Read by see_through.h; times the alpha of the base colour texture (an alpha map of its own: with_alpha(),
  // textures.h).
  AlphaMode alpha_mode = AlphaMode::opaque;
  float alpha = 1.0f, alpha_cutoff = 0.5f;
  // Of the covered part, what passes straight through times the base colour (KHR_materials_transmission); times the
  // red channel of the texture, linear.
  float transmission = 0.0f;
  int transmission_texture = -1;
  int transmission_set = 0;
  std::array<float, 6> transmission_transform{1, 0, 0, 0, 1, 0};
  float metallic = 1.0f, roughness = 1.0f;  // factors of the texture below, [0, 1]
  // Reflectance of the part that is no metal, at normal and at grazing incidence (KHR_materials_ior, _specular).
  Vec3 dielectric_f0{0.04f};
  float dielectric_f90 = 1.0f;
  // Roughness in its green, metallic in its blue channel, linear; with a texcoord set and transform of its own.
  int metallic_roughness_texture = -1;
  int metallic_roughness_set = 0;
  std::array<float, 6> metallic_roughness_transform{1, 0, 0, 0, 1, 0};
  // Normals about the surface's own (mapped_normal): a byte b stands for 2 b / 255 - 1, x and y times the scale.
  int normal_texture = -1;
  int normal_set = 0;
  std::array<float, 6> normal_transform{1, 0, 0, 0, 1, 0};
  float normal_scale = 1.0f;
  Vec3 emissive{0.0f};  // radiance, linear; times the texture
  int emissive_texture = -1;
  int emissive_set = 0;
  std::array<float, 6> emissive_transform{1, 0, 0, 0, 1, 0};
  bool unlit = false;        // KHR_materials_unlit: shown as its base colour, whatever the light
  bool double_sided = true;  // false: seen from the front only; its back is black to light and absent to cameras
};

// A lamp without a surface (KHR_lights_punctual), in world space.
struct PunctualLight {
  enum class Kind : uint8_t { point, spot, directional };
  std::string name;
  Kind kind = Kind::point;
  Vec3 position{0.0f};       // not of directional ones
  Vec3 direction{0, 0, -1};  // unit, the way that spots and directional lights shine
  Vec3 intensity{1.0f};  // linear; flux per steradian, or, of directional ones, irradiance of a surface that faces it
  float inner_cone = 0, outer_cone = pi / 4;  // radians from the axis: full within the inner, nothing beyond the outer
};

// A triangle of the scene.
struct Triangle {
  uint32_t v[3];  // vertex indices, counter-clockwise seen from the front
  uint32_t part;
  bool two_sided;
};

// A run of vertices and triangles that share a material: one primitive of one node.
struct Part {
  std::string name;
  uint32_t material = 0;
  uint32_t first_vertex = 0, vertex_count = 0;
  uint32_t first_triangle = 0, triangle_count = 0;
  // Where it came from in Scene::document; -1 for parts that the document does not have (OBJ, PLY, ground, made
  // scenes).
  int node = -1, primitive = -1;
  // True once its vertices or triangles differ from the document's, so that the writer must write them anew.
  bool changed = false;
  // For changed parts whose vertices are copies of the document's (split for normals): vertex i copies document vertex
  // source[i]. Empty when there is no such map.
  std::vector<uint32_t> source;
};

struct GltfDocument;  // gltf.h: the JSON and binary of a glTF input, kept so that nothing of it is lost

struct Scene {
  std::string path;  // for messages and provenance; may be empty
  std::string hash;  // content_hash of the input file's bytes; may be empty

  // Where positions count from in the file's space: 0 but for coordinates far from it (surveyed ones), of which floats
  // would keep too little. All else in the scene's space counts from there too; files written hold it as their nodes'
  // translation, and what users type is in the file's space.
  Vec3d origin{0.0};

  std::vector<Vec3> positions;  // world space, metres
  std::vector<Vec3> normals;    // unit, as many as positions
  // Sets of texture coordinates, at least two and all that materials read; each empty, or as many as positions.
  std::vector<std::vector<Vec2>> texcoords = std::vector<std::vector<Vec2>>(2);
  std::vector<Vec3> colors;  // linear vertex colours: empty, or as many as positions
  // Along +u of the normal texture; w: the sign of the bitangent cross(n, t) w. Empty, or as many as positions; zero:
  // not given.
  std::vector<Vec4> tangents;

  // Which vertex of the input each one is, counted from 0 as the input has them (an OBJ's `v` lines, a PLY's vertices,
  // an array's rows, a glTF's as its nodes are read, alike ones without normals once); `none` for those that were made.
  // Vertices that were split have the same number. Empty for scenes that were made, or as many as positions.
  std::vector<uint32_t> input;
  uint32_t input_count = 0;  // vertices of the input, those that nothing uses with them

  std::vector<Triangle> triangles;
  std::vector<Part> parts;          // in order of their runs, covering all vertices and triangles
  std::vector<Material> materials;  // at least one
  std::vector<Texture> textures;
  std::vector<PunctualLight> lights;

  std::shared_ptr<const GltfDocument> document;  // null unless the input was glTF
  std::vector<std::string> warnings;             // one line each, in the order found
  std::vector<std::string> excluded;             // what exclude_parts() left out, as it was asked for
};

// Numbers the vertices as they are.
void number_inputs(Scene& scene);

Bounds bounds(const Scene& scene);  // of the vertices that triangles use

// Cross product of two edges: twice the area along the geometric normal.
inline Vec3 area_normal(const Scene& s, const Triangle& t) {
  return cross(s.positions[t.v[1]] - s.positions[t.v[0]], s.positions[t.v[2]] - s.positions[t.v[0]]);
}

// Its length: twice the area. Squares that floats cannot hold, of very small or large scenes, are summed in double.
inline float area_length(Vec3 area_normal) {
  const float squared = dot(area_normal, area_normal);
  return squared > 1e-30f && squared < 1e36f ? std::sqrt(squared) : float(length(Vec3d(area_normal)));
}

// The unit normal along it, or `fallback` for a triangle without an area.
inline Vec3 unit_normal(const Scene& s, const Triangle& t, Vec3 fallback = Vec3(0)) {
  const Vec3 n = area_normal(s, t);
  const float twice_area = area_length(n);
  return twice_area > 0 && std::isfinite(twice_area) ? n / twice_area : fallback;
}

// Barycentric interpolation at weight (1-u-v, u, v) of the triangle's corners.
template <class T>
T interpolate(const std::vector<T>& values, const Triangle& t, float u, float v) {
  return (1 - u - v) * values[t.v[0]] + u * values[t.v[1]] + v * values[t.v[2]];
}

// Linear base colour (factor x texture x vertex colour) at a point of a triangle, clamped to [0, 1]; bilinear texture
// look-up.
Vec3 base_color(const Scene& scene, const Triangle& triangle, float u, float v);
// What of light a point reflects where it is covered: the base colour, less what passes through (see_through.h).
Vec3 albedo(const Scene& scene, const Triangle& triangle, float u, float v);

// (metallic, roughness): factors times the texture, at a point of a triangle, each in [0, 1].
Vec2 metallic_roughness(const Scene& scene, const Triangle& triangle, float u, float v);

// Radiance that a point of a triangle sends out of its own: factor times texture. The second: the texture alone, 1
// without.
Vec3 emission(const Scene& scene, const Triangle& triangle, float u, float v);
Vec3 emission_texel(const Scene& scene, const Triangle& triangle, float u, float v);

// Where a texture is looked up: the interpolated coordinates of a set, transformed.
Vec2 texture_place(const Scene& scene, const Triangle& triangle, float u, float v, int set,
                   const std::array<float, 6>& transform);

// Bilinear look-up at texture coordinates (u, v), decoded to linear.
Vec3 sample_texture(const Texture& texture, Vec2 uv);
// The same for a texture whose bytes are linear: byte / 255.
Vec3 sample_linear_texture(const Texture& texture, Vec2 uv);
float sample_alpha(const Texture& texture, Vec2 uv);  // 1 without alpha

// The sRGB transfer curve and its inverse.
float srgb_to_linear(float encoded);
float linear_to_srgb(float linear);

}  // namespace lambent

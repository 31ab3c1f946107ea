#pragma once
// The BRDF of a surface point, and the frame it is read in: one rule for everything that reflects.
#include <lambent/brdf/brdf.h>
#include <lambent/scene/scene.h>

#include <optional>
#include <string>
#include <vector>

namespace lambent {

// How a scene's surfaces reflect.
struct Reflection {
  enum class Model {
    diffuse,    // Lambert of the base colour
    materials,  // glTF's metallic-roughness: base colour, metallic and roughness of the material, with their textures
  };
  Model model = Model::diffuse;
  std::optional<Brdf> everywhere;  // stands in for both, on every surface
  // Of the materials of that name, before all else.
  struct Named {
    std::string material;
    Brdf brdf;
    bool textured = false;  // its diffuse colour (of GGX its f0) times the base colour, with textures
  };
  std::vector<Named> named = {};
  bool normal_maps = true;  // materials' normal textures bend the shading normal, where single points are shaded
};

// The model that was named for a material; null: none was.
const Reflection::Named* named_for(const Reflection& reflection, const Scene& scene, const Triangle& triangle);

// At barycentric (u, v) of the triangle, textures included.
Brdf surface_brdf(const Scene& scene, const Reflection& reflection, const Triangle& triangle, float u, float v);

// Columns (t, b, n), right-handed and orthonormal, about the unit shading normal n; what wi and wo of a BRDF refer to.
// t is the direction in which u of texture coordinate set 0 grows over the triangle, v held, made square to n. Where
// there are none, or they do not vary, it is level: +Y x n, as on a turned vase; and +X made square to n where n is
// upright.
Mat3 shading_frame(const Scene& scene, const Triangle& triangle, Vec3 n);

// The normal that the material's normal texture gives a point, n being the unit shading normal on the triangle's FRONT;
// n itself without such a texture. Frame (t, b, n): the scene's tangents, made square to n, with b = w cross(n, t);
// where there are none, +u of the texture over this triangle, and b against +v (v points down a picture). A back has
// the negated normal of the front.
Vec3 mapped_normal(const Scene& scene, const Triangle& triangle, float u, float v, Vec3 n);

}  // namespace lambent

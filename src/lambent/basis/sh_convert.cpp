#include <lambent/basis/sh.h>
#include <lambent/basis/sh_convert.h>

namespace lambent {

std::optional<ShConvention> parse_sh_convention(const std::string& name) {
  if (name == "lambent") return ShConvention::lambent;
  if (name == "three") return ShConvention::three;
  if (name == "unity") return ShConvention::unity;
  if (name == "godot") return ShConvention::godot;
  if (name == "gltf-ibl") return ShConvention::gltf_ibl;
  return std::nullopt;
}

std::vector<Vec3> convert_sh(std::span<const Vec3> light, ShConvention to) {
  // Constants of the polynomials that the shaders of the Unity family evaluate, by coefficient.
  const double basis[9] = {0.282095, 0.488603, 0.488603, 0.488603, 1.092548, 1.092548, 0.315392, 1.092548, 0.546274};
  size_t count = light.size();
  if (to == ShConvention::unity || to == ShConvention::gltf_ibl) count = std::min<size_t>(count, 9);
  std::vector<Vec3> out(light.begin(), light.begin() + ptrdiff_t(count));
  for (size_t i = 0; i < count; ++i) {
    int l = sh_band(int(i)), m = int(i) - l * (l + 1);
    double unsigned_ = m % 2 ? -1 : 1, scale = 1;
    switch (to) {
      case ShConvention::lambent: break;
      case ShConvention::three: scale = unsigned_; break;
      case ShConvention::godot: scale = unsigned_ / std::numbers::pi; break;
      case ShConvention::gltf_ibl: scale = clamped_cosine(l); break;
      case ShConvention::unity: scale = unsigned_ * clamped_cosine(l) / std::numbers::pi * basis[i]; break;
    }
    out[i] *= float(scale);
  }
  return out;
}

std::vector<Vec3> mirror_sh_x(std::span<const Vec3> light) {
  // phi -> pi - phi: cos(m phi) changes sign for odd m, sin(m phi) for even m.
  std::vector<Vec3> out(light.begin(), light.end());
  for (size_t i = 0; i < out.size(); ++i) {
    int l = sh_band(int(i)), m = int(i) - l * (l + 1);
    if (m > 0 ? m % 2 != 0 : (m < 0 && m % 2 == 0)) out[i] = -out[i];
  }
  return out;
}

std::vector<Vec3> mirror_sh_z(std::span<const Vec3> light) {
  // z -> -z: the Legendre function of (l, m) has the parity of l + m.
  std::vector<Vec3> out(light.begin(), light.end());
  for (size_t i = 0; i < out.size(); ++i) {
    int l = sh_band(int(i)), m = int(i) - l * (l + 1);
    if ((l + m) % 2) out[i] = -out[i];
  }
  return out;
}

}  // namespace lambent

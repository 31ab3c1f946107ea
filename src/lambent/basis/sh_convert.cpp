#include <lambent/basis/sh.h>
#include <lambent/basis/sh_convert.h>

namespace lambent {

std::optional<ShConvention> parse_sh_convention(const std::string& name) {
  if (name == "lambent" || name == "filament" || name == "directx") return ShConvention::lambent;
  if (name == "three" || name == "pifu" || name == "icon") return ShConvention::three;
  if (name == "unity") return ShConvention::unity;
  if (name == "godot") return ShConvention::godot;
  if (name == "gltf-ibl") return ShConvention::gltf_ibl;
  return std::nullopt;
}

double sh_scale(ShConvention to, int i) {
  // Constants of the polynomials that the shaders of the Unity family evaluate, by coefficient.
  constexpr double basis[9] = {0.282095, 0.488603, 0.488603, 0.488603, 1.092548,
                               1.092548, 0.315392, 1.092548, 0.546274};
  const int l = sh_band(i), m = i - l * (l + 1);
  const double unsigned_ = m % 2 ? -1 : 1;
  switch (to) {
    case ShConvention::lambent: break;
    case ShConvention::three: return unsigned_;
    case ShConvention::godot: return unsigned_ / std::numbers::pi;
    case ShConvention::gltf_ibl: return i < 9 ? clamped_cosine(l) : 0;
    case ShConvention::unity: return i < 9 ? unsigned_ * clamped_cosine(l) / std::numbers::pi * basis[i] : 0;
  }
  return 1;
}

std::vector<Vec3> convert_sh(std::span<const Vec3> light, ShConvention to) {
  std::vector<Vec3> out;
  for (size_t i = 0; i < light.size() && sh_scale(to, int(i)) != 0; ++i)
    out.push_back(light[i] * float(sh_scale(to, int(i))));
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

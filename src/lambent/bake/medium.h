#pragma once
// What light goes through: a homogeneous medium that scatters and absorbs, behind a smooth boundary.
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <string>

namespace lambent {

// Of colours R, G, B; lengths are those of the scene.
struct Medium {
  Vec3 sigma_s{1}, sigma_a{0};  // scattering and absorption, per unit length
  float g = 0;                  // mean cosine of the scattering angle (Henyey-Greenstein), (-1, 1)
  float eta = 1;                // index of refraction relative to the outside, [1, 3]
};

// "sigma_s=S,sigma_a=A[,g=G][,eta=E]", where S and A are one number or R,G,B; or NAME[:MM], one that H. W. Jensen et
// al. 2001, "A practical model for subsurface light transport", measured, where a unit of the scene is MM millimetres
// (1000 if left out). Errors say what is wrong, or which names there are.
Result<Medium> parse_medium(const std::string& text);

// Share of unpolarised light that a smooth boundary reflects, met at |cosine| `cosine` by light that goes on into a
// medium of relative index `eta` (of the far side to the near); 1 where nothing is let through.
double fresnel_reflectance(double cosine, double eta);

// What is wrong with a medium's numbers.
Result<void> check_medium(const Medium& medium);

}  // namespace lambent

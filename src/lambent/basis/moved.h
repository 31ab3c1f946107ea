#pragma once
// Lobes of a basis (directional.h) that stand elsewhere: lamps that move while the rest stays.
#include <lambent/basis/directional.h>

namespace lambent {

struct MovedCoefficients {
  std::vector<double> coefficients;
  double lost = 0, whole = 0;  // integrals of squares: of what the basis does not hold, of the moved function
};
// The function with its harmonics turned, and its lobes about `axes`: the coefficients that fit best. Closed form.
MovedCoefficients move_directional(const DirectionalBasis& basis, std::span<const double> coefficients,
                                   const Mat3& rotation, std::span<const Vec3> axes);

}  // namespace lambent

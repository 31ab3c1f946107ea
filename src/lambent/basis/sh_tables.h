#pragma once
// The constants of the normalised Legendre recurrences, shared by everything that evaluates harmonics one by one. With
// (x + iy)^m = c_m + i s_m, the harmonics at (x, y, z) are q(l, m) c_m for m >= 0 and q(l, m) s_m for -m, where
//   q(m, m) = diagonal[m],   q(l, m) = a[l][m] z q(l-1, m) + b[l][m] q(l-2, m).
#include <lambent/basis/sh.h>

namespace lambent {

struct ShTables {
  double diagonal[max_sh_order];
  double a[max_sh_order][max_sh_order], b[max_sh_order][max_sh_order];
};
const ShTables& sh_tables();

}  // namespace lambent

#pragma once
// The constants of the normalised Legendre recurrences, shared by everything that evaluates harmonics one by one. With
// (x + iy)^m = c_m + i s_m, the harmonics at (x, y, z) are q(l, m) c_m for m >= 0 and q(l, m) s_m for -m, where
//   q(m, m) = diagonal[m],   q(l, m) = a[l][m] z q(l-1, m) + b[l][m] q(l-2, m).
// They are worked out by the compiler, so that unrolled code has them as literals.
#include <lambent/basis/sh.h>

#include <numbers>

namespace lambent {

// By degree l and frequency m.
template <class T>
struct ShTablesOf {
  T diagonal[max_sh_order]{};
  T a[max_sh_order][max_sh_order]{}, b[max_sh_order][max_sh_order]{};
};
// As they are worked out.
using ShTables = ShTablesOf<double>;

// Rounded like std::sqrt (the test compares every entry's bits): Newton's method in more digits, from above.
constexpr double constant_sqrt(double value) {
  long double root = value > 1 ? value : 1;
  while (true) {
    const long double next = (root + value / root) / 2;
    if (next >= root) return double(root);
    root = next;
  }
}

constexpr ShTables make_sh_tables() {
  ShTables t;
  double q = constant_sqrt(1 / (4 * std::numbers::pi));
  for (int m = 0; m < max_sh_order; ++m) {
    t.diagonal[m] = q * (m > 0 ? std::numbers::sqrt2 : 1.0) * (m % 2 ? -1.0 : 1.0);  // sqrt 2 and Condon-Shortley sign
    q *= constant_sqrt((2.0 * m + 3) / (2.0 * m + 2));
    for (int l = m + 1; l < max_sh_order; ++l) {
      const double l2 = double(l) * l, m2 = double(m) * m, k = double(l - 1) * (l - 1);
      t.a[l][m] = constant_sqrt((4 * l2 - 1) / (l2 - m2));
      t.b[l][m] = l > m + 1 ? -constant_sqrt((2.0 * l + 1) * (k - m2) / ((2.0 * l - 3) * (l2 - m2))) : 0.0;
    }
  }
  return t;
}
// The constants.
inline constexpr ShTables sh_tables_exact = make_sh_tables();
// The same.
constexpr const ShTables& sh_tables() { return sh_tables_exact; }

// The same in single or double precision.
template <class T>
constexpr ShTablesOf<T> round_sh_tables() {
  ShTablesOf<T> t;
  for (int l = 0; l < max_sh_order; ++l) {
    t.diagonal[l] = T(sh_tables_exact.diagonal[l]);
    for (int m = 0; m < l; ++m) t.a[l][m] = T(sh_tables_exact.a[l][m]), t.b[l][m] = T(sh_tables_exact.b[l][m]);
  }
  return t;
}
template <class T>
inline constexpr ShTablesOf<T> sh_tables_rounded = round_sh_tables<T>();

}  // namespace lambent

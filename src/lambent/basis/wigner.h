#pragma once
// Wigner 3j symbols of integer degrees, in double; relative errors of about 1e-13 of the greatest symbol of a family at
// degree 40.
#include <vector>

namespace lambent {

// The symbols (j j2 j3; -m2-m3 m2 m3) for all j that may be other than zero: values[i] belongs to j = first + i.
// Needs |m2| <= j2 and |m3| <= j3. A recurrence in j, run from both ends towards the middle, where it is stable both
// ways.
struct Wigner3jFamily {
  int first = 0;
  std::vector<double> values;
};
Wigner3jFamily wigner_3j_family(int j2, int j3, int m2, int m3);

// One symbol (j1 j2 j3; m1 m2 m3), degrees >= 0; zero where the selection rules say so.
double wigner_3j(int j1, int j2, int j3, int m1, int m2, int m3);

}  // namespace lambent

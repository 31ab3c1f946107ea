#pragma once
// Bases of lobes, functions of the angle to an axis, alone or together with spherical harmonics: "order n and K lamps".
// They are not orthonormal, so a function f = sum_i c_i b_i has coefficients c_i = integral of f b~_i with the DUAL
// functions b~_i = sum_j (G^-1)_ij b_j, G_ij = integral of b_i b_j. Source: general-prt (directional, compact,
// steerable and custom light bases).
#include <lambent/basis/sh.h>

namespace lambent {

// Its shape, at angle t to the axis.
enum class LobeKind {
  cosine_power,      // max(0, cos t)^s, s >= 1: nothing beyond 90 degrees
  von_mises_fisher,  // exp(s (cos t - 1)), s > 0: smooth everywhere
  compact,       // max(0, 1 - s (1 - cos t) / 3)^3, s in [1.5, 1024]: nothing beyond cos t = 1 - 3 / s, twice smooth
  band_limited,  // sum over l < s of (2 l + 1) P_l(cos t) / s^2, s whole, in [1, max_sh_order]: within s bands
};
extern const char* const lobe_names[4];  // by kind

// A function of the angle to an axis.
struct Lobe {
  Vec3 axis;        // unit
  float sharpness;  // s above
};

// Sharpness that the functions below take; the sharpest lobe is 0.2 degrees across, less than the sun.
inline constexpr float max_sharpness = 1e5f;
// Is the axis of unit length, and the sharpness within the limits of its kind? False for numbers that are not finite.
bool is_lobe(LobeKind kind, const Lobe& lobe);

// A lobe's value at an angle of this cosine to its axis, at most 1; the factor that makes the integral of its square 1.
// Of lobes so scaled: the integral over the sphere, and that of the product of two (1 for equal ones).
double lobe_value(LobeKind kind, double sharpness, double cosine);
double lobe_scale(LobeKind kind, double sharpness);
double lobe_integral(LobeKind kind, double sharpness);
double lobe_overlap(LobeKind kind, const Lobe& a, const Lobe& b);
// The angle beyond which there is nothing of it, or less than a part in 10^12 of its peak.
double lobe_reach(LobeKind kind, double sharpness);

// A direction about the axis +z with density lobe / integral, from u in [0, 1)^2. Not of band-limited ones, which are
// negative in places.
Vec3 sample_lobe(LobeKind kind, float sharpness, Vec2 u);

// Irradiance from a scaled lobe, the integral of it times max(0, n . d), as Legendre coefficients of the function of n
// . axis.
std::vector<double> lobe_irradiance(LobeKind kind, double sharpness);
double evaluate_legendre(std::span<const double> coefficients, double x);

// `count` directions spread evenly over the sphere (a Fibonacci lattice), no two alike.
std::vector<Vec3> even_directions(int count);
// von Mises-Fisher lobes about them. Broader ones hold smooth functions better, but their duals grow; these have fallen
// to a third at a neighbour's axis, and the dual functions are up to 5 times as large as they are (in norm). Or compact
// ones, `count` at least 10, each over ten times its share of the sphere.
std::vector<Lobe> even_lobes(int count, LobeKind kind = LobeKind::von_mises_fisher);
// bands^2 turned copies of the one band-limited lobe, about directions where they span the bands: moved uphill from
// even ones until the determinant of their Gram matrix hardly grows ("extremal points", Sloan and Womersley 2004). They
// are steerable: what they make up turns into what they make up.
std::vector<Lobe> steerable_lobes(int bands);

// Order n of spherical harmonics (0 for none), then the lobes, each scaled so that the integral of its square is 1.
struct DirectionalBasis {
  int sh_order = 0;
  LobeKind kind = LobeKind::von_mises_fisher;
  std::vector<Lobe> lobes;
  std::vector<double> gram, dual;  // G and its (pseudo-)inverse, count x count, row-major
  int rank = 0;                    // count, unless the functions are dependent to within the cutoff
  double condition = 1;            // greatest over least eigenvalue of G that is kept
  size_t count() const { return size_t(sh_count(sh_order)) + lobes.size(); }
};
// Eigenvalues of G at or below `cutoff` times the greatest are left out, so that functions that are nearly dependent
// (two equal lamps, a broad lamp that the harmonics can make) do not get huge coefficients of opposite sign.
DirectionalBasis make_directional_basis(int sh_order, LobeKind kind, std::vector<Lobe> lobes, double cutoff = 1e-10);

// The functions and their duals at the unit direction d; out has count() values.
void evaluate_directional(const DirectionalBasis& basis, Vec3d d, std::span<double> out);
void evaluate_directional_dual(const DirectionalBasis& basis, Vec3d d, std::span<double> out);

// The least-squares coefficients of f, by quadrature of exact_order nodes in z and twice as many about it.
std::vector<double> project_directional(const DirectionalBasis& basis, const std::function<double(Vec3d)>& f,
                                        int exact_order = 64);
// The same from the integrals of f b_i.
std::vector<double> apply_directional_dual(const DirectionalBasis& basis, std::span<const double> integrals);
double reconstruct_directional(const DirectionalBasis& basis, std::span<const double> coefficients, Vec3d d);

// The function turned by `rotation`, as coefficients: those that fit best, and the integral of the square of what they
// lose. Harmonics alone and steerable lobes lose nothing; others wobble.
struct TurnedCoefficients {
  std::vector<double> coefficients;
  double lost = 0;
};
TurnedCoefficients turn_directional(const DirectionalBasis& basis, std::span<const double> coefficients,
                                    const Mat3& rotation);

// The function with its harmonics turned, and its lobes about `axes`, one a lobe: lamps that move while the rest stays.
struct MovedCoefficients {
  std::vector<double> coefficients;
  double lost = 0, whole = 0;  // integrals of squares: of what the basis does not hold, of the moved function
};
// Those that fit best. Closed form.
MovedCoefficients move_directional(const DirectionalBasis& basis, std::span<const double> coefficients,
                                   const Mat3& rotation, std::span<const Vec3> axes);

// The part of the function that spherical harmonics of `order` can hold: order^2 coefficients, in closed form
// (Funk-Hecke). With it lamps light what was baked for harmonics.
std::vector<double> directional_to_sh(const DirectionalBasis& basis, std::span<const double> coefficients, int order);

}  // namespace lambent

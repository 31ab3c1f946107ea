// Follows: J. Ivanic and K. Ruedenberg, "Rotation matrices for real spherical harmonics. Direct determination by
// recursion", J. Phys. Chem. 100 (1996) with the corrections of 102 (1998). Their harmonics lack the Condon-Shortley
// sign: element (m, n) takes (-1)^(m+n) at the end.
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>

namespace lambent {
namespace {

// A (2l+1) x (2l+1) matrix addressed by m, n in [-l, l].
struct Block {
  int l;
  std::vector<double> values;
  explicit Block(int band) : l(band), values(size_t((2 * band + 1) * (2 * band + 1))) {}
  double& operator()(int m, int n) { return values[size_t((m + l) * (2 * l + 1) + n + l)]; }
  double operator()(int m, int n) const { return values[size_t((m + l) * (2 * l + 1) + n + l)]; }
};

// The function P of their table 2: products of the first band with the band below.
double P(int i, int a, int b, int l, const Block& first, const Block& below) {
  if (b == l) return first(i, 1) * below(a, l - 1) - first(i, -1) * below(a, -l + 1);
  if (b == -l) return first(i, 1) * below(a, -l + 1) + first(i, -1) * below(a, l - 1);
  return first(i, 0) * below(a, b);
}

double element(int l, int m, int n, const Block& first, const Block& below) {
  const int am = std::abs(m);
  const double d = m == 0 ? 1 : 0;
  const double denominator = std::abs(n) < l ? double((l + n) * (l - n)) : double(2 * l * (2 * l - 1));
  const double u = std::sqrt((l + m) * (l - m) / denominator);
  const double v = 0.5 * std::sqrt((1 + d) * (l + am - 1) * (l + am) / denominator) * (1 - 2 * d);
  const double w = -0.5 * std::sqrt((l - am - 1) * (l - am) / denominator) * (1 - d);
  auto p = [&](int i, int a) { return P(i, a, n, l, first, below); };
  double sum = 0;
  if (u != 0) sum += u * p(0, m);
  if (v != 0) {
    double V;
    if (m == 0) V = p(1, 1) + p(-1, -1);
    else if (m > 0) V = m == 1 ? p(1, 0) * std::numbers::sqrt2 : p(1, m - 1) - p(-1, -m + 1);
    else V = m == -1 ? p(-1, 0) * std::numbers::sqrt2 : p(1, m + 1) + p(-1, -m - 1);
    sum += v * V;
  }
  if (w != 0) sum += w * (m > 0 ? p(1, m + 1) + p(-1, -m - 1) : p(1, m - 1) - p(-1, -m + 1));
  return sum;
}

}  // namespace

ShRotation make_sh_rotation(int order, const Mat3& R) {
  LAMBENT_CHECK(order >= 0 && order <= max_sh_order);
  ShRotation rotation{order, {}};
  Block first(1), band(0);
  const int axis[3] = {1, 2, 0};  // m = -1, 0, 1 are y, z, x
  for (int m = -1; m <= 1; ++m)
    for (int n = -1; n <= 1; ++n) first(m, n) = R[axis[n + 1]][axis[m + 1]];
  band(0, 0) = 1;
  for (int l = 0; l < order; ++l) {
    if (l == 1) band = first;
    if (l > 1) {
      Block next(l);
      for (int m = -l; m <= l; ++m)
        for (int n = -l; n <= l; ++n) next(m, n) = element(l, m, n, first, band);
      band = next;
    }
    for (int m = -l; m <= l; ++m)
      for (int n = -l; n <= l; ++n) rotation.blocks.push_back(float((m + n) % 2 ? -band(m, n) : band(m, n)));
  }
  return rotation;
}

namespace {
template <class T>
void rotate(const ShRotation& rotation, const T* in, T* out) {
  const float* block = rotation.blocks.data();
  for (int l = 0; l < rotation.order; ++l) {
    const int n = 2 * l + 1;
    for (int row = 0; row < n; ++row, block += n) {
      T sum(0.0f);
      for (int k = 0; k < n; ++k) sum += block[k] * in[l * l + k];
      out[l * l + row] = sum;
    }
  }
}

void turn_about_z(int order, float angle, std::span<float> c) {
  float cos_a = std::cos(angle), sin_a = std::sin(angle), cm = 1, sm = 0;
  for (int m = 1; m < order; ++m) {
    float next = cm * cos_a - sm * sin_a;
    sm = cm * sin_a + sm * cos_a, cm = next;
    for (int l = m; l < order; ++l) {
      float& plus = c[size_t(sh_index(l, m))];
      float& minus = c[size_t(sh_index(l, -m))];
      float p = plus;
      plus = p * cm - minus * sm, minus = p * sm + minus * cm;
    }
  }
}
}  // namespace

void rotate_sh(const ShRotation& rotation, std::span<const float> in, std::span<float> out) {
  LAMBENT_CHECK(in.size() == size_t(sh_count(rotation.order)) && out.size() >= in.size() && in.data() != out.data());
  rotate(rotation, in.data(), out.data());
}

std::vector<Vec3> rotate_sh(const ShRotation& rotation, std::span<const Vec3> in) {
  LAMBENT_CHECK(in.size() == size_t(sh_count(rotation.order)));
  std::vector<Vec3> out(in.size());
  rotate(rotation, in.data(), out.data());
  return out;
}

ShZyzRotator::ShZyzRotator(int order)
    : order_(order),
      quarter_x_(make_sh_rotation(order, Mat3(Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(0, -1, 0)))),
      quarter_x_back_(make_sh_rotation(order, Mat3(Vec3(1, 0, 0), Vec3(0, 0, -1), Vec3(0, 1, 0)))) {}

void ShZyzRotator::rotate(float a, float b, float c, std::span<float> coefficients) const {
  // Ry(b) = Rx(-90) Rz(b) Rx(90): Rx(-90) takes z to y.
  float other[sh_count(max_sh_order)];
  std::span<float> turned(other, coefficients.size());
  turn_about_z(order_, c, coefficients);
  lambent::rotate(quarter_x_, coefficients.data(), other);
  turn_about_z(order_, b, turned);
  lambent::rotate(quarter_x_back_, other, coefficients.data());
  turn_about_z(order_, a, coefficients);
}

}  // namespace lambent

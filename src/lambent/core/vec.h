#pragma once
// Small vectors and matrices, our own so that no macro of a library decides how public functions take them. They are
// zero unless told otherwise. Positions are metres in glTF axes (right-handed, +Y up); colours are linear Rec. 709.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace lambent {

template <class T, int N>
struct Vector;

template <class T>
struct Vector<T, 2> {
  T x, y;
  constexpr Vector() : x(0), y(0) {}
  constexpr explicit Vector(T s) : x(s), y(s) {}
  template <class A, class B>
  constexpr Vector(A a, B b) : x(T(a)), y(T(b)) {}
  template <class U>  // implicit where nothing is lost
  constexpr explicit(sizeof(U) > sizeof(T)) Vector(const Vector<U, 2>& v) : x(T(v.x)), y(T(v.y)) {}
  template <class U>
  constexpr explicit Vector(const Vector<U, 3>& v) : x(T(v.x)), y(T(v.y)) {}
  constexpr T& operator[](size_t i) { return i == 0 ? x : y; }
  constexpr const T& operator[](size_t i) const { return i == 0 ? x : y; }
  friend constexpr Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Vector operator*(const Vector& a, const Vector& b) { return {a.x * b.x, a.y * b.y}; }
  friend constexpr Vector operator/(const Vector& a, const Vector& b) { return {a.x / b.x, a.y / b.y}; }
  friend constexpr bool operator==(const Vector&, const Vector&) = default;
};

template <class T>
struct Vector<T, 3> {
  T x, y, z;
  constexpr Vector() : x(0), y(0), z(0) {}
  constexpr explicit Vector(T s) : x(s), y(s), z(s) {}
  template <class A, class B, class C>
  constexpr Vector(A a, B b, C c) : x(T(a)), y(T(b)), z(T(c)) {}
  template <class U, class C>
  constexpr Vector(const Vector<U, 2>& v, C c) : x(T(v.x)), y(T(v.y)), z(T(c)) {}
  template <class U>  // implicit where nothing is lost
  constexpr explicit(sizeof(U) > sizeof(T)) Vector(const Vector<U, 3>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)) {}
  template <class U>
  constexpr explicit Vector(const Vector<U, 4>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)) {}
  constexpr T& operator[](size_t i) { return i == 0 ? x : i == 1 ? y : z; }
  constexpr const T& operator[](size_t i) const { return i == 0 ? x : i == 1 ? y : z; }
  friend constexpr Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vector operator*(const Vector& a, const Vector& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vector operator/(const Vector& a, const Vector& b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }
  friend constexpr bool operator==(const Vector&, const Vector&) = default;
};

template <class T>
struct Vector<T, 4> {
  T x, y, z, w;
  constexpr Vector() : x(0), y(0), z(0), w(0) {}
  constexpr explicit Vector(T s) : x(s), y(s), z(s), w(s) {}
  template <class A, class B, class C, class D>
  constexpr Vector(A a, B b, C c, D d) : x(T(a)), y(T(b)), z(T(c)), w(T(d)) {}
  template <class U, class D>
  constexpr Vector(const Vector<U, 3>& v, D d) : x(T(v.x)), y(T(v.y)), z(T(v.z)), w(T(d)) {}
  template <class U>  // implicit where nothing is lost
  constexpr explicit(sizeof(U) > sizeof(T)) Vector(const Vector<U, 4>& v)
      : x(T(v.x)), y(T(v.y)), z(T(v.z)), w(T(v.w)) {}
  constexpr T& operator[](size_t i) { return i == 0 ? x : i == 1 ? y : i == 2 ? z : w; }
  constexpr const T& operator[](size_t i) const { return i == 0 ? x : i == 1 ? y : i == 2 ? z : w; }
  friend constexpr Vector operator+(const Vector& a, const Vector& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
  }
  friend constexpr Vector operator-(const Vector& a, const Vector& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w};
  }
  friend constexpr Vector operator*(const Vector& a, const Vector& b) {
    return {a.x * b.x, a.y * b.y, a.z * b.z, a.w * b.w};
  }
  friend constexpr Vector operator/(const Vector& a, const Vector& b) {
    return {a.x / b.x, a.y / b.y, a.z / b.z, a.w / b.w};
  }
  friend constexpr bool operator==(const Vector&, const Vector&) = default;
};

using Vec2 = Vector<float, 2>;
using Vec3 = Vector<float, 3>;
using Vec4 = Vector<float, 4>;
using Vec2d = Vector<double, 2>;
using Vec3d = Vector<double, 3>;
using Vec4d = Vector<double, 4>;

// Scalars may be of any type that converts: the vector's decides.
template <class T>
struct SameType {
  using type = T;
};
template <class T>
using Scalar = typename SameType<T>::type;

template <class T, int N>
constexpr Vector<T, N> operator+(const Vector<T, N>& v, Scalar<T> s) {
  return v + Vector<T, N>(s);
}
template <class T, int N>
constexpr Vector<T, N> operator-(const Vector<T, N>& v, Scalar<T> s) {
  return v - Vector<T, N>(s);
}
template <class T, int N>
constexpr Vector<T, N> operator*(const Vector<T, N>& v, Scalar<T> s) {
  return v * Vector<T, N>(s);
}
template <class T, int N>
constexpr Vector<T, N> operator*(Scalar<T> s, const Vector<T, N>& v) {
  return Vector<T, N>(s) * v;
}
template <class T, int N>
constexpr Vector<T, N> operator+(Scalar<T> s, const Vector<T, N>& v) {
  return Vector<T, N>(s) + v;
}
template <class T, int N>
constexpr Vector<T, N> operator-(Scalar<T> s, const Vector<T, N>& v) {
  return Vector<T, N>(s) - v;
}
template <class T, int N>
constexpr Vector<T, N> operator/(const Vector<T, N>& v, Scalar<T> s) {
  return v / Vector<T, N>(s);
}
template <class T, int N>
constexpr Vector<T, N> operator/(Scalar<T> s, const Vector<T, N>& v) {
  return Vector<T, N>(s) / v;
}
template <class T, int N, class B>
constexpr Vector<T, N>& operator+=(Vector<T, N>& a, const B& b) {
  return a = a + b;
}
template <class T, int N, class B>
constexpr Vector<T, N>& operator-=(Vector<T, N>& a, const B& b) {
  return a = a - b;
}
template <class T, int N, class B>
constexpr Vector<T, N>& operator*=(Vector<T, N>& a, const B& b) {
  return a = a * b;
}
template <class T, int N, class B>
constexpr Vector<T, N>& operator/=(Vector<T, N>& a, const B& b) {
  return a = a / b;
}

// f of each component, or of each pair of them.
template <class T, int N>
constexpr Vector<T, N> each(const Vector<T, N>& v, auto f) {
  Vector<T, N> out;
  for (size_t i = 0; i < N; ++i) out[i] = f(v[i]);
  return out;
}
template <class T, int N>
constexpr Vector<T, N> each(const Vector<T, N>& a, const Vector<T, N>& b, auto f) {
  Vector<T, N> out;
  for (size_t i = 0; i < N; ++i) out[i] = f(a[i], b[i]);
  return out;
}
template <class T, int N>
constexpr Vector<T, N> operator-(const Vector<T, N>& v) {
  return each(v, [](T x) { return -x; });
}

template <class T>
constexpr T dot(const Vector<T, 2>& a, const Vector<T, 2>& b) {
  return a.x * b.x + a.y * b.y;
}
template <class T>
constexpr T dot(const Vector<T, 3>& a, const Vector<T, 3>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr T dot(const Vector<T, 4>& a, const Vector<T, 4>& b) {
  return (a.x * b.x + a.y * b.y) + (a.z * b.z + a.w * b.w);
}
template <class T>
constexpr Vector<T, 3> cross(const Vector<T, 3>& a, const Vector<T, 3>& b) {
  return {a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y};
}
template <class T, int N>
T length(const Vector<T, N>& v) {
  return std::sqrt(dot(v, v));
}
template <class T, int N>
T distance(const Vector<T, N>& a, const Vector<T, N>& b) {
  return length(b - a);
}
// Not finite where v is zero; normalize_or() below has a way out.
template <class T, int N>
Vector<T, N> normalize(const Vector<T, N>& v) {
  return v * (T(1) / std::sqrt(dot(v, v)));
}
template <class T, int N>
Vector<T, N> reflect(const Vector<T, N>& v, const Vector<T, N>& n) {
  return v - n * dot(n, v) * T(2);
}

// Componentwise.
template <class T, int N>
constexpr Vector<T, N> min(const Vector<T, N>& a, const Vector<T, N>& b) {
  return each(a, b, [](T x, T y) { return std::min(x, y); });
}
template <class T, int N>
constexpr Vector<T, N> max(const Vector<T, N>& a, const Vector<T, N>& b) {
  return each(a, b, [](T x, T y) { return std::max(x, y); });
}
template <class T, int N>
constexpr Vector<T, N> max(const Vector<T, N>& v, Scalar<T> s) {
  return max(v, Vector<T, N>(s));
}
template <class T, int N>
constexpr Vector<T, N> clamp(const Vector<T, N>& v, const Vector<T, N>& low, const Vector<T, N>& high) {
  return min(max(v, low), high);
}
template <class T, int N>
constexpr Vector<T, N> clamp(const Vector<T, N>& v, Scalar<T> low, Scalar<T> high) {
  return clamp(v, Vector<T, N>(low), Vector<T, N>(high));
}
template <class T, int N>
constexpr Vector<T, N> mix(const Vector<T, N>& a, const Vector<T, N>& b, Scalar<T> t) {
  return a * (T(1) - t) + b * t;
}
template <class T, int N>
Vector<T, N> abs(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::abs(x); });
}
template <class T, int N>
Vector<T, N> floor(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::floor(x); });
}
template <class T, int N>
Vector<T, N> round(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::round(x); });
}
template <class T, int N>
Vector<T, N> exp(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::exp(x); });
}
template <class T, int N>
Vector<T, N> log(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::log(x); });
}
template <class T, int N>
Vector<T, N> sqrt(const Vector<T, N>& v) {
  return each(v, [](T x) { return std::sqrt(x); });
}

// Whether a[i] <= b[i] for every i.
template <class T, int N>
constexpr bool all_at_most(const Vector<T, N>& a, const Vector<T, N>& b) {
  for (size_t i = 0; i < N; ++i)
    if (!(a[i] <= b[i])) return false;
  return true;
}

template <class T>
constexpr T radians(T degrees) {
  return degrees * T(0.01745329251994329576923690768489);
}
template <class T>
constexpr T degrees(T radians) {
  return radians * T(57.295779513082320876798154814105);
}

// Column-major: m[column][row].
template <class T, int N>
struct Matrix {
  Vector<T, N> columns[N];
  constexpr Matrix() = default;  // zero
  constexpr explicit Matrix(T diagonal) {
    for (size_t i = 0; i < N; ++i) columns[i][i] = diagonal;
  }
  constexpr Matrix(const Vector<T, 3>& a, const Vector<T, 3>& b, const Vector<T, 3>& c) requires(N == 3)
      : columns{a, b, c} {}
  constexpr Matrix(const Vector<T, 4>& a, const Vector<T, 4>& b, const Vector<T, 4>& c,
                   const Vector<T, 4>& d) requires(N == 4)
      : columns{a, b, c, d} {}
  // Column after column.
  constexpr Matrix(T a, T b, T c, T d, T e, T f, T g, T h, T i) requires(N == 3)
      : columns{{a, b, c}, {d, e, f}, {g, h, i}} {}
  // The upper left of a larger one; a smaller one in the upper left of the identity.
  template <class U, int M>
  constexpr explicit Matrix(const Matrix<U, M>& m) {
    for (size_t c = 0; c < N; ++c)
      for (size_t r = 0; r < N; ++r) columns[c][r] = c < M && r < M ? T(m[c][r]) : T(c == r);
  }
  constexpr Vector<T, N>& operator[](size_t c) { return columns[c]; }
  constexpr const Vector<T, N>& operator[](size_t c) const { return columns[c]; }
  friend constexpr bool operator==(const Matrix&, const Matrix&) = default;
};

using Mat3 = Matrix<float, 3>;
using Mat4 = Matrix<float, 4>;
using Mat3d = Matrix<double, 3>;
using Mat4d = Matrix<double, 4>;

template <class T>
constexpr Vector<T, 3> operator*(const Matrix<T, 3>& m, const Vector<T, 3>& v) {
  return {m[0].x * v.x + m[1].x * v.y + m[2].x * v.z, m[0].y * v.x + m[1].y * v.y + m[2].y * v.z,
          m[0].z * v.x + m[1].z * v.y + m[2].z * v.z};
}
template <class T>
constexpr Vector<T, 4> operator*(const Matrix<T, 4>& m, const Vector<T, 4>& v) {
  return (m[0] * v.x + m[1] * v.y) + (m[2] * v.z + m[3] * v.w);
}
// transpose(m) * v
template <class T, int N>
constexpr Vector<T, N> operator*(const Vector<T, N>& v, const Matrix<T, N>& m) {
  Vector<T, N> out;
  for (size_t c = 0; c < N; ++c) out[c] = dot(m[c], v);
  return out;
}
template <class T>
constexpr Matrix<T, 3> operator*(const Matrix<T, 3>& a, const Matrix<T, 3>& b) {
  return {a * b[0], a * b[1], a * b[2]};
}
template <class T>
constexpr Matrix<T, 4> operator*(const Matrix<T, 4>& a, const Matrix<T, 4>& b) {
  Matrix<T, 4> out;
  for (size_t c = 0; c < 4; ++c) out[c] = a[0] * b[c].x + a[1] * b[c].y + a[2] * b[c].z + a[3] * b[c].w;
  return out;
}
template <class T, int N>
constexpr Matrix<T, N> each_column(const Matrix<T, N>& a, const Matrix<T, N>& b, auto f) {
  Matrix<T, N> out;
  for (size_t c = 0; c < N; ++c) out[c] = f(a[c], b[c]);
  return out;
}
template <class T, int N>
constexpr Matrix<T, N> operator+(const Matrix<T, N>& a, const Matrix<T, N>& b) {
  return each_column(a, b, [](const auto& x, const auto& y) { return x + y; });
}
template <class T, int N>
constexpr Matrix<T, N> operator-(const Matrix<T, N>& a, const Matrix<T, N>& b) {
  return each_column(a, b, [](const auto& x, const auto& y) { return x - y; });
}
template <class T, int N>
constexpr Matrix<T, N> operator*(const Matrix<T, N>& m, Scalar<T> s) {
  return each_column(m, m, [s](const auto& x, const auto&) { return x * s; });
}
template <class T, int N>
constexpr Matrix<T, N> operator*(Scalar<T> s, const Matrix<T, N>& m) {
  return m * s;
}
template <class T, int N>
constexpr Matrix<T, N> operator/(const Matrix<T, N>& m, Scalar<T> s) {
  return each_column(m, m, [s](const auto& x, const auto&) { return x / s; });
}
template <class T, int N>
constexpr Matrix<T, N> operator-(const Matrix<T, N>& m) {
  return each_column(m, m, [](const auto& x, const auto&) { return -x; });
}
template <class T, int N>
constexpr Matrix<T, N>& operator+=(Matrix<T, N>& a, const Matrix<T, N>& b) {
  return a = a + b;
}
template <class T, int N>
constexpr Matrix<T, N>& operator*=(Matrix<T, N>& m, Scalar<T> s) {
  return m = m * s;
}
template <class T, int N>
constexpr Matrix<T, N>& operator/=(Matrix<T, N>& m, Scalar<T> s) {
  return m = m / s;
}
template <class T, int N>
constexpr Matrix<T, N> transpose(const Matrix<T, N>& m) {
  Matrix<T, N> out;
  for (size_t c = 0; c < N; ++c)
    for (size_t r = 0; r < N; ++r) out[c][r] = m[r][c];
  return out;
}
template <class T>
constexpr T determinant(const Matrix<T, 3>& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[2][1] * m[1][2]) - m[1][0] * (m[0][1] * m[2][2] - m[2][1] * m[0][2]) +
         m[2][0] * (m[0][1] * m[1][2] - m[1][1] * m[0][2]);
}
// Not finite where the matrix has none.
template <class T>
constexpr Matrix<T, 3> inverse(const Matrix<T, 3>& m) {
  const T f = T(1) / determinant(m);
  return {{(m[1][1] * m[2][2] - m[2][1] * m[1][2]) * f, -(m[0][1] * m[2][2] - m[2][1] * m[0][2]) * f,
           (m[0][1] * m[1][2] - m[1][1] * m[0][2]) * f},
          {-(m[1][0] * m[2][2] - m[2][0] * m[1][2]) * f, (m[0][0] * m[2][2] - m[2][0] * m[0][2]) * f,
           -(m[0][0] * m[1][2] - m[1][0] * m[0][2]) * f},
          {(m[1][0] * m[2][1] - m[2][0] * m[1][1]) * f, -(m[0][0] * m[2][1] - m[2][0] * m[0][1]) * f,
           (m[0][0] * m[1][1] - m[1][0] * m[0][1]) * f}};
}
// Of a matrix whose last row is 0, 0, 0, 1.
template <class T>
constexpr Matrix<T, 4> inverse_affine(const Matrix<T, 4>& m) {
  const Matrix<T, 3> linear = inverse(Matrix<T, 3>(m));
  Matrix<T, 4> out(linear);
  out[3] = Vector<T, 4>(-(linear * Vector<T, 3>(m[3])), T(1));
  return out;
}

inline constexpr float pi = std::numbers::pi_v<float>;

// Rec. 709 luminance of a linear colour.
inline float luminance(Vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

inline float largest(Vec3 v) { return std::max({v.x, v.y, v.z}); }
inline bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// Unit vector along v, or `fallback` where v is too short to have a direction.
inline Vec3 normalize_or(Vec3 v, Vec3 fallback) {
  float len2 = dot(v, v);
  return len2 > 1e-30f && std::isfinite(len2) ? v / std::sqrt(len2) : fallback;
}

// The rotation of a unit quaternion, (x, y, z, w).
template <class T>
Matrix<T, 3> rotation_from_quaternion(const Vector<T, 4>& q) {
  const T xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z, xz = q.x * q.z, xy = q.x * q.y, yz = q.y * q.z;
  const T wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
  return {{1 - 2 * (yy + zz), 2 * (xy + wz), 2 * (xz - wy)},
          {2 * (xy - wz), 1 - 2 * (xx + zz), 2 * (yz + wx)},
          {2 * (xz + wy), 2 * (yz - wx), 1 - 2 * (xx + yy)}};
}
// The rotation by `angle`, radians, about a unit axis.
template <class T>
Matrix<T, 3> rotation_about(const Vector<T, 3>& axis, Scalar<T> angle) {
  return rotation_from_quaternion(Vector<T, 4>(axis * std::sin(angle / 2), std::cos(angle / 2)));
}

// Columns (t, b, n): a right-handed orthonormal frame about the unit vector n.
// Source: Duff et al. 2017, "Building an orthonormal basis, revisited".
inline Mat3 frame_about(Vec3 n) {
  float sign = std::copysign(1.0f, n.z);
  float a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  return {Vec3(1 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3(b, sign + n.y * n.y * a, -n.y), n};
}

// Rotation by yaw about +Y, then pitch about +X, then roll about +Z, degrees, applied in the order roll, pitch, yaw:
// R = Ry(yaw) Rx(pitch) Rz(roll). It acts on functions as (Rf)(s) = f(R^-1 s).
inline Mat3 rotation_from_yaw_pitch_roll(Vec3 degrees) {
  Vec3 r = each(degrees, [](float d) { return radians(d); });
  float cy = std::cos(r.x), sy = std::sin(r.x), cp = std::cos(r.y), sp = std::sin(r.y), cr = std::cos(r.z),
        sr = std::sin(r.z);
  Mat3 yaw(Vec3(cy, 0, -sy), Vec3(0, 1, 0), Vec3(sy, 0, cy));
  Mat3 pitch(Vec3(1, 0, 0), Vec3(0, cp, sp), Vec3(0, -sp, cp));
  Mat3 roll(Vec3(cr, sr, 0), Vec3(-sr, cr, 0), Vec3(0, 0, 1));
  return yaw * pitch * roll;
}

struct Bounds {
  Vec3 min{INFINITY}, max{-INFINITY};
  void extend(Vec3 p) { min = lambent::min(min, p), max = lambent::max(max, p); }
  bool empty() const { return !(min.x <= max.x); }
  Vec3 centre() const { return 0.5f * (min + max); }
  float diagonal() const { return empty() ? 0.0f : length(max - min); }
};

}  // namespace lambent

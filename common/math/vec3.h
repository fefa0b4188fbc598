#pragma once

// Fixed 3-vectors and 3x3 blocks whose arithmetic is written out, operation by operation. State
// code uses these and not Eigen, which was seen to emit fused multiply-adds and address-dependent
// sums even with contraction off. All operations are IEEE exact roundings (+ - * / sqrt).

#include <cmath>

namespace trocar {

template <typename T>
struct Vec3 {
  T x{}, y{}, z{};

  constexpr Vec3 operator+(const Vec3& b) const { return {x + b.x, y + b.y, z + b.z}; }
  constexpr Vec3 operator-(const Vec3& b) const { return {x - b.x, y - b.y, z - b.z}; }
  constexpr Vec3 operator-() const { return {-x, -y, -z}; }
  constexpr Vec3 operator*(T s) const { return {x * s, y * s, z * s}; }
  constexpr Vec3 operator/(T s) const { return {x / s, y / s, z / s}; }
  constexpr Vec3& operator+=(const Vec3& b) { return *this = *this + b; }
  constexpr Vec3& operator-=(const Vec3& b) { return *this = *this - b; }
  constexpr Vec3& operator*=(T s) { return *this = *this * s; }
  constexpr bool operator==(const Vec3&) const = default;
};
template <typename T>
constexpr Vec3<T> operator*(T s, const Vec3<T>& a) {
  return a * s;
}

template <typename T>
constexpr T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename T>
constexpr T length_squared(const Vec3<T>& a) {
  return dot(a, a);
}
template <typename T>
T length(const Vec3<T>& a) {
  return std::sqrt(length_squared(a));
}
// Unit vector along a; `fallback` when a is shorter than the smallest normal number.
template <typename T>
Vec3<T> normalized(const Vec3<T>& a, const Vec3<T>& fallback) {
  const T l = length(a);
  return l > T(1e-30) ? a / l : fallback;
}
template <typename T>
bool is_finite(const Vec3<T>& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

inline Vec3f to_float(const Vec3d& a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
inline Vec3d to_double(const Vec3f& a) {
  return {a.x, a.y, a.z};
}

// A symmetric 3x3 matrix keeps its upper triangle.
template <typename T>
struct SymMat3 {
  T xx{}, xy{}, xz{}, yy{}, yz{}, zz{};

  constexpr SymMat3& operator+=(const SymMat3& b) {
    xx += b.xx, xy += b.xy, xz += b.xz, yy += b.yy, yz += b.yz, zz += b.zz;
    return *this;
  }
  // Adds s * I.
  constexpr void add_identity(T s) { xx += s, yy += s, zz += s; }
  // Adds s * a a^T.
  constexpr void add_outer(const Vec3<T>& a, T s) {
    const Vec3<T> b = a * s;
    xx += a.x * b.x, xy += a.x * b.y, xz += a.x * b.z;
    yy += a.y * b.y, yz += a.y * b.z, zz += a.z * b.z;
  }
  constexpr Vec3<T> operator*(const Vec3<T>& v) const {
    return {xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z};
  }
};
using SymMat3f = SymMat3<float>;

// Solves A x = b by cofactors. A must be positive definite; returns zero where the determinant is
// not a normal positive number, so that a broken block moves nothing.
template <typename T>
Vec3<T> solve_positive_definite(const SymMat3<T>& a, const Vec3<T>& b) {
  const T cxx = a.yy * a.zz - a.yz * a.yz;
  const T cxy = a.xz * a.yz - a.xy * a.zz;
  const T cxz = a.xy * a.yz - a.xz * a.yy;
  const T determinant = a.xx * cxx + a.xy * cxy + a.xz * cxz;
  if (!(determinant > T(0)) || !std::isfinite(determinant)) return {};
  const T cyy = a.xx * a.zz - a.xz * a.xz;
  const T cyz = a.xy * a.xz - a.xx * a.yz;
  const T czz = a.xx * a.yy - a.xy * a.xy;
  const T inverse = T(1) / determinant;
  return {(cxx * b.x + cxy * b.y + cxz * b.z) * inverse,
          (cxy * b.x + cyy * b.y + cyz * b.z) * inverse,
          (cxz * b.x + cyz * b.y + czz * b.z) * inverse};
}

}  // namespace trocar

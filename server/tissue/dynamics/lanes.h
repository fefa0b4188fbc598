#pragma once

// Eight nodes at once: one AVX2 register per quantity, one lane per node. Every operation is one
// IEEE rounding per lane (fused multiply-adds are written as such and never left to the compiler),
// and lanes never mix, so a node's result does not depend on which nodes share its group, nor on
// compiler, worker or build.

#include <immintrin.h>

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/math/vec3.h"

namespace trocar::dynamics {

inline constexpr std::uint32_t kLanes = 8;

using Float8 = __m256;

// A vector that one 16-byte load fetches; w is padding.
struct alignas(16) Float4 {
  float x = 0, y = 0, z = 0, w = 0;
};
inline Vec3f to_vec3(const Float4& v) {
  return {v.x, v.y, v.z};
}
inline Float4 to_float4(const Vec3f& v) {
  return {v.x, v.y, v.z, 0};
}

struct alignas(32) Lanes {
  float v[kLanes] = {};
};
struct alignas(32) SlotLanes {
  std::uint32_t v[kLanes] = {};
};
struct Vec3Lanes {
  Lanes x, y, z;

  void set(std::size_t lane, const Vec3f& a) { x.v[lane] = a.x, y.v[lane] = a.y, z.v[lane] = a.z; }
  Vec3f at(std::size_t lane) const { return {x.v[lane], y.v[lane], z.v[lane]}; }
};

inline Float8 load(const Lanes& a) {
  return _mm256_load_ps(a.v);
}
inline void store(Lanes& a, Float8 v) {
  _mm256_store_ps(a.v, v);
}
inline Float8 all(float value) {
  return _mm256_set1_ps(value);
}
// a * b + c, and c - a * b, rounded once.
inline Float8 fma8(Float8 a, Float8 b, Float8 c) {
  return _mm256_fmadd_ps(a, b, c);
}
inline Float8 fnma8(Float8 a, Float8 b, Float8 c) {
  return _mm256_fnmadd_ps(a, b, c);
}

struct Vec8 {
  Float8 x, y, z;

  Vec8 operator+(const Vec8& b) const { return {x + b.x, y + b.y, z + b.z}; }
  Vec8 operator-(const Vec8& b) const { return {x - b.x, y - b.y, z - b.z}; }
  Vec8 operator*(Float8 s) const { return {x * s, y * s, z * s}; }
};
inline Vec8 zero_vec8() {
  return {all(0), all(0), all(0)};
}
inline Vec8 load(const Vec3Lanes& a) {
  return {load(a.x), load(a.y), load(a.z)};
}
inline void store(Vec3Lanes& a, const Vec8& v) {
  store(a.x, v.x), store(a.y, v.y), store(a.z, v.z);
}
inline Float8 dot8(const Vec8& a, const Vec8& b) {
  return fma8(a.z, b.z, fma8(a.y, b.y, a.x * b.x));
}
inline Vec8 cross8(const Vec8& a, const Vec8& b) {
  return {fnma8(a.z, b.y, a.y * b.z), fnma8(a.x, b.z, a.z * b.x), fnma8(a.y, b.x, a.x * b.y)};
}
// a s + b
inline Vec8 fma8(const Vec8& a, Float8 s, const Vec8& b) {
  return {fma8(a.x, s, b.x), fma8(a.y, s, b.y), fma8(a.z, s, b.z)};
}

struct SymMat8 {
  Float8 xx, xy, xz, yy, yz, zz;

  void add_identity(Float8 s) { xx = xx + s, yy = yy + s, zz = zz + s; }
  // Adds s a a^T.
  void add_outer(const Vec8& a, Float8 s) {
    const Vec8 b = a * s;
    xx = fma8(a.x, b.x, xx), xy = fma8(a.x, b.y, xy), xz = fma8(a.x, b.z, xz);
    yy = fma8(a.y, b.y, yy), yz = fma8(a.y, b.z, yz), zz = fma8(a.z, b.z, zz);
  }
};
inline SymMat8 zero_sym_mat8() {
  return {all(0), all(0), all(0), all(0), all(0), all(0)};
}

struct Mat8 {
  Vec8 x, y, z;  // rows

  void add_identity(Float8 s) { x.x = x.x + s, y.y = y.y + s, z.z = z.z + s; }
  // Adds a b^T.
  void add_outer(const Vec8& a, const Vec8& b) {
    x = fma8(b, a.x, x), y = fma8(b, a.y, y), z = fma8(b, a.z, z);
  }
  // Adds the matrix of v x.
  void add_cross(const Vec8& v) {
    x.y = x.y - v.z, x.z = x.z + v.y;
    y.x = y.x + v.z, y.z = y.z - v.x;
    z.x = z.x - v.y, z.y = z.y + v.x;
  }
};
inline Mat8 zero_mat8() {
  return {zero_vec8(), zero_vec8(), zero_vec8()};
}

struct SymMat3Lanes {
  Lanes xx, xy, xz, yy, yz, zz;

  void set(std::size_t lane, const SymMat3f& a) {
    xx.v[lane] = a.xx, xy.v[lane] = a.xy, xz.v[lane] = a.xz;
    yy.v[lane] = a.yy, yz.v[lane] = a.yz, zz.v[lane] = a.zz;
  }
  SymMat3f at(std::size_t lane) const {
    return {xx.v[lane], xy.v[lane], xz.v[lane], yy.v[lane], yz.v[lane], zz.v[lane]};
  }
};
inline SymMat8 load(const SymMat3Lanes& a) {
  return {load(a.xx), load(a.xy), load(a.xz), load(a.yy), load(a.yz), load(a.zz)};
}
inline void store(SymMat3Lanes& a, const SymMat8& m) {
  store(a.xx, m.xx), store(a.xy, m.xy), store(a.xz, m.xz);
  store(a.yy, m.yy), store(a.yz, m.yz), store(a.zz, m.zz);
}

inline Vec8 transpose4(Float8 v0, Float8 v1, Float8 v2, Float8 v3) {
  const Float8 xy01 = _mm256_unpacklo_ps(v0, v1), xy23 = _mm256_unpacklo_ps(v2, v3);
  const Float8 z01 = _mm256_unpackhi_ps(v0, v1), z23 = _mm256_unpackhi_ps(v2, v3);
  return {_mm256_shuffle_ps(xy01, xy23, 0x44), _mm256_shuffle_ps(xy01, xy23, 0xee),
          _mm256_shuffle_ps(z01, z23, 0x44)};
}

// Vectors at eight slots. Loads and transposes: the hardware's gather was measured slower.
inline Vec8 gather(const Float4* values, const SlotLanes& slots) {
  const auto pair = [&](std::size_t lane) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(&values[slots.v[lane]].x)),
                                _mm_load_ps(&values[slots.v[lane + 4]].x), 1);
  };
  return transpose4(pair(0), pair(1), pair(2), pair(3));
}
// The same with what lies beside the vectors.
inline Vec8 gather(const Float4* values, const SlotLanes& slots, Float8& w) {
  const auto pair = [&](std::size_t lane) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(&values[slots.v[lane]].x)),
                                _mm_load_ps(&values[slots.v[lane + 4]].x), 1);
  };
  const Float8 v0 = pair(0), v1 = pair(1), v2 = pair(2), v3 = pair(3);
  w = _mm256_shuffle_ps(_mm256_unpackhi_ps(v0, v1), _mm256_unpackhi_ps(v2, v3), 0xee);
  return transpose4(v0, v1, v2, v3);
}
// Vectors at the eight slots of one group.
inline Vec8 load_group(const Float4* first) {
  const auto pair = [&](std::size_t lane) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(&first[lane].x)),
                                _mm_load_ps(&first[lane + 4].x), 1);
  };
  return transpose4(pair(0), pair(1), pair(2), pair(3));
}
// Eight vectors `stride` apart, with what lies beside them.
inline Vec8 load_strided(const Float4* first, std::size_t stride, Float8& w) {
  const auto pair = [&](std::size_t lane) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(&first[lane * stride].x)),
                                _mm_load_ps(&first[(lane + 4) * stride].x), 1);
  };
  const Float8 v0 = pair(0), v1 = pair(1), v2 = pair(2), v3 = pair(3);
  w = _mm256_shuffle_ps(_mm256_unpackhi_ps(v0, v1), _mm256_unpackhi_ps(v2, v3), 0xee);
  return transpose4(v0, v1, v2, v3);
}
inline void store_strided(Float4* first, std::size_t stride, const Vec8& v, Float8 w) {
  const Float8 xy_lo = _mm256_unpacklo_ps(v.x, v.y), xy_hi = _mm256_unpackhi_ps(v.x, v.y);
  const Float8 z_lo = _mm256_unpacklo_ps(v.z, w), z_hi = _mm256_unpackhi_ps(v.z, w);
  const Float8 n[4] = {_mm256_shuffle_ps(xy_lo, z_lo, 0x44), _mm256_shuffle_ps(xy_lo, z_lo, 0xee),
                       _mm256_shuffle_ps(xy_hi, z_hi, 0x44), _mm256_shuffle_ps(xy_hi, z_hi, 0xee)};
  for (std::size_t lane = 0; lane < 4; ++lane) {
    _mm_store_ps(&first[lane * stride].x, _mm256_castps256_ps128(n[lane]));
    _mm_store_ps(&first[(lane + 4) * stride].x, _mm256_extractf128_ps(n[lane], 1));
  }
}
inline void store_group(Float4* first, const Vec8& v) {
  store_strided(first, 1, v, all(0));
}
// The other way round, in these lanes.
inline void scatter(Float4* values, const SlotLanes& slots, const Vec8& v, std::uint8_t lanes) {
  std::array<Float4, kLanes> moved;
  store_group(moved.data(), v);
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    if (lanes >> lane & 1) values[slots.v[lane]] = moved[lane];
}
inline Float8 gather(const float* values, const SlotLanes& slots) {
  const auto& s = slots.v;
  return _mm256_setr_ps(values[s[0]], values[s[1]], values[s[2]], values[s[3]], values[s[4]],
                        values[s[5]], values[s[6]], values[s[7]]);
}

// All ones where the lane's bit is set.
inline Float8 mask_of(std::uint8_t bits) {
  const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i on = _mm256_and_si256(_mm256_set1_epi32(bits), bit);
  return _mm256_castsi256_ps(_mm256_cmpeq_epi32(on, bit));
}
inline std::uint8_t bits_of(Float8 mask) {
  return static_cast<std::uint8_t>(_mm256_movemask_ps(mask));
}
inline Float8 where(Float8 mask, Float8 v) {
  return _mm256_and_ps(mask, v);
}
inline Float8 abs8(Float8 v) {
  return _mm256_andnot_ps(all(-0.0f), v);
}
// False for infinities and NaN.
inline Float8 is_below(Float8 v, float limit) {
  return _mm256_cmp_ps(abs8(v), all(limit), _CMP_LT_OQ);
}

// Solves A x = b per lane by cofactors; zero where the determinant is not a positive number.
inline Vec8 solve_positive_definite(const SymMat8& a, const Vec8& b) {
  const Float8 cxx = fnma8(a.yz, a.yz, a.yy * a.zz);
  const Float8 cxy = fnma8(a.xy, a.zz, a.xz * a.yz);
  const Float8 cxz = fnma8(a.xz, a.yy, a.xy * a.yz);
  const Float8 cyy = fnma8(a.xz, a.xz, a.xx * a.zz);
  const Float8 cyz = fnma8(a.xx, a.yz, a.xy * a.xz);
  const Float8 czz = fnma8(a.xy, a.xy, a.xx * a.yy);
  const Float8 determinant = fma8(a.xz, cxz, fma8(a.xy, cxy, a.xx * cxx));
  const Float8 is_sound =
      _mm256_and_ps(_mm256_cmp_ps(determinant, all(0), _CMP_GT_OQ), is_below(determinant, 3e38f));
  const Float8 inverse = where(is_sound, all(1.0f) / determinant);
  return {fma8(cxz, b.z, fma8(cxy, b.y, cxx * b.x)) * inverse,
          fma8(cyz, b.z, fma8(cyy, b.y, cxy * b.x)) * inverse,
          fma8(czz, b.z, fma8(cyz, b.y, cxz * b.x)) * inverse};
}

}  // namespace trocar::dynamics

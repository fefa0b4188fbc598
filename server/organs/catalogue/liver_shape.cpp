#include "server/organs/catalogue/liver_shape.h"

#include <algorithm>
#include <cmath>

#include "server/organs/catalogue/smooth_min.h"

namespace trocar::catalogue {
namespace {

double smooth_max(double a, double b, double k) {
  return -smooth_min(-a, -b, k);
}

struct Axes {
  Vec3d u, v, w;  // orthonormal
};

// u along `along`; v as near to `up` as possible.
Axes axes(const Vec3d& along, const Vec3d& up) {
  const Vec3d u = normalized(along, Vec3d{1, 0, 0});
  const Vec3d v = normalized(up - u * dot(up, u), Vec3d{0, 1, 0});
  return {u, v, cross(u, v)};
}

// First-order distance to an axis-aligned ellipsoid with semi-axes r; exact for a sphere.
double ellipsoid(const Vec3d& p, const Vec3d& r) {
  const Vec3d a{p.x / r.x, p.y / r.y, p.z / r.z};
  const Vec3d b{a.x / r.x, a.y / r.y, a.z / r.z};
  const double k0 = length(a), k1 = length(b);
  if (k1 < 1e-9) return -std::min({r.x, r.y, r.z});
  return k0 * (k0 - 1) / k1;
}
double ellipsoid(const Vec3d& p, const Vec3d& centre, const Axes& frame, const Vec3d& r) {
  const Vec3d q = p - centre;
  return ellipsoid({dot(q, frame.u), dot(q, frame.v), dot(q, frame.w)}, r);
}

double capsule(const Vec3d& p, const Vec3d& a, const Vec3d& b, double radius) {
  const Vec3d ab = b - a, ap = p - a;
  const double t = std::clamp(dot(ap, ab) / dot(ab, ab), 0.0, 1.0);
  return length(ap - ab * t) - radius;
}

// Both lobes as if nothing lay beneath them.
double diaphragmatic_body(const Vec3d& p) {
  static const Axes right_axes = axes({1, -0.10, 0.05}, {0, 1, 0});
  static const Axes left_axes = axes({1, 0.06, 0.12}, {0, 1, 0});
  const double right = ellipsoid(p, {-0.042, -0.012, -0.006}, right_axes, {0.076, 0.088, 0.067});
  const double left = ellipsoid(p, {0.026, 0.020, 0.014}, left_axes, {0.098, 0.042, 0.044});
  return smooth_min(right, left, 0.045);
}

// The bed of stomach, duodenum, colon and kidney is a large ball below, behind and to the left. It
// hollows the visceral surface; where it meets the front, it leaves the sharp inferior border.
constexpr double kBedRadius_m = 0.26;
Vec3d bed_centre() {
  static const Vec3d down = normalized(Vec3d{0.40, -0.85, -0.36}, Vec3d{});
  return Vec3d{-0.004, -0.008, -0.002} + down * kBedRadius_m;
}
double visceral_bed(const Vec3d& p) {
  return length(p - bed_centre()) - kBedRadius_m;
}

// Returns the point `depth` above the visceral surface at (x, z).
Vec3d in_visceral_surface(double x, double z, double depth) {
  const Vec3d c = bed_centre();
  const double dx = x - c.x, dz = z - c.z;
  return {x, c.y + std::sqrt(kBedRadius_m * kBedRadius_m - dx * dx - dz * dz) + depth, z};
}

}  // namespace

double liver_field(const Vec3d& p) {
  static const Vec3d gallbladder[2] = {in_visceral_surface(-0.050, 0.075, -0.002),
                                       in_visceral_surface(-0.022, 0.002, 0.001)};
  static const Vec3d porta[2] = {in_visceral_surface(-0.022, 0.000, 0.001),
                                 in_visceral_surface(0.020, -0.004, 0.001)};
  static const Vec3d fissure[2] = {in_visceral_surface(0.014, 0.090, 0.008),
                                   in_visceral_surface(0.020, -0.030, 0.003)};
  double d = diaphragmatic_body(p);
  d = smooth_max(d, -visceral_bed(p), 0.012);
  // Spine and crura lie behind the middle.
  d = smooth_max(d, -capsule(p, {0.030, -0.2, -0.090}, {0.030, 0.2, -0.090}, 0.056), 0.012);
  // Vena cava.
  d = smooth_max(d, -capsule(p, {-0.014, -0.2, -0.058}, {-0.010, 0.2, -0.050}, 0.014), 0.006);
  d = smooth_max(d, -capsule(p, gallbladder[0], gallbladder[1], 0.014), 0.006);
  d = smooth_max(d, -capsule(p, porta[0], porta[1], 0.012), 0.006);
  d = smooth_max(d, -capsule(p, fissure[0], fissure[1], 0.011), 0.005);
  return d;
}

mesh::Box liver_box() {
  return {{-0.15, -0.13, -0.10}, {0.15, 0.12, 0.10}};
}

bool is_liver_held(const Vec3d& p) {
  const bool bare_area = ellipsoid(p - Vec3d{-0.052, 0.028, -0.070}, {0.045, 0.035, 0.030}) < 0;
  const bool cava = capsule(p, {-0.013, -0.02, -0.050}, {-0.008, 0.08, -0.046}, 0.018) < 0;
  const bool falciform = std::abs(p.x - 0.013) < 0.010 && p.y > 0.045;
  return bare_area || cava || falciform;
}

}  // namespace trocar::catalogue

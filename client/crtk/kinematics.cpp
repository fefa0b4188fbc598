#include "client/crtk/kinematics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::crtk {
namespace {

constexpr double kPi = std::numbers::pi;
// The large needle driver has these from the axis of its wrist's pitch to that of its yaw, and to
// the tip.
constexpr double kPitchToYaw_m = 0.0091, kYawToTip_m = 0.0102;
// The wrist lies there, from the remote centre on, with an insertion of zero.
constexpr double kWristAtZero_m = -0.0156;
constexpr double kSameAngle = 0.02, kSamePlace_m = 0.0005;

struct Limit {
  const char* name;
  double least, most;
};
constexpr std::array<Limit, kMostJoints> kLimits{{{"outer_yaw", -1.605, 1.5994},
                                                  {"outer_pitch", -0.9314, 0.9314},
                                                  {"outer_insertion", 0.03, 0.24},
                                                  {"outer_roll", -4.5379, 4.5379},
                                                  {"outer_wrist_pitch", -1.3963, 1.3963},
                                                  {"outer_wrist_yaw", -1.3963, 1.3963}}};
constexpr std::array<const char*, kMostJoints> kNames = [] {
  std::array<const char*, kMostJoints> names{};
  for (std::size_t i = 0; i < kMostJoints; ++i) names[i] = kLimits[i].name;
  return names;
}();

// Columns of a rotation, in the base frame.
struct Axes {
  Vec3d x, y, z;
};

Axes axes_of(const Quatf& q) {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
          {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
          {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
}

Quatf rotation_of(const Axes& a) {
  const std::array<double, 4> squares{1 + a.x.x - a.y.y - a.z.z, 1 - a.x.x + a.y.y - a.z.z,
                                      1 - a.x.x - a.y.y + a.z.z, 1 + a.x.x + a.y.y + a.z.z};
  const auto most = std::max_element(squares.begin(), squares.end()) - squares.begin();
  const double xy = a.y.x + a.x.y, xz = a.z.x + a.x.z, yz = a.z.y + a.y.z;
  const double wx = a.y.z - a.z.y, wy = a.z.x - a.x.z, wz = a.x.y - a.y.x;
  const std::array<std::array<double, 4>, 4> rows{{{squares[0], xy, xz, wx},
                                                   {xy, squares[1], yz, wy},
                                                   {xz, yz, squares[2], wz},
                                                   {wx, wy, wz, squares[3]}}};
  const auto& row = rows[static_cast<std::size_t>(most)];
  return normalized(Quatf{static_cast<float>(row[0]), static_cast<float>(row[1]),
                          static_cast<float>(row[2]), static_cast<float>(row[3])});
}

// The shaft before it rolls: z along it, into the body.
Axes shaft_at(double yaw, double pitch) {
  const double cy = std::cos(yaw), sy = std::sin(yaw), cp = std::cos(pitch), sp = std::sin(pitch);
  return {{-sy * sp, -cp, cy * sp}, {-cy, 0, -sy}, {sy * cp, -sp, -cy * cp}};
}

// Several turns look the same: this is the one nearest to `before`, unless that is beyond the
// limit.
double nearest_turn(double angle, double before, const Limit& limit) {
  const double turned = angle + 2 * kPi * std::round((before - angle) / (2 * kPi));
  if (turned > limit.most) return turned - 2 * kPi;
  return turned < limit.least ? turned + 2 * kPi : turned;
}

// The part of `a` that is across the axis, a unit vector.
Vec3d across(const Vec3d& a, const Vec3d& axis) {
  return a - axis * dot(a, axis);
}

}  // namespace

double angle_between(const Quatf& a, const Quatf& b) {
  const Quatf turn = conjugate(a) * b;
  return 2 * std::atan2(length(Vec3d{turn.x, turn.y, turn.z}), std::abs(double{turn.w}));
}

std::span<const char* const> Kinematics::joint_names() const {
  return {kNames.data(), joint_count()};
}

Pose Kinematics::tip_at(const Joints& q) const {
  const Axes shaft = shaft_at(q[0], q[1]);
  const double cr = std::cos(q[3]), sr = std::sin(q[3]);
  const Axes rolled{shaft.x * cr + shaft.y * sr, shaft.y * cr - shaft.x * sr, shaft.z};
  const double pitch = has_wrist ? q[4] : 0, yaw = has_wrist ? q[5] : 0;
  const Vec3d link = rolled.x * std::sin(pitch) + rolled.z * std::cos(pitch);
  const Vec3d yaw_axis = rolled.x * std::cos(pitch) - rolled.z * std::sin(pitch);
  const Vec3d out = link * std::cos(yaw) - rolled.y * std::sin(yaw);
  const Vec3d side = link * std::sin(yaw) + rolled.y * std::cos(yaw);
  const double wrist_m = q[2] + kWristAtZero_m;
  const Vec3d place =
      has_wrist ? rolled.z * wrist_m + link * kPitchToYaw_m + out * kYawToTip_m : rolled.z * q[2];
  return {to_float(place), rotation_of({-yaw_axis, -side, out})};
}

Joints Kinematics::joints_of(const Pose& tip, const Joints& before) const {
  const Axes axes = axes_of(tip.orientation);
  Vec3d link = axes.z, wrist = to_double(tip.position);
  if (has_wrist) {
    // The wrist's yaw axis, its link and the shaft lie in one plane.
    const Vec3d yaw_place = wrist - axes.z * kYawToTip_m;
    link = normalized(across(yaw_place, axes.x), axes.z);
    wrist = yaw_place - link * kPitchToYaw_m;
  }
  const Vec3d along = normalized(wrist, Vec3d{0, 0, -1});
  const Vec3d pitch_axis =
      has_wrist ? cross(link, -axes.x) : normalized(across(-axes.y, along), Vec3d{-1, 0, 0});
  const Vec3d side = normalized(cross(pitch_axis, along), Vec3d{0, -1, 0});
  Joints q{};
  q[0] = std::atan2(along.x, -along.z);
  q[1] = std::asin(std::clamp(-along.y, -1.0, 1.0));
  q[2] = length(wrist) - (has_wrist ? kWristAtZero_m : 0);
  const Axes shaft = shaft_at(q[0], q[1]);
  q[3] = nearest_turn(std::atan2(dot(side, shaft.y), dot(side, shaft.x)), before[3], kLimits[3]);
  if (!has_wrist) return q;
  q[4] = std::atan2(dot(link, side), dot(link, along));
  q[5] = std::atan2(-dot(axes.z, pitch_axis), dot(axes.z, link));
  return q;
}

Joints Kinematics::within_limits(Joints q) const {
  for (std::size_t i = 0; i < joint_count(); ++i)
    q[i] = std::clamp(q[i], kLimits[i].least, kLimits[i].most);
  return q;
}

Kinematics::Reach Kinematics::reach(const Pose& tip, const Joints& before) const {
  constexpr int kTries = 4;
  Reach reached;
  Pose aim = tip;
  Joints wanted{};
  for (int i = 0; i < kTries; ++i) {
    const Joints asked = joints_of(aim, before);
    if (i == 0) wanted = asked;
    reached.joints = within_limits(asked);
    reached.tip = tip_at(reached.joints);
    const Vec3f miss = tip.position - reached.tip.position;
    if (length(miss) < 1e-6f) break;
    aim.position += miss;
  }
  const bool is_there = length(tip.position - reached.tip.position) < kSamePlace_m &&
                        angle_between(tip.orientation, reached.tip.orientation) < kSameAngle;
  if (is_there) return reached;
  const Joints inside = within_limits(wanted);
  for (std::size_t i = 0; i < joint_count() && reached.limit.empty(); ++i)
    if (inside[i] != wanted[i]) reached.limit = kNames[i];
  if (reached.limit.empty())
    reached.limit = has_wrist ? "remote centre" : "shaft, which has no wrist";
  return reached;
}

}  // namespace trocar::crtk

#include "common/wire/haptic_messages.h"

#include <cmath>
#include <string>

#include "proto/wire.pb.h"

namespace trocar::wire {

static_assert(static_cast<int>(TouchKind::Free) == proto::TOUCH_FREE &&
              static_cast<int>(TouchKind::Near) == proto::TOUCH_NEAR &&
              static_cast<int>(TouchKind::Push) == proto::TOUCH_PUSH &&
              static_cast<int>(TouchKind::Grip) == proto::TOUCH_GRIP &&
              static_cast<int>(TouchKind::Rigid) == proto::TOUCH_RIGID &&
              static_cast<int>(TouchKind::Cut) == proto::TOUCH_CUT &&
              kTouchKinds == proto::TouchKind_ARRAYSIZE);

namespace {

Error bad(const char* message, const char* field, const char* limit) {
  return {ErrorCode::BadMessage, std::string(message) + "." + field + ": " + limit};
}

void write(const Vec3f& value, proto::Vec3& message) {
  message.set_x(value.x);
  message.set_y(value.y);
  message.set_z(value.z);
}
Vec3f to_vec3(const proto::Vec3& message) {
  return {message.x(), message.y(), message.z()};
}

// False for what is not finite, too.
bool is_within(const Vec3f& value, float limit) {
  return std::abs(value.x) <= limit && std::abs(value.y) <= limit && std::abs(value.z) <= limit;
}
bool is_between(float value, float least, float most) {
  return value >= least && value <= most;
}

using Terms = std::array<HapticLaw::Term, HapticLaw::kMaxTerms>;
using Numbers = google::protobuf::RepeatedField<float>;

void write(const Terms& terms, Numbers& shares, Numbers& times) {
  shares.Clear();
  times.Clear();
  for (const auto& term : terms)
    if (term.share != 0) {
      shares.Add(term.share);
      times.Add(term.time_s);
    }
}

Status read(const Numbers& shares, const Numbers& times, float most, const char* field,
            Terms& terms) {
  if (shares.size() != times.size() || shares.size() > static_cast<int>(terms.size()))
    return bad("HapticLaw", field, "not as many times as shares, or over 4");
  for (int i = 0; i < shares.size(); ++i) {
    if (!is_between(shares[i], 0, most) || !is_between(times[i], 1e-4f, 1e6f))
      return bad("HapticLaw", field, "a share or a time is out of range");
    terms[static_cast<std::size_t>(i)] = {shares[i], times[i]};
  }
  return {};
}

}  // namespace

void write(const HapticPatch& patch, proto::HapticPatch& message) {
  message.Clear();
  message.set_tool(patch.tool);
  message.set_sequence(patch.sequence);
  message.set_tick(patch.tick);
  message.set_structure(patch.structure);
  message.set_echo_time_us(patch.echo_time_us);
  write(patch.used_position_m, *message.mutable_used_position_m());
  message.set_kind(static_cast<proto::TouchKind>(patch.kind));
  if (patch.kind == TouchKind::Free) return;
  write(patch.force_n, *message.mutable_force_n());
  write(patch.torque_nm, *message.mutable_torque_nm());
  write(patch.plane_point_m, *message.mutable_plane_point_m());
  write(patch.plane_normal, *message.mutable_plane_normal());
  if (patch.has_stiffness) {
    const auto& k = patch.stiffness_n_m;
    for (const float entry : {k.xx, k.yy, k.zz, k.xy, k.xz, k.yz}) message.add_stiffness_n_m(entry);
  }
  message.set_friction(patch.friction);
  message.set_pressed_limit_n(patch.pressed_limit_n);
  if (patch.kind == TouchKind::Grip) write(patch.grip_point_m, *message.mutable_grip_point_m());
  message.set_grip_limit_n(patch.grip_limit_n);
  message.set_cut_force_n(patch.cut_force_n);
  message.set_side_friction_n(patch.side_friction_n);
  message.set_law(patch.law);
}

Result<HapticPatch> read(const proto::HapticPatch& message) {
  const auto fails = [](const char* field, const char* limit) {
    return bad("HapticPatch", field, limit);
  };
  HapticPatch patch;
  if (message.tool() > 1) return fails("tool", "is over 1");
  patch.tool = static_cast<std::uint8_t>(message.tool());
  patch.sequence = message.sequence();
  patch.tick = message.tick();
  patch.structure = message.structure();
  patch.echo_time_us = message.echo_time_us();
  if (message.kind() < 0 || message.kind() >= kTouchKinds)
    return fails("kind", "is not known here");
  patch.kind = static_cast<TouchKind>(message.kind());
  patch.used_position_m = to_vec3(message.used_position_m());
  patch.force_n = to_vec3(message.force_n());
  patch.torque_nm = to_vec3(message.torque_nm());
  patch.plane_point_m = to_vec3(message.plane_point_m());
  patch.grip_point_m = to_vec3(message.grip_point_m());
  if (!is_within(patch.force_n, kMaxHapticForceN)) return fails("force_n", "is over 1000 N");
  if (!is_within(patch.torque_nm, kMaxHapticForceN)) return fails("torque_nm", "is over 1000 N m");
  if (!is_within(patch.used_position_m, kMaxHapticPlaceM) ||
      !is_within(patch.plane_point_m, kMaxHapticPlaceM) ||
      !is_within(patch.grip_point_m, kMaxHapticPlaceM))
    return fails("position", "is over 4 m from the origin");
  if (message.has_plane_normal()) {
    patch.plane_normal = to_vec3(message.plane_normal());
    if (!is_within(patch.plane_normal, 2) ||
        !is_between(dot(patch.plane_normal, patch.plane_normal), 0.998f, 1.002f))
      return fails("plane_normal", "is not of unit length");
  }
  if (message.stiffness_n_m_size() != 0) {
    if (message.stiffness_n_m_size() != 6) return fails("stiffness_n_m", "has not 6 entries");
    for (const float entry : message.stiffness_n_m())
      if (!is_between(entry, -1e6f, 1e6f)) return fails("stiffness_n_m", "is over 1 kN/mm");
    const auto& k = message.stiffness_n_m();
    patch.has_stiffness = true;
    patch.stiffness_n_m = {.xx = k[0], .xy = k[3], .xz = k[4], .yy = k[1], .yz = k[5], .zz = k[2]};
  }
  patch.friction = message.friction();
  patch.pressed_limit_n = message.pressed_limit_n();
  patch.grip_limit_n = message.grip_limit_n();
  patch.cut_force_n = message.cut_force_n();
  patch.side_friction_n = message.side_friction_n();
  if (!is_between(patch.friction, 0, 10)) return fails("friction", "is not between 0 and 10");
  if (!is_between(patch.pressed_limit_n, 0, kMaxHapticForceN) ||
      !is_between(patch.grip_limit_n, 0, kMaxHapticForceN) ||
      !is_between(patch.cut_force_n, 0, kMaxHapticForceN) ||
      !is_between(patch.side_friction_n, 0, kMaxHapticForceN))
    return fails("limit", "is negative or over 1000 N");
  patch.law = message.law();
  return patch;
}

void write(const HapticLaw& law, proto::HapticLaw& message) {
  message.set_law(law.number);
  message.set_exponent(law.exponent);
  message.set_youngs_modulus_pa(law.youngs_modulus_pa);
  message.set_poisson_ratio(law.poisson_ratio);
  write(law.relaxation, *message.mutable_relaxed_share(), *message.mutable_relaxation_time_s());
  write(law.fast, *message.mutable_fast_share(), *message.mutable_fast_time_s());
}

Result<HapticLaw> read(const proto::HapticLaw& message) {
  const auto fails = [](const char* field, const char* limit) {
    return bad("HapticLaw", field, limit);
  };
  HapticLaw law;
  law.number = message.law();
  law.exponent = message.exponent();
  law.youngs_modulus_pa = message.youngs_modulus_pa();
  law.poisson_ratio = message.poisson_ratio();
  if (!is_between(law.exponent, 1, 3)) return fails("exponent", "is not between 1 and 3");
  if (!is_between(law.youngs_modulus_pa, 1, 1e9f))
    return fails("youngs_modulus_pa", "is not between 1 and 1e9");
  if (!is_between(law.poisson_ratio, 0, 0.5f))
    return fails("poisson_ratio", "is not between 0 and 0.5");
  if (const auto done = read(message.relaxed_share(), message.relaxation_time_s(), 1,
                             "relaxed_share", law.relaxation);
      !done)
    return done.error();
  float relaxed = 0;
  for (const auto& term : law.relaxation) relaxed += term.share;
  if (relaxed > 0.999f) return fails("relaxed_share", "is 1 or more in all");
  if (const auto done =
          read(message.fast_share(), message.fast_time_s(), 100, "fast_share", law.fast);
      !done)
    return done.error();
  return law;
}

}  // namespace trocar::wire

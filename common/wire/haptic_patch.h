#pragma once

// A client's hand needs this to feel a tool at 1 kHz between two answers of the server: what the
// tissue did to the tool at a pose that the client knows, and what the client may expect beside it.

#include <array>
#include <cstdint>

#include "common/math/vec3.h"

namespace trocar::wire {

// The numbers are those of proto::TouchKind.
enum class TouchKind : std::uint8_t {
  Free = 0,  // no tissue is near
  Near = 1,  // tissue is near, the tool does not touch it
  Push = 2,
  Grip = 3,   // jaws hold tissue
  Rigid = 4,  // the tool may not go there
  Cut = 5,    // a blade is in tissue
};
inline constexpr int kTouchKinds = 6;

// World frame, as in proto::HapticPatch.
struct HapticPatch {
  std::uint8_t tool = 0;  // 0 or 1
  std::uint32_t sequence = 0;
  std::uint64_t tick = 0;
  std::uint32_t structure = 0;     // grows when what is touched becomes another thing
  std::uint64_t echo_time_us = 0;  // the client's clock at the pose that the force belongs to
  Vec3f used_position_m;           // of the tip, at that pose
  TouchKind kind = TouchKind::Free;
  Vec3f force_n, torque_nm;     // of the tissue on the tool, the torque about the tip
  Vec3f plane_point_m;          // of the surface without this tool
  Vec3f plane_normal{0, 0, 1};  // outward
  bool has_stiffness = false;
  SymMat3f stiffness_n_m;  // change of force over 50 ms; Near: expected of a press of 5 mm
  float friction = 0;
  float pressed_limit_n = 0;  // 0: there is no limit
  Vec3f grip_point_m;         // where the held tissue would be without this tool
  float grip_limit_n = 0;     // 0: the jaws hold it
  // Cutting holds a blade that goes on back with it, whether it goes on now or not; 0: it does not
  // cut.
  float cut_force_n = 0;
  float side_friction_n = 0;  // the most that holds a blade by its sides
  std::uint32_t law = 0;      // the number of its HapticLaw
};

struct HapticLaw {
  struct Term {
    float share = 0;   // of the stress (relaxation), or of the stiffness (fast)
    float time_s = 1;  // > 0
  };
  static constexpr std::size_t kMaxTerms = 4;

  std::uint32_t number = 0;
  float exponent = 1.5f;           // of force over depth, 1 to 3
  float youngs_modulus_pa = 5000;  // at once, before anything relaxes
  float poisson_ratio = 0.49f;
  std::array<Term, kMaxTerms> relaxation{}, fast{};  // a share of 0: there is no such term
};

}  // namespace trocar::wire

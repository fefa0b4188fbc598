#pragma once

// The threads of a scene, as they are laid out at first, and what stands there for them to meet.
// SI units, world frame.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "server/tissue/thread/sutures.h"

namespace trocar::thread {

inline constexpr double kSegmentM = 1e-3;  // from a node to the next, at rest
inline constexpr std::size_t kMostThreads = 8, kMostPegs = 32, kMostPathPoints = 4096;
inline constexpr std::size_t kLeastNodes = 4;                                    // of a thread
inline constexpr std::size_t kMostNodes = 1200;                                  // of all threads
inline constexpr double kMostM = 2;                                              // from the origin
inline constexpr double kMostLoadN = 50, kMostSpeedM_s = 5, kMostSeconds = 1e6;  // of an end
// A peg is met by nodes alone, so it is no thinner than what fits between two of them.
inline constexpr double kLeastPegRadiusM = 1e-3, kMostPegRadiusM = 1;

// An end of a thread is free, with a load that grows from nothing, or held: it then goes on at a
// velocity for a while.
struct End {
  bool is_held = false;
  Vec3d velocity_m_s;  // of a held end
  Vec3d load_n;        // on a free end
  double until_s = 0;  // a held end stands still from then on; a load stays as it is

  bool operator==(const End&) const = default;
};

struct ThreadRule {
  std::string name;
  Material material = Material::Silk;
  Size size = Size::Usp3_0;
  std::vector<Vec3d> path_m;  // at least two points; the thread lies along it, outside of pegs
  std::optional<double> self_friction;  // without: the material's
  End start, end;

  Suture suture() const;
  bool operator==(const ThreadRule&) const = default;
};

// A rigid capsule that stands still.
struct Peg {
  Vec3d from_m, to_m;
  double radius_m = 0.005;
  double friction = 0.2;

  bool operator==(const Peg&) const = default;
};

struct Rules {
  std::vector<ThreadRule> threads;  // at least one
  std::vector<Peg> pegs;
  std::optional<double> floor_y_m;  // a plane that holds threads from below
  Vec3d gravity_m_s2{0, -9.81, 0};

  bool operator==(const Rules&) const = default;
};

// The nodes of a thread at rest lengths along a path. Corners are smoothed, for a thread laid out
// with corners snaps.
std::vector<Vec3d> nodes_along(const std::vector<Vec3d>& path_m);

// Errors name the field and the limit.
Status validate(const Rules& rules);

}  // namespace trocar::thread

#pragma once

// The blood of a session as arrays: state of the tick.
// Volumes are whole picolitres, so that sums are exact in any order:
//   shed = on the surface + dripped + sucked.

#include <array>
#include <cstdint>
#include <vector>

#include "common/base/ids.h"
#include "common/math/vec3.h"
#include "common/wire/blood_codec.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::bleeding {

inline constexpr double kPicolitresPerCubicMetre = 1e15;
inline constexpr std::uint32_t kFreshlyCut = 1u << 24;  // of Blood::open
inline constexpr std::uint32_t kMostClips = 256;

struct Blood {
  // Per vertex slot.
  std::vector<std::int64_t> volume_pl;  // on it
  std::vector<std::uint32_t> open;      // of its wound: kFreshlyCut at first, 0 clotted or sealed
  std::vector<std::uint8_t> was_wound;  // it has bled already: a wound does not begin twice
  wire::BloodLevels levels;             // as last published
  // A clip closes what a vessel has open near a place at rest.
  std::vector<std::uint32_t> clip_vessel;
  std::vector<Vec3d> clip_place_m;
  std::vector<double> clip_reach_m;
  std::vector<std::uint8_t> was_closed;  // per tool slot: jaws were closed in the frame before
  std::int64_t shed_pl = 0, dripped_pl = 0, sucked_pl = 0;

  Blood() : was_closed(kMaxTools, 0) {}

  // The surface has so many vertices now; new ones are dry. Blood on those that are gone has
  // dripped off.
  void resize(std::size_t vertices);
  std::int64_t on_surface_pl() const;  // the sum over all vertices

  // Most ticks change nothing of it, so the tick hash covers this hash of it, which whoever changes
  // it brings up to date.
  void update_hash(StateHasher& hasher);
  // Reading refuses what could not have come about.
  void visit_state(world::StateArchive& archive);
  bool operator==(const Blood&) const = default;

 private:
  void visit_arrays(world::StateArchive& archive);
  std::uint64_t computed_hash(StateHasher& hasher);
  bool is_whole() const;

  std::uint64_t hash_ = 0;  // 0 before the first frame
};

}  // namespace trocar::bleeding

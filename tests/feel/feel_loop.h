#pragma once

// The closed loop of a hand and an organ in simulated time: a calculated hand on a device, a
// client, a bad line, and the simulation that a server runs. Another simulation of the same organ
// has the device in each tick where it is, without any delay: its force is the truth.
//
//   hand -> device -> client -> line -> organ
//     ^                 |        ^        |
//     +----- force -----+------- + -------+        the truth: device -> organ
//
// The same arguments give the same record to the bit. A millisecond costs two ticks of the organ.

#include <functional>
#include <memory>

#include "client/device/simulated_device.h"
#include "tests/feel/felt_organ.h"
#include "tests/haptics/clients.h"
#include "tests/haptics/closed_loop.h"

namespace trocar::haptics::testing {

struct FeltMotion {
  Motion motion;                                  // what happens to a surrogate tissue is left out
  std::function<tool::Verb(double s)> verb = {};  // none: the tool pushes
  // Says what others do, in the truth as well.
  std::function<void(double s, hands::TickInputs&)> others = {};
  // Says what the server's session makes of this hand's readings; none: it takes them as they are.
  std::function<std::optional<hands::ToolInput>(double s, const hands::ToolInput&)> given = {};
  double gone_s = -1, back_s = -1;  // between them nothing passes the line
  double server_pace = 1;           // simulated time over real time; 1 / a whole number
  // The server's ticks are decided so.
  step::TickDecisions decisions = {};
  // Changes them in each tick, at the server alone.
  std::function<void(double s, step::TickDecisions&)> decides = {};
};

struct FeelRecord : Record {
  std::vector<Vec3d> server_n;  // of the newest patch that had come
};

inline constexpr std::uint64_t kClockStart_us = 5'000'000;  // of the client's clock

struct FeelSettings {
  Line line;
  device::HandModel hand;
  std::uint64_t seed = 3;
  // Changes each patch where it is made; for mutants.
  std::function<void(wire::HapticPatch&, const FeltOrgan& server)> at_server = {};
};

using MakeOrganClient =
    std::function<std::unique_ptr<Client>(const std::vector<wire::HapticLaw>& laws)>;

// place: its origin is where the tool's tip first touches, z points out of the tissue, back along
// the tool's shaft.
FeelRecord run(const step::Simulation& simulation, const tool::ToolShape& shape, const Frame& place,
               const FeltMotion& motion, const MakeOrganClient& make_client,
               const FeelSettings& settings = {});

// Returns where the tool meets the organ that it comes to from `direction`, a unit vector: above
// the node that is farthest in that direction.
Frame place_on(const step::Simulation& simulation, const tool::ToolShape& shape,
               const Vec3d& direction);
// Does the same above `point_m`.
Frame place_at(const step::Simulation& simulation, const tool::ToolShape& shape,
               const Vec3d& point_m, const Vec3d& direction);

}  // namespace trocar::haptics::testing

#pragma once

// An organ as the first hand's tool feels it: a server's simulation without a network around it.

#include <functional>
#include <optional>

#include "common/math/frame.h"
#include "common/wire/haptic_patch.h"
#include "server/tissue/step/simulation.h"

namespace trocar::haptics::testing {

struct ToolReading {
  Vec3d tip_m;
  Quatf orientation;
  tool::Verb verb = tool::Verb::Push;
  std::uint64_t time_us = 0;
};

// Says what the server's session makes of a reading before its simulation sees it; nothing: it
// takes none.
using Given = std::function<std::optional<hands::ToolInput>(const hands::ToolInput& wanted)>;

class FeltOrgan {
 public:
  // Another one of `simulation`, at its beginning; tools of that shape.
  FeltOrgan(const step::Simulation& simulation, const tool::ToolShape& shape);

  // Others do this in the next tick.
  hands::TickInputs& others() { return inputs_; }
  // From the next tick on; those of a server with much time are the default.
  void decide(const step::TickDecisions& decisions) { decisions_ = decisions; }
  // Simulates a tick. The tool goes to the reading as a session's tools do; null: none has come.
  // given: null: the simulation takes the reading as it is.
  void tick(const ToolReading* reading, const Given& given = nullptr);
  // The tool is at the reading in this tick already.
  void tick_at(const ToolReading& reading);

  // Returns that of the tissue on the tool.
  Vec3d force_n() const;
  // Numbered as a session's; nothing if the last tick published none.
  std::optional<wire::HapticPatch> pop_patch();
  const step::Simulation& simulation() const { return simulation_; }

 private:
  const hands::Tool& tool() const;

  step::Simulation simulation_;
  hands::TickInputs inputs_;
  step::TickDecisions decisions_;
  std::uint32_t sequence_ = 0;
};

// Returns where a tool that comes from `from_m` along `way`, a unit vector, first touches: the
// place of its tip. Nothing: it does not within 0.2 m.
std::optional<Vec3d> place_of_contact(const step::Simulation& simulation,
                                      const tool::ToolShape& shape, const Vec3d& from_m,
                                      const Vec3d& way);

}  // namespace trocar::haptics::testing

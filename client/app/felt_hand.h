#pragma once

// A hand that feels: a device, the loop that renders its force at 1 kHz, and the readings that
// leave for the server. Thread: render thread, but for the loop.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/haptic_device.h"
#include "client/haptics/hand.h"
#include "client/haptics/loop.h"
#include "common/base/result.h"
#include "common/tool/tool_kind.h"
#include "common/wire/haptic_patch.h"

namespace trocar::app {

// People see these, and the summary has them.
struct FeltFigures {
  std::string device;
  haptics::LoopTiming timing;
  haptics::HandState state;  // the newest
  double largest_force_n = 0, largest_server_force_n = 0;
  std::uint64_t readings_sent = 0;
  bool has_priority = false, has_locked_memory = false;
};

// This says what a hand holds, and how.
struct FeltSettings {
  tool::ToolKind tool = tool::tool_kinds().front();
  std::optional<Vec3d> port_m;  // that its shaft passes, world frame; none: it is free
  haptics::WorkspaceScale scale;
  bool has_trace = false;  // each step is kept, for at most ten minutes
};
inline constexpr std::size_t kMostTraceRows = 600'000;

class FeltHand {
 public:
  // A device that brings its own tool is held as that says.
  FeltHand(std::unique_ptr<device::HapticDevice> device, const FeltSettings& settings);

  const tool::ToolShape& shape() const { return settings_.tool.shape; }
  bool is_started() const { return loop_ != nullptr; }
  // start_m: where the tool's tip is at first, world frame, if the device does not say. An error:
  // its shaft does not reach there through the port.
  Status start(const Vec3d& start_m);

  // Before the start, too. Patches of before the start are dropped.
  void take(const wire::HapticLaw& law);
  void take(const wire::HapticPatch& patch);

  // The reading that is due at the server: at most every 4 ms; when the hand rests, every 20 ms.
  // An error: the device is gone.
  Result<std::optional<haptics::HandReading>> pop_due(std::uint64_t now_ns);

  const FeltFigures& figures();
  // Ends the loop; no force is left. Then the trace may be read; null: there is none.
  const haptics::Trace* stop();

 private:
  bool is_due(const haptics::HandReading& reading, std::uint64_t now_ns) const;

  std::unique_ptr<device::HapticDevice> device_;
  FeltSettings settings_;
  std::vector<wire::HapticLaw> early_laws_;
  std::unique_ptr<haptics::Trace> trace_;
  std::unique_ptr<haptics::Hand> hand_;
  std::unique_ptr<haptics::Loop> loop_;
  haptics::HandReading reading_, sent_;
  std::uint64_t sent_ns_ = 0;
  FeltFigures figures_;
};

}  // namespace trocar::app

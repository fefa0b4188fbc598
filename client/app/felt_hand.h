#pragma once

// A hand that feels: a device, the loop that renders its force at 1 kHz, and the readings that
// leave for the server. Thread: render thread, but for the loop.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/haptic_device.h"
#include "client/haptics/loop.h"
#include "common/base/result.h"
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

class FeltHand {
 public:
  // has_trace: each step is kept, for at most ten minutes.
  FeltHand(std::unique_ptr<device::HapticDevice> device, const tool::ToolShape& shape,
           const haptics::WorkspaceScale& scale, bool has_trace);

  const tool::ToolShape& shape() const { return shape_; }
  bool is_started() const { return loop_ != nullptr; }
  // start_m: where the tool's tip is at first, world frame.
  void start(const Vec3d& start_m);

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
  tool::ToolShape shape_;
  haptics::WorkspaceScale scale_;
  std::vector<wire::HapticLaw> early_laws_;
  std::unique_ptr<haptics::Trace> trace_;
  std::unique_ptr<haptics::Hand> hand_;
  std::unique_ptr<haptics::Loop> loop_;
  haptics::HandReading reading_, sent_;
  std::uint64_t sent_ns_ = 0;
  FeltFigures figures_;
};

}  // namespace trocar::app

#pragma once

// A learner's hand on a device feels what an expert felt with one tool in a recorded session, while
// the recording plays. Thread: render thread, but for the loop.

#include <memory>
#include <string>

#include "client/app/felt_hand.h"
#include "client/haptics/playback_hand.h"
#include "client/replica/session_source.h"

namespace trocar::app {

class FeltReplay {
 public:
  FeltReplay(std::unique_ptr<device::HapticDevice> device, replay::RecordedHand hand,
             const haptics::PlaybackSettings& settings, bool has_trace);

  // Says where the recording is now. An error: the device is gone.
  Status update(const replica::PlaybackControl& playback, std::uint64_t now_ns);
  const FeltFigures& figures();
  // Begins to end the loop.
  void let_go() { loop_.let_go(); }
  // Ends the loop; no force is left. Then the trace may be read; null: there is none.
  const haptics::Trace* stop();

 private:
  std::unique_ptr<device::HapticDevice> device_;
  const std::string name_;
  std::unique_ptr<haptics::Trace> trace_;
  haptics::PlaybackHand hand_;
  haptics::Loop loop_;
  bool is_started_ = false;
  FeltFigures figures_;
};

}  // namespace trocar::app

#pragma once

// A hand that feels exchanges its readings and answers with the server beside the session's other
// messages, so that neither waits for a picture: the source calls this on its own thread.
//
//   server -> source's thread -> take() -> the hand's loop
//   server <- source's thread <- pop_reading() and pop_report(), asked every 4 ms
//
// Thread: the source's own. No member waits for anything.

#include <cstdint>
#include <optional>

#include "common/tool/tool.h"
#include "common/wire/hand_report.h"
#include "common/wire/haptic_patch.h"

namespace trocar::replica {

struct HandLineReading {
  std::uint32_t tool = 0;  // 0 or 1
  tool::ToolSample sample;
  std::uint64_t time_us = 0;  // of this client's clock, when the device was read
};

class HandLine {
 public:
  virtual ~HandLine() = default;
  virtual void take(const wire::HapticLaw& law) = 0;
  virtual void take(const wire::HapticPatch& patch) = 0;  // of the tool that it names
  // The next reading that is due at the server, of any tool; nothing: none is.
  virtual std::optional<HandLineReading> pop_reading(std::uint64_t now_ns) = 0;
  // Tells what a hand has felt, for the recording; nothing: there is no more at present.
  virtual std::optional<wire::HandReport> pop_report() = 0;
};

}  // namespace trocar::replica

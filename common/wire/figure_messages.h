#pragma once

// These functions alone know a figure both as a value and as a part of a message.

#include "common/base/result.h"
#include "common/wire/figures.h"

namespace trocar::proto {
class FrameState;
}  // namespace trocar::proto

namespace trocar::wire {

// Each writes over what the message has of these figures, and leaves the rest of it as it is.
void write(const FrameFigures& figures, proto::FrameState& message);
void write(const PaceFigures& figures, proto::FrameState& message);

// A message is outside data: an error is one line that names the field. Figures that an older
// server does not tell stay as by default, and so does a level of a newer one.
Result<FrameFigures> read(const proto::FrameState& message);

}  // namespace trocar::wire

#pragma once

#include "common/base/result.h"
#include "common/wire/haptic_patch.h"

namespace trocar::proto {
class HapticLaw;
class HapticPatch;
}  // namespace trocar::proto

namespace trocar::wire {

inline constexpr float kMaxHapticForceN = 1000;
inline constexpr float kMaxHapticPlaceM = 4;  // of a point, from the origin

void write(const HapticPatch& patch, proto::HapticPatch& message);
void write(const HapticLaw& law, proto::HapticLaw& message);

// A message is outside data: an error is one line that names the field. What is read is finite and
// within the limits above; a kind that this program does not know is an error.
Result<HapticPatch> read(const proto::HapticPatch& message);
Result<HapticLaw> read(const proto::HapticLaw& message);

}  // namespace trocar::wire

#pragma once

// SurfaceTopology and SurfaceChange as messages. What comes in is outside data: sizes, limits and
// indices are checked, and an error is one line that names message and field.

#include <string>

#include "common/base/result.h"
#include "common/wire/surface_change.h"
#include "common/wire/surface_layout.h"

namespace trocar::proto {
class SurfaceChange;
class SurfaceTopology;
}  // namespace trocar::proto

namespace trocar::wire {

// `message` is empty on entry. Nodes are left out.
void write(const SurfaceLayout& layout, const std::string& organ_name,
           proto::SurfaceTopology& message);
// Nodes are invalid. A message from before 1.3 has no gaps, no wounds and no sum.
Result<SurfaceLayout> read(const proto::SurfaceTopology& message);

// `layout`: the one that the change was applied to. `message` is empty on entry.
void write(const SurfaceChange& change, const SurfaceLayout& layout, proto::SurfaceChange& message);
// Only what it takes to understand the message is checked, the rest by apply().
Result<SurfaceChange> read(const proto::SurfaceChange& message, const SurfaceLayout& before);

}  // namespace trocar::wire

#pragma once

// The layout of the surface, as the stream has it, which may be ahead, and as it is shown: what
// SurfaceTopology and SurfaceChange say is shown from the first frame of their epoch on, never
// before. Thread: render thread.

#include <string>
#include <vector>

#include "client/replica/session_view.h"
#include "common/base/result.h"
#include "common/wire/surface_change.h"
#include "common/wire/surface_layout.h"

namespace trocar::proto {
class SurfaceChange;
}

namespace trocar::replica {

class ShownSurface {
 public:
  // The stream's.
  const wire::SurfaceLayout& layout() const { return layout_; }
  void begin(wire::SurfaceLayout layout, std::string organ_name);
  // An error: it does not follow, or is malformed, and nothing has changed.
  Status apply(const proto::SurfaceChange& message);

  // True: another surface waits to be shown.
  bool is_new() const { return is_new_; }
  // Returns what else is lacking, the oldest first.
  const std::vector<wire::SurfaceChange>& waiting() const { return waiting_; }
  void forget_waiting() { waiting_.clear(); }
  // Shows what waits.
  void show();

  // Returns what is shown; `version` counts its changes, the large and the small.
  const Topology& topology() const { return topology_; }
  std::uint64_t version() const { return version_; }
  // When the server published its newest change; 0: none, or unknown.
  std::uint64_t change_us() const { return shown_change_us_; }

 private:
  void show_layout();
  void show_changes();

  wire::SurfaceLayout layout_;
  std::string organ_name_;
  bool is_new_ = false;
  std::vector<wire::SurfaceChange> waiting_;
  Topology topology_;
  std::uint64_t newest_change_us_ = 0, shown_change_us_ = 0;
  std::uint64_t version_ = 0;
};

}  // namespace trocar::replica

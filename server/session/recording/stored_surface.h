#pragma once

// Decodes the surface stream of a recording as a player would, and checks it against its own CRCs.
// It needs no simulation. After a gap it waits for the next keyframe. One thread.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/wire/blood_codec.h"
#include "common/wire/surface_layout.h"

namespace trocar::proto {
class SurfaceChange;
class SurfaceFrame;
class SurfaceTopology;
}  // namespace trocar::proto

namespace trocar::recording {

struct StoredDifference {
  std::string field, recorded, found;
};

class StoredSurface {
 public:
  // A check returns what the stream says wrongly of itself, or nothing.
  using Check = std::optional<StoredDifference>;

  Check check(const proto::SurfaceTopology& message);
  Check check(const proto::SurfaceChange& message);
  Check check(const proto::SurfaceFrame& message);
  // Messages are missing before the next one.
  void skip() { has_surface_ = false; }

  // The newest surface; null where there is none.
  const wire::SurfaceLayout* layout() const { return has_surface_ ? &layout_ : nullptr; }
  const wire::QuantisedSurface& surface() const { return surface_; }

  std::uint64_t decoded() const { return decoded_; }
  std::uint64_t bled() const { return bled_; }  // of those, with blood on them
  // Surfaces that could not be decoded, because something before them is missing.
  std::uint64_t undecodable() const { return undecodable_; }

 private:
  Check check_blood(const proto::SurfaceFrame& message);

  wire::SurfaceLayout layout_;
  wire::QuantisedSurface surface_;
  wire::BloodLevels blood_;
  Frame frame_ = 0;
  bool has_layout_ = false, has_surface_ = false;
  std::uint64_t decoded_ = 0, undecodable_ = 0, bled_ = 0;
};

}  // namespace trocar::recording

#pragma once

// The board keeps what is drawn on the surface in a session: lines of points that stand by where
// they are on the surface at rest, which no motion and no cut changes. wire::kMostDrawingPoints
// bounds it.

#include <optional>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/wire/surface_layout.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {

struct Stroke {
  ParticipantSlot participant;
  std::vector<wire::QuantisedVertex> rest_quanta;
};

class DrawingBoard {
 public:
  // Adds a line; points of triangles that are not, or not any more, there are left out. Null: none
  // was left. Check is_full_for() before.
  const Stroke* add(ParticipantSlot who, std::span<const SurfacePoint> points,
                    const wire::SurfaceLayout& layout);
  bool is_full_for(std::size_t points) const;
  void wipe();
  std::span<const Stroke> strokes() const { return strokes_; }

 private:
  std::vector<Stroke> strokes_;
  std::size_t points_ = 0;
};

}  // namespace trocar::replication

#pragma once

#include "client/replica/session_view.h"

namespace trocar::replica {

// Two triangles of 10 mm that make a square at z = 0, seen from +z.
inline Topology square() {
  Topology topology;
  topology.rest_positions = {{0, 0, 0}, {0.01f, 0, 0}, {0.01f, 0.01f, 0}, {0, 0.01f, 0}};
  topology.triangles = {{0, 1, 2}, {0, 2, 3}};
  topology.is_wound = {0, 0};
  return topology;
}

}  // namespace trocar::replica

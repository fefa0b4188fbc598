#pragma once

// Whether a topology is a sound solid after cuts, and what it consists of.

#include "common/base/result.h"
#include "server/tissue/topology/topology.h"

namespace trocar::cutting {

// Error names the first broken invariant: nodes and tets agree about each other; positive volumes
// at rest and free of stress; a face belongs to at most two tets; an edge of the surface has
// exactly two surface faces; the tets around a node hang together and its link is a disc or a
// sphere; no tet twice. O(n log n).
Status validate(const topology::Topology& topology);

struct Pieces {
  std::uint32_t count = 0;
  std::vector<std::uint32_t> piece_of_tet;  // in the order of their first tet
  std::vector<std::uint32_t> tets;          // per piece
};
// Returns the sets of tets that hang together over faces.
Pieces find_pieces(const topology::Topology& topology);

double total_volume(const topology::Topology& topology);  // at rest, m^3
double surface_area(const topology::Topology& topology);  // at rest, m^2

}  // namespace trocar::cutting

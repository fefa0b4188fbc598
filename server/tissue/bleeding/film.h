#pragma once

// How a film of blood runs over the surface in one frame: downhill by gravity as a laminar film
// (Nusselt 1916), level where it can run no further, in drops from where it hangs.

#include <cstdint>
#include <span>
#include <vector>

#include "common/wire/quantise.h"
#include "server/tissue/bleeding/blood.h"
#include "server/tissue/bleeding/surface_graph.h"

namespace trocar::bleeding {

// Says where the surface is in a frame, m, world frame.
class SurfacePlaces {
 public:
  SurfacePlaces(const wire::SurfaceLayout& layout,
                std::span<const wire::QuantisedVertex> displacements)
      : layout_(layout), displacements_(displacements) {}
  Vec3d operator[](std::uint32_t vertex) const {
    const auto q = layout_.rest_quanta[vertex] + displacements_[vertex];
    return Vec3d{static_cast<double>(q.x), static_cast<double>(q.y), static_cast<double>(q.z)} *
           static_cast<double>(wire::kQuantumMetres);
  }

 private:
  const wire::SurfaceLayout& layout_;
  std::span<const wire::QuantisedVertex> displacements_;
};

// Returns the depth of the film on a vertex, m; 0 on one without area.
double depth_m(const Blood& blood, const SurfaceGraph& graph, std::uint32_t vertex);

// Returns the speed of a laminar film at an incline, its mean over the depth, m/s. slope: the sine
// of the incline.
double film_speed_m_s(double depth_m, double slope);

class Film {
 public:
  // Moves blood between the vertices that are wet, and counts what drips off. Vertices that become
  // wet are appended to `wet`; is_wet says which are in it.
  void run(const SurfaceGraph& graph, const SurfacePlaces& places, Blood& blood,
           std::vector<std::uint32_t>& wet, std::vector<std::uint8_t>& is_wet);

 private:
  struct Move {
    std::uint32_t from = 0, to = 0;
    std::int64_t pl = 0;
  };
  struct Way {
    std::uint32_t to = 0;
    double drop_m = 0, slope = 0;
  };

  void find_ways(const SurfaceGraph& graph, const SurfacePlaces& places, const Blood& blood,
                 std::uint32_t vertex);

  std::vector<Way> ways_;  // of one vertex, to where it is lower
  bool hangs_ = false;     // its surface faces downwards
  double sum_of_slopes_ = 0, steepest_ = 0, steepest_length_m_ = 0;
  std::vector<Move> moves_;
};

}  // namespace trocar::bleeding

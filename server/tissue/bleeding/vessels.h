#pragma once

// Vessels that a cut has opened: where, how wide, and what runs out of them.

#include <cstdint>
#include <vector>

#include "server/tissue/bleeding/blood.h"
#include "server/tissue/bleeding/film.h"
#include "server/tissue/bleeding/instruments.h"
#include "server/tissue/bleeding/rules.h"

namespace trocar::bleeding {

// Volume in a second out of an opening of that area, m^3/s: the pressure drives it through what
// feeds the vessel and through the opening in turn,
//   pressure = pressure / most_flow * flow + density / 2 * (flow / (coefficient * area))^2.
double outflow_m3_s(const Vessel& vessel, double area_m2);

// The part of a wound triangle that lies within a vessel.
struct Mouth {
  std::uint32_t triangle = 0, vessel = 0;
  double area_m2 = 0;
  Vec3d rest_m;  // its middle
};

class OpenVessels {
 public:
  // Looks at the wound triangles from `first` on. They are in order of their numbers, and so are
  // mouths().
  void add(const Rules& rules, const wire::SurfaceLayout& layout, std::size_t first);
  // Removed triangles are no mouths any more.
  void remove_gone(const wire::SurfaceLayout& layout);
  void clear() { mouths_.clear(); }
  const std::vector<Mouth>& mouths() const { return mouths_; }

  // Sets the clips of jaws that close now.
  void set_clips(const Instruments& instruments, const SurfaceGraph& graph,
                 const SurfacePlaces& places, Blood& blood) const;
  // Lets a frame's blood out, onto the corners of the mouths; returns how many vessels bleed.
  std::uint32_t bleed(const Rules& rules, const Instruments& instruments, const SurfaceGraph& graph,
                      const SurfacePlaces& places, Blood& blood,
                      std::vector<std::uint32_t>& wetted);

 private:
  Vec3d middle_of(const Mouth& mouth, const SurfaceGraph& graph, const SurfacePlaces& places) const;

  std::vector<Mouth> mouths_;
  std::vector<double> open_m2_;  // per mouth, in the frame that bleeds
};

}  // namespace trocar::bleeding

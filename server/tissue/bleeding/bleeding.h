#pragma once

// Lets a frame's blood out of what is open, and moves it: one step for each published frame. It
// takes nothing but the frame's surface and the tools at work.
//
//   wounds and vessels --> film on the surface --> runs downhill, pools --> drips off
//        ^ pressing, clips, coagulation               ^ suction
//
// Cost: proportional to the vertices that are wet or bleed, and to the surface where it was
// replaced. No allocation once its arrays have ceased to grow.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/wire/figures.h"
#include "common/wire/surface_change.h"
#include "server/tissue/bleeding/blood.h"
#include "server/tissue/bleeding/film.h"
#include "server/tissue/bleeding/instruments.h"
#include "server/tissue/bleeding/rules.h"
#include "server/tissue/bleeding/surface_graph.h"
#include "server/tissue/bleeding/vessels.h"

namespace trocar::bleeding {

// The surface that a frame shows, and how it came from that of the frame before.
struct FrameSurface {
  const wire::SurfaceLayout& layout;
  std::span<const wire::QuantisedVertex> displacements;
  const wire::SurfaceChange* change = nullptr;  // null: it has not changed
  bool is_another = false;                      // no change leads to it
};

// The work of the step. It follows from the layout and from Blood, which is the state.
class Bleeding {
 public:
  explicit Bleeding(Rules rules) : rules_(std::move(rules)) {}

  // Returns what has bled so far, and what bleeds.
  wire::BloodFigures run(const FrameSurface& surface, std::span<const ToolAtWork> tools,
                         Blood& blood);

 private:
  void follow(const FrameSurface& surface, Blood& blood);
  void refresh_vertex(std::uint32_t vertex, Blood& blood);
  void wet(std::uint32_t vertex);
  void ooze(const SurfacePlaces& places, Blood& blood);
  void suck(const SurfacePlaces& places, Blood& blood);
  void set_levels(Blood& blood);

  Rules rules_;
  std::optional<std::uint32_t> epoch_;  // of graph_; nothing: it is to be built
  std::size_t triangles_ = 0;           // numbers that graph_ and vessels_ know
  SurfaceGraph graph_;
  OpenVessels vessels_;
  Instruments instruments_;
  Film film_;
  std::vector<std::uint32_t> sources_, wet_, wetted_;
  std::vector<std::uint8_t> is_source_, is_wet_;  // per vertex: it is in the list
  std::uint32_t oozing_ = 0;                      // vertices, in the newest frame
  StateHasher hasher_;
};

}  // namespace trocar::bleeding

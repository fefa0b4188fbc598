#pragma once

// Bleeding of a session, one step for each published frame. It takes nothing but the frame, the
// surface's layout and the tools, and makes the same blood of the same frames on any machine; no
// tick depends on it.
//
//   wounds and vessels --> film on the surface --> runs downhill, pools --> drips off
//        ^ pressing, clips, coagulation               ^ suction
//
// Cost: proportional to the vertices that are wet or bleed, and to the surface where it was
// replaced. No allocation once its arrays have ceased to grow, but for the frame's own levels.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "server/session/bleeding/blood.h"
#include "server/session/bleeding/film.h"
#include "server/session/bleeding/instruments.h"
#include "server/session/bleeding/rules.h"
#include "server/session/bleeding/surface_graph.h"
#include "server/session/bleeding/vessels.h"

namespace trocar::bleeding {

class Bleeding {
 public:
  explicit Bleeding(Rules rules) : rules_(std::move(rules)) {}

  // The next frame, with the layout of its epoch and the tools of its tick. Fills its levels, their
  // CRC and its figures.
  void observe(step::PublishedFrame& frame, const wire::SurfaceLayout& layout,
               const hands::ToolTable& tools);

  const Rules& rules() const { return rules_; }
  const Blood& blood() const { return blood_; }

  void write_state(Bytes& out);
  // Replaces the blood, or leaves it as it was and says what is wrong with the bytes.
  Status restore_state(BytesView bytes);

 private:
  void visit_state(world::StateArchive& archive);
  void use_marks(const step::PublishedFrame& frame);
  void follow_surface(const step::PublishedFrame& frame, const wire::SurfaceLayout& layout);
  void refresh_vertex(std::uint32_t vertex);
  void wet(std::uint32_t vertex);
  void ooze(const SurfacePlaces& places);
  void suck(const SurfacePlaces& places);
  void publish(step::PublishedFrame& frame, std::int64_t shed_before_pl,
               std::uint32_t open_vessels);

  Rules rules_;
  Blood blood_;
  // The blood of the organ as an instructor has marked it, by the mark's number.
  std::array<std::optional<Blood>, hands::kMostMarks> marked_;
  // The rest follows from these and the layout.
  std::optional<std::uint32_t> epoch_;  // of graph_; nothing: it is to be built
  std::size_t triangles_ = 0;           // numbers that graph_ and vessels_ know
  SurfaceGraph graph_;
  OpenVessels vessels_;
  Instruments instruments_;
  Film film_;
  std::vector<std::uint32_t> sources_, wet_, wetted_;
  std::vector<std::uint8_t> is_source_, is_wet_;  // per vertex: it is in the list
  std::uint32_t oozing_ = 0;                      // vertices, in the newest frame
};

}  // namespace trocar::bleeding

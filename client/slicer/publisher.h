#pragma once

// Tells peers of a session, from its replica: when it changes, and no oftener than asked.
//
//   TRANSFORM  <tool>          RAS from the tool as it is seen: held back by tissue
//   STRING     <tool>_force    "0.412 N, R 0.010 A -0.020 S 0.411": of the tissue on the tool
//   SENSOR     <tool>          the same three numbers, N, where it is asked for
//   POLYDATA   Trocar_surface  the surface, RAS, mm
//   STATUS     Trocar          what the session does
//
// <tool> is the participant's name and _R for the first tool, _L for the second. Thread: one.

#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "client/replica/replica.h"
#include "client/slicer/frames.h"
#include "client/slicer/outgoing.h"

namespace trocar::slicer {

// A name of kMostNameBytes with the longest ending: printable ASCII, one for each tool. Other
// names are cut, and told apart by the participant's number.
std::string tool_name(const std::string& participant, ToolSlot tool);

struct Board {
  std::function<void(const std::string& key, SharedBytes)> put;
  std::function<void(const std::string& key)> take_down;
};

struct PublishOptions {
  double rate_hz = 30, surface_rate_hz = 5;
  bool has_sensor = false;
};

class Publisher {
 public:
  Publisher(const PublishOptions& options, Board board)
      : options_(options), board_(std::move(board)) {}

  void update(const replica::Replica& replica, const Frames& frames, std::uint64_t now_ns);
  // At once if the text is another one, else once a second.
  void say(Condition condition, const std::string& text, std::uint64_t now_ns);
  // Another session follows: what was shown of this one goes.
  void begin_anew();

 private:
  void show_tools(const replica::Replica& replica, const replica::SessionFrame& frame,
                  const Frames& frames);
  void show_surface(const replica::Replica& replica, const Frames& frames);

  const PublishOptions options_;
  const Board board_;
  std::uint64_t tools_ns_ = 0, surface_ns_ = 0, said_ns_ = 0;  // when each was last sent
  Frame shown_frame_ = 0;
  bool has_frame_ = false;
  std::set<std::string> tool_keys_;
  wire::QuantisedSurface shown_surface_;
  std::uint64_t shown_version_ = 0;  // of the topology
  std::vector<Vec3f> points_mm_;     // scratch
  std::string said_;
};

}  // namespace trocar::slicer

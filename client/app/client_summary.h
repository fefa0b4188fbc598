#pragma once

// Figures of one client's run as JSON, for scripts and people.

#include <string>
#include <vector>

#include "client/app/felt_hand.h"
#include "client/replica/replica.h"
#include "client/replica/time_distribution.h"

namespace trocar::app {

struct ClientSummary {
  std::string name, role;
  std::string exit_reason;  // one line
  double wall_seconds = 0;
  std::uint64_t pictures = 0;
  replica::TimeDistribution round_trip;
  // The time since the server published the newest surface, as it was every 4 ms or so.
  replica::TimeDistribution surface_age;
  // From a hand's motion until a frame shows it, and from a cut on the server until it is shown.
  replica::TimeDistribution hand_to_visible, cut_to_visible;
  std::vector<FeltFigures> hands;  // that feel
};

// Writes what each hand did and felt, as CSV. Empty file: nothing is written.
Status write_trace(const std::string& file, const std::vector<const haptics::Trace*>& hands);
std::string to_json(const ClientSummary& summary, const replica::Replica& replica,
                    const replica::SourceStatistics& source);

}  // namespace trocar::app

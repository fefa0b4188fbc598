#pragma once

// Figures of one client's run as JSON, for scripts and people.

#include <string>

#include "client/replica/replica.h"

namespace trocar::app {

struct ClientSummary {
  std::string name, role;
  std::string exit_reason;  // one line
  double wall_seconds = 0;
  std::uint64_t pictures = 0;
  double round_trip_ms = 0;
};

std::string to_json(const ClientSummary& summary, const replica::Replica& replica,
                    const replica::SourceStatistics& source);

}  // namespace trocar::app

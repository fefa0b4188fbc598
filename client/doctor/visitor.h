#pragma once

// Visits a session: finds the way to its server, joins as an observer, measures for some seconds,
// and leaves. Thread: the caller's; it takes `seconds` and some more.

#include <memory>
#include <string>

#include "client/doctor/measurements.h"
#include "client/replica/interpolated_surface.h"
#include "client/replica/replica.h"
#include "common/base/result.h"

namespace trocar::doctor {

struct VisitOptions {
  std::string server;        // "HOST", "HOST:PORT" or "[IPV6]:PORT"
  std::string join;          // code or link; empty: from the link file, on this machine
  std::string ca_file;       // empty: the code says whose certificate it must be
  bool is_insecure = false;  // without TLS, on this machine only
  double wait_s = 5;         // for a server to answer
  double seconds = 5;        // to measure
};

// A visit leaves this: the figures, and the organ as it was last seen.
struct Visited {
  Visit figures;
  std::unique_ptr<replica::Replica> replica;  // null: not joined
  replica::InterpolatedSurface surface;
};

// An error is one of the command line. What goes wrong on the way stands in the figures.
Result<Visited> visit_session(const VisitOptions& options);

}  // namespace trocar::doctor

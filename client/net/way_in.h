#pragma once

// How a program that takes part gets into a session: by a join code, or on the server's own machine
// by its link file; who answers for the server; with TLS or without.

#include <string>

#include "client/net/net_source.h"

namespace trocar::net {

struct WayIn {
  std::string join;          // code or link; empty: from the link file
  std::string ca_file;       // empty: the code says whose certificate it must be
  bool is_insecure = false;  // without TLS, on this machine only
  std::string role;          // whose code of the link file
};

// Sets what belongs to it in `options`, whose host and port are set. The error names the option of
// the command line.
Status set_way_in(const WayIn& way_in, NetSourceOptions& options);

}  // namespace trocar::net

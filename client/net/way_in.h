#pragma once

// How a client gets into a session: where it is, with what code, and whose certificate it must
// have; and how it ends with it.

#include <string>

#include "client/net/net_source.h"
#include "common/base/result.h"
#include "common/wire/role.h"

namespace trocar::net {

struct WayIn {
  std::string join;          // code or link; empty: from the link file, on this machine
  std::string ca_file;       // empty: the code says whose certificate it must be
  bool is_insecure = false;  // without TLS, on this machine only
  wire::Role role = wire::Role::Surgeon;
};

// Sets TLS and the code; `connection` has its host and port. Errors begin with the option.
Status set_security(const WayIn& way, NetSourceOptions& connection);

// Returns how a program ends whose session was left for this reason; an error has its exit code.
Status ending_of(const replica::CloseReason& reason);

}  // namespace trocar::net

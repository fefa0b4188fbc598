#pragma once

// How links name a program of this machine.

#include <string>

namespace trocar::secure {

// Returns an address by which others may reach what listens at that one, in brackets where it is
// IPv6. Where it listens everywhere: the address of the way to other networks, else any of this
// machine's, else "HOST".
std::string public_host(const std::string& listens_at);

}  // namespace trocar::secure

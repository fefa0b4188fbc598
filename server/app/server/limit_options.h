#pragma once

// Options of trocar-server that bound what people and strangers may take.

#include <cstddef>
#include <cstdint>

#include "common/wire/framing.h"
#include "server/session/participants/roster.h"

namespace trocar::app {

struct LimitOptions {
  participants::Places places;
  std::uint32_t messages_per_second = 2000;  // of one client
  std::uint32_t kilobytes_per_second = 500;  // likewise
  std::uint32_t message_bytes = wire::kMaxUpstreamBytes;
  int newcomers = 48;  // connections that have not said who they are
  int newcomers_per_address = 32;
};

}  // namespace trocar::app

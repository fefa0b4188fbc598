#pragma once

// These are counts of what happened to those who watch in browsers.

#include <cstddef>
#include <cstdint>

#include "server/session/replication/replicator_options.h"

namespace trocar::page {

struct PageCounters {
  std::uint64_t joins = 0;                          // that reached a session
  std::uint64_t refused = 0;                        // by the page: form, code, too many tries
  std::uint64_t wrong_codes = 0;                    // by page or session
  std::uint64_t unreachable = 0;                    // sessions
  std::uint64_t messages_down = 0, bytes_down = 0;  // to browsers
  std::uint64_t messages_up = 0, bytes_up = 0;
  replication::ReplicatorCounters frames;  // summed over those who share a carrier
  std::size_t watchers = 0;                // now
  std::size_t carriers = 0;                // connections that many share, now
};

}  // namespace trocar::page

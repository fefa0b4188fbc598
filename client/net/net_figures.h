#pragma once

// The Asio thread counts these, and others may look at them.

#include <atomic>
#include <cstdint>

#include "client/net/comeback.h"
#include "client/replica/session_source.h"

namespace trocar::net {

struct NetFigures {
  std::atomic<std::uint64_t> bytes_received{0}, bytes_sent{0};
  std::atomic<std::uint64_t> messages_received{0}, frames_received{0}, sends_dropped{0};
  std::atomic<std::uint64_t> datagram_bytes_received{0}, datagram_bytes_sent{0};
  std::atomic<std::uint64_t> datagrams_received{0}, datagrams_lost{0};
  std::atomic<std::uint64_t> slices_received{0}, hand_messages_refused{0};
  std::atomic<double> round_trip_seconds{0}, shortest_round_trip_seconds{0};
  std::atomic<double> server_offset_us{0};
  std::atomic<bool> has_server_clock{false};

  replica::SourceStatistics statistics(const Comeback& comeback) const;
};

}  // namespace trocar::net

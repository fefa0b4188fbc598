#include "client/net/net_figures.h"

#include "common/base/timing.h"

namespace trocar::net {

replica::SourceStatistics NetFigures::statistics(const Comeback& comeback) const {
  const auto absence = comeback.figures(monotonic_ns());
  return {.bytes_received = bytes_received,
          .bytes_sent = bytes_sent,
          .messages_received = messages_received,
          .frames_received = frames_received,
          .sends_dropped = sends_dropped,
          .round_trip_seconds = round_trip_seconds,
          .shortest_round_trip_seconds = shortest_round_trip_seconds,
          .datagram_bytes_received = datagram_bytes_received,
          .datagram_bytes_sent = datagram_bytes_sent,
          .datagrams_received = datagrams_received,
          .datagrams_lost = datagrams_lost,
          .slices_received = slices_received,
          .hand_messages_refused = hand_messages_refused,
          .has_server_clock = has_server_clock,
          .server_offset_us = server_offset_us,
          .returns = absence.returns,
          .longest_away_seconds = absence.longest_seconds,
          .away_seconds = absence.away_seconds,
          .away_left_seconds = absence.left_seconds};
}

}  // namespace trocar::net

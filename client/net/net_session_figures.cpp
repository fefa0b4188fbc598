#include "client/net/net_session.h"
#include "common/base/timing.h"

namespace trocar::net {

replica::SourceStatistics NetSource::Session::statistics() const {
  const auto absence = comeback_.figures(monotonic_ns());
  return {.bytes_received = bytes_received_,
          .bytes_sent = bytes_sent_,
          .messages_received = messages_received_,
          .frames_received = frames_received_,
          .sends_dropped = sends_dropped_,
          .round_trip_seconds = round_trip_seconds_,
          .shortest_round_trip_seconds = shortest_round_trip_seconds_,
          .datagram_bytes_received = datagram_bytes_received_,
          .datagram_bytes_sent = datagram_bytes_sent_,
          .datagrams_received = datagrams_received_,
          .datagrams_lost = datagrams_lost_,
          .slices_received = slices_received_,
          .hand_messages_refused = hand_messages_refused_,
          .has_server_clock = has_server_clock_,
          .server_offset_us = server_offset_us_,
          .returns = absence.returns,
          .longest_away_seconds = absence.longest_seconds,
          .away_seconds = absence.away_seconds,
          .away_left_seconds = absence.left_seconds};
}

}  // namespace trocar::net

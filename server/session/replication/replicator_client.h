#pragma once

// One connection as the replicator knows it. Only the replicator's own sources include this.

#include "server/session/pacing/part_pacer.h"
#include "server/session/replication/frame_feed.h"
#include "server/session/replication/replicator.h"

namespace trocar::replication {

struct Replicator::Client : Speaker {
  // `its_id` 0: there is no connection at present.
  Client(net::Connections& connections, net::ConnectionId its_id, const ReplicatorOptions& options,
         ReplicatorCounters& counters)
      : Speaker(its_id, options),
        carrier(connections.carrier_of(its_id)),
        feed(connections, its_id, options, counters),
        messages(options.max_messages_per_second, options.clock_ns()),
        bytes(options.max_bytes_per_second, options.clock_ns()),
        reports(1, options.clock_ns()) {}

  // True for who is told what everybody is told, and given frames.
  bool listens() const { return is_carrier || (participant && carrier == 0); }

  const net::ConnectionId carrier;  // of a guest (replicator_guests.cpp), else 0
  bool is_carrier = false;          // it has carried a guest who was welcome
  bool is_welcome = false;
  FrameFeed feed;
  pacing::PartPacer fine_parts;  // of the fine surface
  bool has_sent_datagrams = false;
  pacing::Allowance messages, bytes, reports;  // that it may send
};

}  // namespace trocar::replication

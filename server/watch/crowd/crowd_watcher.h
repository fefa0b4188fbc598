#pragma once

// One connection as the crowd knows it. Only the crowd's own sources include this.

#include "server/session/pacing/allowance.h"
#include "server/session/pacing/part_pacer.h"
#include "server/session/replication/frame_feed.h"
#include "server/watch/crowd/crowd.h"

namespace trocar::crowd {

struct Crowd::Watcher {
  Watcher(net::Connections& connections, net::ConnectionId its_id, const CrowdOptions& options,
          replication::ReplicatorCounters& counters)
      : id(its_id),
        carrier(connections.carrier_of(its_id)),
        feed(connections, its_id, options.limits, counters),
        messages(options.limits.max_messages_per_second, options.limits.clock_ns()),
        bytes(options.limits.max_bytes_per_second, options.limits.clock_ns()) {}

  // True for who has the picture, and is told what everybody is told.
  bool listens() const { return has_begun && (is_carrier || carrier == 0); }

  const net::ConnectionId id;
  const net::ConnectionId carrier;  // of a guest, else 0
  bool is_carrier = false;          // it has carried a guest who was welcome
  bool is_welcome = false;
  bool has_begun = false;  // it has been shown everything
  replication::FrameFeed feed;
  pacing::PartPacer fine_parts;       // of the fine surface
  pacing::Allowance messages, bytes;  // that it may send
};

}  // namespace trocar::crowd

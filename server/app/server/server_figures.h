#pragma once

// The figures of a running session for monitoring, in Prometheus' text format. Nothing in it names
// anybody. They come from what the I/O thread has anyhow: the simulation is asked nothing.

#include <string>
#include <vector>

#include "common/wire/recording_state.h"
#include "server/session/access/gate.h"
#include "server/session/monitoring/disk_watch.h"
#include "server/session/net/tcp_server.h"
#include "server/session/participants/inbox.h"
#include "server/session/participants/roster.h"
#include "server/session/replication/replicator.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::app {

struct ServerFigures {
  const step::PublishedFrame* newest = nullptr;  // null: none yet
  double frame_age_s = 0;                        // since it came
  bool is_paused = false;
  std::uint64_t frames_lost = 0;  // between simulation and I/O thread
  std::vector<participants::Participant> people;
  std::size_t connections = 0;
  net::TcpCounters tcp;
  net::DatagramCounters datagrams;
  const replication::ReplicatorCounters& replication;
  participants::SimulationInbox::Counters inbox;
  access::GateCounters access;
  wire::RecordingState recording;
  std::size_t recording_queued_bytes = 0;
  std::uint64_t recording_syncs = 0;
  const monitoring::DiskWatch& disk;
};

std::string to_exposition(const ServerFigures& figures);

}  // namespace trocar::app

#pragma once

// Figures of one run as JSON, for scripts and people.

#include <string>
#include <vector>

#include "common/wire/recording_state.h"
#include "server/app/server/simulation_loop.h"
#include "server/session/net/tcp_server.h"
#include "server/session/replication/replicator.h"

namespace trocar::app {

struct Summary {
  std::string organ;
  std::size_t node_count = 0, surface_vertex_count = 0;
  double wall_seconds = 0;
  std::string journal;
  wire::RecordingState recording;
  std::uint64_t frames_lost = 0;  // between simulation and I/O thread
  const LoopReport& loop;
  const std::vector<replication::BarrierResult>& barrier;
  const replication::ReplicatorCounters& replication;
  const replication::EncodeStatistics& encoding;
  const access::GateCounters access;
  const net::TcpCounters& tcp;
  const net::DatagramCounters datagrams;
  const participants::SimulationInbox::Counters& inbox;
};

std::string to_json(const Summary& summary);

}  // namespace trocar::app

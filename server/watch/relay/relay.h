#pragma once

// A relay as a whole: its upstream, a listener, and the crowd between them. The port is bound when
// the first surface has come, as outboxes are made for its size; watchers are let in from the first
// picture on. It ends with the session. Thread: that of the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/secure/join_code.h"
#include "common/wire/framing.h"
#include "server/session/net/tcp_server.h"
#include "server/watch/crowd/crowd.h"
#include "server/watch/crowd/guest_connections.h"
#include "server/watch/follow/upstream.h"

namespace trocar::relay {

struct RelayOptions {
  secure::HalfCode secret{};  // of the code that watchers need
  net::TcpServerOptions tcp;  // address, port, TLS; bounds are set by the number of watchers
  std::size_t most_watchers = 1000;
  std::vector<std::string> further_addresses;
};

struct RelayEvents {
  std::function<void(std::uint16_t port)> ready;  // watchers are let in
  // Everybody has been told goodbye, and the context may stop. An error: there was no session, or
  // the server has put the relay out.
  std::function<void(const Status& outcome)> over;
};

struct RelayFigures {
  bool is_connected = false, is_ready = false;
  std::uint64_t returns = 0, server_bytes = 0;
  std::size_t watchers = 0, connections = 0;
  crowd::CrowdCounters crowd;
  replication::ReplicatorCounters frames;
  net::TcpCounters tcp;
  net::DatagramCounters datagrams;
};

class Relay {
 public:
  Relay(asio::io_context& context, std::unique_ptr<follow::Upstream> upstream, RelayOptions options,
        RelayEvents events);
  ~Relay();

  void start();
  // Goodbye to everybody; over() follows.
  void end(wire::EndReason reason, const std::string& text);
  RelayFigures figures() const;

 private:
  void take_welcome(const proto::Welcome& welcome);
  Status take(const proto::Envelope& message, const wire::SharedBytes& framed);
  Status take_in_crowd(const proto::Envelope& message, const wire::SharedBytes& framed);
  Status open(std::size_t topology_bytes);
  void begin_listening();
  void attend();
  void note_over(wire::EndReason reason, const std::string& text);
  void fail(const Error& error);
  void await_goodbyes();

  asio::io_context& context_;
  const RelayOptions options_;
  const RelayEvents events_;
  const std::unique_ptr<follow::Upstream> upstream_;
  asio::steady_timer attention_, end_timer_;
  std::chrono::milliseconds waited_{0};
  std::unique_ptr<proto::Welcome> welcome_;
  std::vector<wire::SharedBytes> early_;  // what came before the surface
  std::unique_ptr<net::TcpServer> tcp_;   // null: no surface has come yet
  std::unique_ptr<crowd::GuestConnections> connections_;
  std::unique_ptr<crowd::Crowd> crowd_;
  bool is_listening_ = false, is_ending_ = false;
  Status outcome_;
};

}  // namespace trocar::relay

#pragma once

// The relays of one proxy share this: the clock, both directions, outages, limits and counters.
// "Up" is from those who connect to the proxy towards the server behind it.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <string>

#include "common/base/no_throw.h"
#include "common/impair/impairment.h"

namespace trocar::impair {

struct ProxyOptions {
  std::string listen_address = "127.0.0.1";
  std::uint16_t listen_port = 7700;  // 0: any free port
  std::string server_host = "127.0.0.1";
  std::uint16_t server_port = 7690;
  Impairment up, down;
  Outage blocked;  // datagrams
  Outage cut;      // the stream
  std::uint64_t seed = 1;
  std::size_t most_streams = 64;
  std::size_t most_peers = 256;            // of datagrams
  std::chrono::milliseconds idle{60'000};  // a peer that is silent for so long is forgotten
};

class Network {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Network(const ProxyOptions& chosen)
      : options(chosen), up(chosen.up), down(chosen.down), start_(Clock::now()) {}

  Time now() const { return Clock::now() - start_; }
  // When a timer is due; kNever stays so.
  Clock::time_point due(Time time) const {
    return time == kNever ? Clock::time_point::max() : start_ + time;
  }
  // Both delays with the mean of their jitter.
  Time round_trip() const {
    return options.up.delay + options.down.delay + (options.up.jitter + options.down.jitter) / 2;
  }

  const ProxyOptions options;
  asio::ip::tcp::endpoint stream_server;
  asio::ip::udp::endpoint datagram_server;
  Direction up, down;
  std::uint64_t streams = 0, streams_refused = 0;
  std::uint64_t peers = 0, datagrams_refused = 0;

 private:
  const Clock::time_point start_;
};

}  // namespace trocar::impair

#pragma once

// A proxy for a stream (TCP) and datagrams (UDP) at one port, through a bad network: for tests, for
// benchmarks, and for people who want to know how a session will feel.
//
// Bounds: 64 streams of at most 2 * 1.2 MB, 256 peers of datagrams of at most 2 * 0.3 MB. Whoever
// is one too many is closed or not heard, and counted. Thread: all calls on the one thread that
// runs the I/O context, which outlives this.

#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/impair/network.h"

namespace trocar::impair {

class Proxy {
 public:
  // Finds the server's address and binds both ports; ErrorCode::ResourceMissing if one cannot be
  // had. A server need not be there yet. Time begins now.
  static Result<std::unique_ptr<Proxy>> listen(asio::io_context& context,
                                               const ProxyOptions& options);
  // Closes everything.
  ~Proxy();

  void start();
  void stop();
  std::uint16_t port() const;
  const Network& network() const;
  std::size_t stream_count() const;
  // Returns how much waits in the lines of all streams.
  std::size_t stream_waiting_bytes() const;

 private:
  class Core;
  explicit Proxy(std::shared_ptr<Core> core);
  std::shared_ptr<Core> core_;  // shared with the coroutines, which may outlive this object
};

// Says as JSON what became of packets.
std::string to_json(const Network& network);

}  // namespace trocar::impair

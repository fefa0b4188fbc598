#pragma once

// A small HTTP listener for monitoring, apart from the session's port:
//
//   GET /healthz   200 "ok", or 503 and one line: restart it
//   GET /readyz    200 "ok", or 503 and one line: send nobody there now
//   GET /metrics   figures for Prometheus
//
// Bounds: at most kMostConnections at a time, one request of each, kMostHeaderBytes of it,
// kDeadline to ask and as long for the answer. It knows no names and takes nothing.
//
// Thread: the one that runs the I/O context; the answers are asked for there.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace trocar::monitoring {

struct FiguresAnswers {
  // One line about what is wrong; empty: nothing.
  std::function<std::string()> ill, not_ready;
  std::function<std::string()> metrics;  // in the text exposition format
};

class FiguresServer {
 public:
  static constexpr int kMostConnections = 16;
  static constexpr std::uint32_t kMostHeaderBytes = 4096;
  static constexpr std::chrono::seconds kDeadline{5};

  // Binds and listens; ErrorCode::Usage for what is no address, ErrorCode::ResourceMissing when it
  // cannot be had. Port 0: any free one.
  static Result<std::unique_ptr<FiguresServer>> listen(asio::io_context& context,
                                                       const std::string& address,
                                                       std::uint16_t port, FiguresAnswers answers);
  // Closes everything; nothing is asked after this.
  ~FiguresServer();

  std::uint16_t port() const;
  // No further connections, so that the context can come to its end.
  void stop();

 private:
  struct Core;
  explicit FiguresServer(std::shared_ptr<Core> core);

  std::shared_ptr<Core> core_;  // shared with the coroutines, which may outlive this object
};

}  // namespace trocar::monitoring

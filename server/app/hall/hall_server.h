#pragma once

// The hall answers over HTTP, with TLS where it has a certificate:
//
//   GET /sessions          all of them; join codes only with the key
//   GET /sessions/NAME     one of them
//   POST /sessions         {"start": "find-the-lump", "name": "group-a"}: 201 and it, or 409
//   DELETE /sessions/NAME  ends it; answers when its recording is closed
//   GET /healthz, /metrics as those of trocar-server
//
// The hall's audit log says who has started and ended sessions, and who was refused.
// What changes something needs "Authorization: Bearer KEY". Errors are {"error": "one line"}.
//
// Bounds: kMostConnections at a time, one request each, kMostHeadBytes and kMostRequestBytes of it
// within kRequestDeadline, with TLS the handshake, too. A wrong key is answered after
// kWrongKeyDelay.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/secure/tls.h"
#include "server/hall/proof/proof.h"
#include "server/hall/sessions/sessions.h"

namespace trocar::app {

class HallServer {
 public:
  static constexpr int kMostConnections = 32;
  static constexpr std::uint32_t kMostHeadBytes = 8192;
  static constexpr std::chrono::seconds kRequestDeadline{5};
  static constexpr std::chrono::seconds kWrongKeyDelay{1};
  static constexpr std::chrono::seconds kEndDeadline{90};

  // `sessions` outlives it. `tls` null: without. ErrorCode::Usage for what is no address,
  // ErrorCode::ResourceMissing when it cannot be had.
  static Result<std::unique_ptr<HallServer>> listen(asio::io_context& context,
                                                    hall::Sessions& sessions, std::string key,
                                                    secure::TlsContext tls);
  ~HallServer();

  std::uint16_t port() const;
  // Closes the port; requests that are under way get their answer.
  void stop();

  // The same for a request that came over a bus, at HTTP's paths. `answer` gets an object with
  // "status", a number, and "body", a text, once. Wrong proofs are noted once a second at most.
  void answer(const hall::BusRequest& request, hall::Proof proof,
              std::function<void(const std::string&)> answer);
  // Returns what GET /sessions says to who has no key, with the hall's name and number of its
  // start.
  std::string directory(const std::string& hall_name, const std::string& start) const;

 private:
  struct Core;
  explicit HallServer(std::shared_ptr<Core> core);

  std::shared_ptr<Core> core_;  // shared with the coroutines, which may outlive this object
};

}  // namespace trocar::app

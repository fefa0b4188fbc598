#pragma once

// Tells Agones, which places game servers in a Kubernetes cluster, how this session is. A sidecar
// of Agones listens on this machine; see agones.dev, "REST Game Server Client API":
//
//   POST /ready      once the simulation runs: people may be sent here
//   POST /health     every kHealthPeriod, while nothing is wrong
//   POST /allocate   when the first person joins, so that nobody's session is scaled away
//   GET  /gameserver once ready: name, and the address at which others reach it
//   POST /shutdown   when everything is written
//
// The sidecar may start after this program: what it did not take is said again, /ready after
// kRetry, /health and /allocate after kHealthPeriod.
// One thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"

namespace trocar::agones {

inline constexpr std::uint16_t kDefaultPort = 9358;
inline constexpr const char* kPortVariable = "AGONES_SDK_HTTP_PORT";

// A place is where the cluster says that this server is.
struct Place {
  std::string name, address;
  std::uint16_t port = 0;  // 0: it has none
};

// The sidecar's port: that of the variable's text, or the default without one. Error: no port.
Result<std::uint16_t> sidecar_port(const char* text);

// Reads an answer to GET /gameserver. Its texts are printable. Error: it is none.
Result<Place> read_place(const std::string& json);

class Sidecar {
 public:
  static constexpr std::chrono::milliseconds kHealthPeriod{2000};
  static constexpr std::chrono::milliseconds kRetry{1000};

  // ill, not_ready: a line about what is wrong; empty: nothing.
  Sidecar(asio::io_context& context, std::uint16_t port, std::function<std::string()> ill,
          std::function<std::string()> not_ready);
  // Nothing is asked after this.
  ~Sidecar();
  Sidecar(const Sidecar&) = delete;
  Sidecar& operator=(const Sidecar&) = delete;

  void start();
  // `count`: of people in the session.
  void set_people(std::size_t count);

 private:
  struct Core;
  std::shared_ptr<Core> core_;  // shared with the coroutines, which may outlive this object
};

// After the session, without an I/O thread: the cluster may take the server away.
Status shut_down(std::uint16_t port);

}  // namespace trocar::agones

#pragma once

// A hall on a bus: it says every two seconds what runs in it and what room is left, answers who
// asks for that, and takes the requests of its HTTP port over the bus as well.
//
//   trocar.hall.state           published: a directory, as GET /sessions has it, with "hall" and
//                               "start", a number that is another one after each start
//   trocar.hall.directory       asked: every hall answers with its directory
//   trocar.hall.NAME.request    asked: one hall answers (server/hall/proof/proof.h)
//
// At most kMostWaiting messages wait for the hall's thread, of kMostRequestText bytes each: more
// are left out. Thread: that of the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "server/app/hall/hall_server.h"
#include "server/bus/bus.h"
#include "server/hall/proof/proof.h"

namespace trocar::app {

inline constexpr const char* kStateSubject = "trocar.hall.state";
inline constexpr const char* kDirectorySubject = "trocar.hall.directory";
std::string request_subject(const std::string& hall_name);
// Returns this machine's name and the port, as a hall's name: lower-case letters, digits, hyphens.
std::string hall_name(std::uint16_t port);

class HallBus {
 public:
  static constexpr int kMostWaiting = 64;
  static constexpr std::size_t kMostRequestText = 16 * 1024;

  // Takes `context` and `server`, which outlive it. ErrorCode::Usage for a wrong URL.
  static Result<std::unique_ptr<HallBus>> open(asio::io_context& context, HallServer& server,
                                               const bus::BusPlace& place, const std::string& key);
  void stop();
  const std::string& name() const { return name_; }

 private:
  HallBus(asio::io_context& context, HallServer& server, const std::string& key);
  Status subscribe();
  std::string directory() const;
  // Takes one place of kMostWaiting; false: all are taken. Thread: any one.
  bool may_wait();
  void publish_often();
  void take_request(const std::string& text, const std::string& answer_to);

  asio::io_context& context_;
  HallServer& server_;
  const std::string name_;
  hall::ProofCheck proofs_;
  asio::steady_timer timer_;
  std::shared_ptr<bus::Bus> bus_;
  std::atomic<int> waiting_ = 0;  // messages for the hall's thread
  std::shared_ptr<bool> is_alive_ = std::make_shared<bool>(true);
};

}  // namespace trocar::app

#pragma once

// Starts, watches and ends the sessions of a hall. A session whose server was killed goes on from
// its recording, at the same port with the same codes. Sessions outlive the hall, and the next one
// finds them again.
//
// Thread: the one that runs the I/O context.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/hall/plan/admission.h"
#include "server/hall/plan/hall_config.h"
#include "server/hall/plan/start_request.h"
#include "server/hall/sessions/session.h"
#include "server/hall/sessions/state_file.h"

namespace trocar::hall {

class Sessions {
 public:
  struct Counters {
    std::uint64_t started = 0, refused = 0, restarted = 0, failed = 0, found = 0;
  };

  // Reads what an earlier hall has left in config.state_folder, finds those servers again, and
  // starts from their recordings those that were killed meanwhile. `program`: trocar-server.
  static Result<std::unique_ptr<Sessions>> open(asio::io_context& context, HallConfig config,
                                                std::filesystem::path program);

  // Looks after all of them from now on, until stop().
  void watch();
  void stop();

  // ErrorCode::Refused with one line: unknown, too many, no room on the machine, the name is taken.
  Result<std::shared_ptr<const Session>> start(const StartRequest& request);
  // The server closes its recording; the session's state says when it has. One that has failed is
  // forgotten. ErrorCode::Refused: there is no such session.
  Result<std::shared_ptr<const Session>> end(const std::string& name);
  void end_all();

  // In the order of their start; those that have ended are not among them.
  const std::vector<std::shared_ptr<Session>>& list() const { return sessions_; }
  std::shared_ptr<const Session> find(const std::string& name) const;  // null: there is none
  const HallConfig& config() const { return config_; }
  const Counters& counters() const { return counters_; }
  // Cores that are taken, as admission counts them.
  double taken_cores() const;

 private:
  Sessions(asio::io_context& context, HallConfig config, std::filesystem::path program,
           StateFile file, HallState state);

  void take_over(SavedSession saved);
  std::string free_name(const std::string& offer) const;
  Status find_ports(Session& session) const;
  Status make_folder(Session& session) const;
  Status launch(Session& session);
  Status check_room(const Offer& offer) const;
  double expected(const Offer& offer) const;
  std::vector<Load> loads() const;

  void look();
  void look_at(const std::shared_ptr<Session>& session);
  void on_ending(Session& session, const ServerProcess::Ending& ending);
  void prepare_restart(Session& session, const std::string& why);
  void fail(Session& session, const std::string& why);
  void finish(Session& session);
  asio::awaitable<void> probe(std::shared_ptr<Session> session);
  void become_running(Session& session);
  void measure(Session& session);
  void save();

  asio::io_context& context_;
  const HallConfig config_;
  const std::filesystem::path program_;
  const StateFile file_;
  std::map<std::string, double> measured_cores_;  // by offer
  std::vector<std::shared_ptr<Session>> sessions_;
  Counters counters_;
  asio::steady_timer timer_;
  bool is_stopping_ = false;
};

}  // namespace trocar::hall

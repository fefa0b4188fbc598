#pragma once

// Those who watch through a relay. To each of them it is the server: it lets them in, and shows
// them everything that there is to see (show.h).
//
// Who comes needs the secret half of the relay's join code, compared in constant time; wrong ones
// are bounded as the server bounds them. Only observers are let in. Names need not be unique, and
// nobody is listed: the server is told how many there are, at most once a second. Guests of a
// carrier (guest_connections.h) count as any others. What a watcher asks for beyond pictures is
// answered with a line that says why not.
//
// When the uplink comes back to a session that goes on from an earlier frame, everybody is cut, and
// comes back by himself to a fresh picture.
//
// Thread: the I/O thread. `connections` outlives this.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/secure/join_code.h"
#include "server/session/access/try_limiter.h"
#include "server/watch/crowd/show.h"

namespace trocar::proto {
class Hello;
class Welcome;
}  // namespace trocar::proto

namespace trocar::crowd {

struct CrowdOptions {
  secure::HalfCode secret{};
  std::size_t most_watchers = 1000;
  std::uint32_t return_seconds = 600;  // for so long somebody whose connection broke tries again
  bool has_datagrams = false;
  std::vector<std::string> further_addresses;  // "HOST:PORT", of others that show the same
  replication::ReplicatorOptions limits;       // of messages and frames; places do not count
  Show::SayUp say_up;                          // to the server
  // The server's clock in us, at that time of ours; 0: it is not known.
  std::function<std::uint64_t(std::uint64_t now_us)> server_time_us;
};

struct CrowdCounters {
  std::uint64_t joins = 0, refused = 0, wrong_codes = 0;
  std::uint64_t ended = 0;     // by the relay: too slow, or said what nobody may say
  std::uint64_t restarts = 0;  // times that everybody was cut for a session from an earlier frame
  std::uint64_t answers = 0, equal_answers = 0;  // to the Barrier
};

class Crowd final : public Show {
 public:
  Crowd(net::Connections& connections, CrowdOptions options);
  ~Crowd() override;

  // The server has let the relay in, for the first time or again: everything comes anew.
  void begin(const proto::Welcome& welcome);
  // Tells everybody that the picture stands still for a while.
  void note_lost();
  // Goodbye to everybody.
  void end_all(replication::EndReason reason, const std::string& text);
  // Several times a second: frames for those who were busy, and the number for the server.
  void attend();

  std::size_t watcher_count() const { return viewers().welcome_count(); }
  const CrowdCounters& counters() const { return counters_; }
  const replication::ReplicatorCounters& frame_counters() const { return frame_counters_; }

 private:
  using Ending = replication::Ending;
  using Viewer = replication::Viewer;

  std::optional<Ending> heed(Viewer& who, const proto::Envelope& message) override;
  std::optional<Ending> heed_samples(const Viewer& who,
                                     const proto::ClientDatagram& datagram) override;
  void note_shown(const Viewer& who, const proto::FrameAck& ack) override;
  std::uint64_t server_time_us() const override;
  void forget(const Viewer& who, const Ending* ending) override;
  void restart() override;

  std::optional<Ending> admit(Viewer& who, const proto::Hello& hello);
  std::optional<Ending> check_code(const Viewer& who, BytesView secret);
  void refuse_order(const Viewer& who, int action);
  void report_number();

  net::Connections& connections_;
  const CrowdOptions options_;
  std::unique_ptr<proto::Welcome> welcome_;  // as watchers get it; null: not yet
  access::TryLimiter limiter_;
  std::optional<std::size_t> reported_ = 0;  // empty: the server has an earlier number
  std::uint64_t reported_ns_ = 0;
  CrowdCounters counters_;
  replication::ReplicatorCounters frame_counters_;
};

}  // namespace trocar::crowd

#pragma once

// Those who watch through a relay. To each of them it is the server: it lets them in, shows them
// everything that there is to see, and gives each the frames that his connection takes, as the
// server's own frame_feed.h does. The server is asked for nothing when somebody comes.
//
//   uplink --messages--> SessionCopy --> events to everybody, in order
//                                   \--> FrameEncoder -> a FrameFeed for each watcher
//
// A frame is given once its FrameState is there; one that has none is left out, unless it is the
// last. Whoever comes while the surface has just changed is shown it with the next frame.
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
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/timing.h"
#include "common/secure/join_code.h"
#include "server/session/access/try_limiter.h"
#include "server/session/net/connections.h"
#include "server/session/replication/frame_encoder.h"
#include "server/session/replication/replicator_options.h"
#include "server/session/replication/validation.h"
#include "server/watch/follow/session_copy.h"

namespace trocar::proto {
class ClientDatagram;
class Envelope;
class FrameAck;
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
  // Sends a message to the server.
  std::function<void(const proto::Envelope&)> say_up;
  // The server's clock in us, at that time of ours; 0: it is not known.
  std::function<std::uint64_t(std::uint64_t now_us)> server_time_us;
};

struct CrowdCounters {
  std::uint64_t joins = 0, refused = 0, wrong_codes = 0;
  std::uint64_t ended = 0;     // by the relay: too slow, or said what nobody may say
  std::uint64_t restarts = 0;  // times that everybody was cut for a session from an earlier frame
  std::uint64_t answers = 0, equal_answers = 0;  // to the Barrier
};

class Crowd final : public net::ConnectionHandler {
 public:
  Crowd(net::Connections& connections, CrowdOptions options);
  ~Crowd() override;

  // The server has let the relay in, for the first time or again: everything comes anew.
  void begin(const proto::Welcome& welcome);
  // A message of the server. An error: it cannot be right, and nothing fits any more.
  Status take(const proto::Envelope& message, const wire::SharedBytes& framed);
  // Tells everybody that the picture stands still for a while.
  void note_lost();
  // Goodbye to everybody.
  void end_all(replication::EndReason reason, const std::string& text);
  // Several times a second: frames for those who were busy, and the number for the server.
  void attend();

  // True once there is a picture for who comes.
  bool has_picture() const;
  std::size_t topology_bytes();
  std::size_t watcher_count() const { return watchers_here_; }
  const CrowdCounters& counters() const { return counters_; }
  const replication::ReplicatorCounters& frame_counters() const { return frame_counters_; }
  Frame newest_frame() const { return encoder_->current() ? encoder_->current()->frame : 0; }

  void on_open(net::ConnectionId id) override;
  void on_message(net::ConnectionId id, BytesView message) override;
  void on_datagram(net::ConnectionId id, BytesView message) override;
  void on_fault(net::ConnectionId id, net::ConnectionFault fault) override;
  void on_close(net::ConnectionId id) override;

 private:
  struct Watcher;
  using Ending = replication::Ending;

  std::optional<Ending> handle_message(Watcher& watcher, BytesView bytes);
  std::optional<Ending> handle_datagram(Watcher& watcher, const proto::ClientDatagram& datagram);
  std::optional<Ending> handle_carrier(Watcher& carrier, const proto::Envelope& message);
  std::optional<Ending> check_guest(Watcher& guest);
  std::optional<Ending> check_rate(Watcher& watcher, std::size_t bytes);
  std::optional<Ending> admit(Watcher& watcher, const proto::Hello& hello);
  std::optional<Ending> check_code(const Watcher& watcher, BytesView secret);
  std::optional<Ending> handle_ack(Watcher& watcher, const proto::FrameAck& ack);
  void note_answer(const proto::FrameAck& ack);
  void want_keyframe(Watcher& watcher);
  void answer_ping(Watcher& watcher, std::uint64_t client_time_us);

  // Shows somebody everything up to the newest frame; false: it does not fit.
  bool show_all(Watcher& watcher);
  void give_fine_part(Watcher& watcher);
  bool give_frame(Watcher& watcher, bool is_required);
  // The newest frame is whole. `state`: its FrameState; null: it has none.
  void publish(const wire::SharedBytes& state);
  void give_all();
  void begin_barrier(const wire::SharedBytes& barrier);
  void broadcast(const wire::SharedBytes& bytes, bool is_fleeting);
  void acknowledge();
  void report_number();
  // Everybody is cut, and begins anew.
  void restart();
  void end_watcher(Watcher& watcher, const Ending& ending);
  void forget(Watcher& watcher);

  net::Connections& connections_;
  const CrowdOptions options_;
  std::unique_ptr<follow::SessionCopy> copy_;
  std::unique_ptr<replication::FrameEncoder> encoder_;
  std::unique_ptr<proto::Welcome> welcome_;  // as watchers get it; null: not yet
  access::TryLimiter limiter_;
  std::map<net::ConnectionId, std::unique_ptr<Watcher>> watchers_;
  std::size_t watchers_here_ = 0;
  std::optional<std::size_t> reported_ = 0;  // empty: the server has an earlier number
  std::uint64_t reported_ns_ = 0;
  bool is_new_ = false;  // no frame has come since the uplink was welcome
  std::optional<Frame> barrier_frame_;
  std::uint32_t barrier_crc_ = 0;
  CrowdCounters counters_;
  replication::ReplicatorCounters frame_counters_;
};

}  // namespace trocar::crowd

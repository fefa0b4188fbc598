#pragma once

// Takes a session from a bus, where a publisher (publisher.h) passes it on: the upstream of a relay
// that has no connection to the server.
//
//   asks --> answer: all that there is, as of a number --> follows the stream from there
//     ^  \ early: what the stream has told meanwhile, kMostEarlyBytes of it
//     |_____ a number is missing, the copy has lost count, or a message was wrong
//     |_____ lost: for 3 s nothing has come of the publisher that it follows
//
// It asks at once, then after 0.5 s and longer pauses of up to 4 s, all of them up to a quarter
// shorter by its id, so that taps do not ask in step. It follows one publisher, and
// hears no other one meanwhile. Everything comes anew with each answer, as from a server to which a
// relay has come back. It ends when the publisher says that the session is over, or when there was
// no publisher for too long. When it hears that while it asks, it waits for the last picture first,
// until it would ask again.
//
// Whoever may publish on that bus is believed: see docs/security.md. What comes is checked like
// what a server says.
// Thread: that of the executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "common/base/timing.h"
#include "common/wire/server_clock.h"
#include "server/watch/bus/channel.h"
#include "server/watch/bus/piece.h"
#include "server/watch/bus/subjects.h"
#include "server/watch/follow/follower.h"

namespace trocar::bus {

struct TapOptions {
  std::string session;  // is_session_name()
  std::function<std::uint64_t()> clock_ns = monotonic_ns;
};

struct TapCounters {
  std::uint64_t asks = 0;   // for all
  std::uint64_t gaps = 0;   // times that a number was missing
  std::uint64_t wrong = 0;  // messages that cannot be right
};

class Tap final : public follow::Follower {
 public:
  static constexpr std::size_t kMostEarlyBytes = 16 * 1024 * 1024;

  Tap(asio::any_io_executor executor, std::unique_ptr<Channel> channel, TapOptions options);
  ~Tap() override;

  // An error: the subjects cannot be heard. Before start().
  Status listen();
  void start(follow::UpstreamEvents events) override;
  void stop() override;
  // How many watch is told to the publisher; that a keyframe is needed, makes it ask for all.
  void say(const proto::Envelope& message) override;
  // Several times a second, by itself after start(): silence, deadlines, and what is asked again.
  void attend();

  std::string name() const override;
  std::uint64_t server_time_us(std::uint64_t now_us) const override { return clock_.at(now_us); }
  std::uint64_t bytes_received() const override { return bytes_; }
  const TapCounters& counters() const { return counters_; }

 private:
  void take_stream(BytesView bytes);
  void take_piece(const Piece& piece);
  void take_answer(BytesView bytes);
  void take_all(const Piece& last, BytesView whole);
  // False: nothing more is to be read of what the publisher says.
  bool take_messages(BytesView whole);
  bool take_message(BytesView framed);
  void take_pong(BytesView whole);
  void note_goodbye(BytesView whole);
  // Nothing fits any more until all has come anew.
  void lose_count(const std::string& why);
  void ask_for_all();
  void ask(const proto::Envelope& question);
  void cut() override { next_.cancel(); }
  void attend_often();

  const std::unique_ptr<Channel> channel_;
  const TapOptions options_;
  const Subjects subjects_;
  const std::string answers_;      // the subject for answers to this
  const std::uint64_t shortened_;  // thousandths by which its pauses are shorter
  asio::steady_timer next_;
  wire::ServerClock clock_;

  bool is_following_ = false;
  std::uint64_t publisher_ = 0, number_ = 0;  // that it follows, and of the newest that was taken
  Assembler stream_, answer_;
  std::deque<Bytes> early_;  // pieces of the stream while it asks
  std::size_t early_bytes_ = 0;
  std::uint64_t answering_ = 0;  // the publisher whose answer comes; 0: of none

  std::string why_;
  // Says what the publisher that it has followed said at its end while this asked, if anything.
  std::optional<std::string> goodbye_;
  std::uint64_t followed_ns_ = 0, asked_ns_ = 0, pinged_ns_ = 0;
  std::uint64_t pause_ns_ = 0;  // from one question to the next
  std::uint32_t watchers_ = 0;
  std::uint64_t bytes_ = 0;
  TapCounters counters_;
};

}  // namespace trocar::bus

#pragma once

// Passes what a relay receives on to a bus, once for all relays that take it there. It stands
// between the relay and its upstream, and changes nothing for the relay.
//
//   upstream --> publisher --> the relay, as it came
//                   \--> stream: events in order, each frame as a difference to the one before
//   ask --> publisher --> all that there is, as of the newest number of the stream
//
// Frames are encoded anew: the server's are differences to what this relay has acknowledged, which
// somebody who comes late does not have. While more than kBusyBytes wait for the bus, frames are
// left out; other messages are not.
//
// Several publishers of one session do no harm: one that hears another one is silent, and takes
// over 2 s after it has heard the last of it. It listens for so long first, also when the bus was
// away. Of two that began at once, the one with the smaller
// number goes on. One that has lost its upstream is silent, too.
//
// When the session is over, who asks is told so, for as long as the relay is there.
//
// How many watch at the relays that take the session is added to the number of this one.
// The relay's own secrets (its token, the code) never go out.
// Thread: that of the executor.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/base/timing.h"
#include "server/session/pacing/allowance.h"
#include "server/session/replication/frame_encoder.h"
#include "server/watch/bus/channel.h"
#include "server/watch/bus/subjects.h"
#include "server/watch/bus/watcher_sum.h"
#include "server/watch/follow/session_copy.h"
#include "server/watch/follow/upstream.h"

namespace trocar::bus {

struct PublisherOptions {
  std::string session;   // is_session_name()
  std::uint64_t id = 0;  // 0: a random one
  std::function<std::uint64_t()> clock_ns = monotonic_ns;
};

class Publisher final : public follow::Upstream {
 public:
  static constexpr std::size_t kBusyBytes = 1024 * 1024;

  Publisher(asio::any_io_executor executor, std::unique_ptr<follow::Upstream> upstream,
            std::unique_ptr<Channel> channel, PublisherOptions options);
  ~Publisher() override;

  // An error: the subjects cannot be heard. Before start().
  Status listen();
  void start(follow::UpstreamEvents events) override;
  void stop() override;
  void say(const proto::Envelope& message) override;
  // Several times a second, by itself after start(): a sign of life, and the number of watchers.
  void attend();

  std::string name() const override { return upstream_->name(); }
  bool is_welcome() const override { return upstream_->is_welcome(); }
  std::uint64_t server_time_us(std::uint64_t now_us) const override {
    return upstream_->server_time_us(now_us);
  }
  std::uint64_t bytes_received() const override { return upstream_->bytes_received(); }
  std::uint64_t returns() const override { return upstream_->returns(); }

 private:
  void take_welcome(const proto::Welcome& welcome);
  Status take(const proto::Envelope& message, const wire::SharedBytes& framed);
  void take_over(wire::EndReason reason, const std::string& text);
  void pass_on(const proto::Envelope& message, const wire::SharedBytes& framed);
  // `state`: the frame's FrameState; null: it has not come.
  void publish_frame(const wire::SharedBytes& state);
  void publish(const std::vector<wire::SharedBytes>& messages);
  void take_stream(BytesView bytes);
  void take_ask(BytesView bytes, const std::string& answer_to);
  void answer_ping(const std::string& answer_to, std::uint64_t client_time_us);
  void answer_all(const std::string& answer_to);
  void send(const std::string& subject, BytesView whole);
  void report();
  void attend_often();
  // False: another one publishes, or there is nothing to publish.
  bool is_active() const;

  const std::unique_ptr<follow::Upstream> upstream_;
  const std::unique_ptr<Channel> channel_;
  const PublisherOptions options_;
  const Subjects subjects_;
  asio::steady_timer next_;
  pacing::Allowance answers_;  // to those who ask for all
  pacing::Allowance pongs_;
  follow::UpstreamEvents events_;
  std::unique_ptr<follow::SessionCopy> copy_;
  wire::SharedBytes welcome_;            // null: not yet
  wire::SharedBytes barrier_, goodbye_;  // of the session's end; null: it goes on
  std::uint64_t number_ = 0;             // of the newest that went out
  replication::FrameEncoder encoder_;
  step::SharedFrame published_;  // on which the next difference is based; null: a keyframe
  Bytes answer_;                 // to who asks for all, as of number_; empty: not made
  std::uint64_t other_ns_ = 0;   // when another publisher was heard
  bool was_active_ = false;      // as attend() has found it
  bool is_waiting_ = false;      // for another publisher, and the log says so
  bool is_large_told_ = false;   // the log says that something did not fit
  bool is_small_told_ = false;   // the log says that the bus takes too little
  std::map<std::string, std::uint64_t> answered_;  // when, by that subject, of the last 0.25 s
  WatcherSum watchers_;
};

}  // namespace trocar::bus

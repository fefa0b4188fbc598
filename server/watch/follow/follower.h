#pragma once

// An upstream that comes back, whichever way its messages come.
//
//   begin --15 s--> welcome <--10 min-- lost
//      \ over: it was not welcome by then, it speaks another protocol, or the session is over
//
// Thread: that of the relay's executor.

#include "common/base/timing.h"
#include "server/watch/follow/upstream.h"

namespace trocar::follow {

class Follower : public Upstream {
 public:
  bool is_welcome() const override { return is_welcome_; }
  std::uint64_t returns() const override { return returns_; }

 protected:
  static constexpr std::uint64_t kReachNs = 15'000'000'000, kReturnNs = 600'000'000'000;
  static constexpr std::uint64_t kSilenceNs = 3'000'000'000;  // after which it is lost

  explicit Follower(std::function<std::uint64_t()> clock_ns) : clock_ns_(std::move(clock_ns)) {}

  void begin(UpstreamEvents events);
  // Nothing more is told. False: it was over before.
  bool finish();
  // Does likewise, and says so.
  void end(wire::EndReason reason, const std::string& text);
  // Ends what is under way.
  virtual void cut() = 0;
  // False: that has ended it.
  bool take_welcome(const proto::Welcome& welcome);
  Status hand_on(const proto::Envelope& message, const wire::SharedBytes& framed);
  // False: it was not welcome.
  bool lose(const std::string& why);

  bool is_over() const { return is_over_; }
  bool was_welcome() const { return was_welcome_; }
  bool is_too_late() const { return !is_welcome_ && now_ns() >= deadline_ns_; }
  std::uint64_t now_ns() const { return clock_ns_(); }

 private:
  const std::function<std::uint64_t()> clock_ns_;
  UpstreamEvents events_;
  bool is_welcome_ = false, was_welcome_ = false, is_over_ = false;
  std::uint64_t returns_ = 0, deadline_ns_ = 0;
};

}  // namespace trocar::follow

#pragma once

// How fast time goes: slower, or not at all, as an instructor wants it. Pace decides when a tick
// comes, never what it does.

#include "server/session/participants/held_tools.h"
#include "server/session/replication/audience.h"

namespace trocar::replication {

class Pace {
 public:
  Pace(SessionContext& session, participants::HeldTools& held) : session_(session), held_(held) {}

  bool is_paused() const { return is_paused_; }
  bool is_usual() const { return !is_paused_ && rate_ == 1; }
  // Each returns why it cannot be done, or nothing.
  std::string slow(float rate, const std::string& by);
  std::string pause(bool pauses, const std::string& by);
  // Goes on as at first.
  void reset();
  // Tells a newcomer; false: there is no room for it.
  bool show(const Speaker& newcomer) const;

 private:
  // Holds all tools, or lets them go on unless an instructor holds them; tells everybody.
  void tell(const std::string& by);
  wire::SharedBytes message() const;

  SessionContext& session_;
  participants::HeldTools& held_;
  float rate_ = 1;  // of time, before it was paused
  bool is_paused_ = false;
  std::string by_;
};

}  // namespace trocar::replication

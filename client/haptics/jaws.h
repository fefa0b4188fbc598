#pragma once

// The jaws of a tool between the server's answers: those that open let go of the force at once,
// though the server says for a while that they hold. O(1); one thread.

#include <algorithm>
#include <cstdint>

#include "common/tool/tool.h"

namespace trocar::haptics {

class Jaws {
 public:
  // In each step; grips: by what the server says.
  void step(tool::Verb verb, std::uint64_t time_us, bool grips, double dt_s) {
    if (verb == tool::Verb::Grasp && verb_ != tool::Verb::Grasp) closed_us_ = time_us;
    if (grips && verb_ == tool::Verb::Grasp && verb != tool::Verb::Grasp) is_let_go_ = true;
    verb_ = verb;
    held_share_ = is_let_go_ ? std::max(0.0, held_share_ - dt_s / kOpening_s) : 1;
  }
  // Takes an answer to the pose of that time.
  void take(bool grips, std::uint64_t echo_time_us) {
    if (!grips || (verb_ == tool::Verb::Grasp && echo_time_us > closed_us_)) is_let_go_ = false;
  }
  // Returns the share of the force that is left, 0 to 1.
  double held_share() const { return held_share_; }

 private:
  static constexpr double kOpening_s = 0.020;  // in which the force goes

  bool is_let_go_ = false;  // the jaws opened, the server does not know yet
  std::uint64_t closed_us_ = 0;
  double held_share_ = 1;
  tool::Verb verb_ = tool::Verb::None;
};

}  // namespace trocar::haptics

#pragma once

// Says where a simulated hand wants to be at each moment, from one line of parameters or a file.
//
//   still                  stays at the origin
//   press,5mm,2s           goes in, holds, comes out and waits a second, again and again
//   palpate,1Hz,3mm,6mm    swings 3 mm to both sides of 6 mm; without the last, of 3 mm
//   tap,2Hz,10mm           goes in and out in at most 0.12 s, each period once
//   path=FILE              key frames: "seconds x y z [gripper]" a line, x y z in mm, # a comment
//
// Parameters may follow in any order, except the two lengths of palpate. Besides: -y (or +x, ...)
// the direction that is in, -z if nothing is said: away from the person; and grip: the gripper is
// closed. Immutable; any thread may ask.

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::device {

class HandScript {
 public:
  struct Key {
    double seconds = 0;
    Vec3d position_m;
    float gripper = 0;
  };

  static Result<HandScript> parse(std::string_view parameters);
  // `source` names the text in errors.
  static Result<HandScript> parse_keys(std::string_view text, const std::string& source);

  // Seconds since the hand began, from 0.
  Vec3d position_m(double seconds) const;
  float gripper(double seconds) const;
  // Whether it goes in by a depth, and in which direction.
  bool has_depth() const { return kind_ != Kind::Still && kind_ != Kind::Path; }
  const Vec3d& inwards() const { return inwards_; }

 private:
  enum class Kind { Still, Press, Palpate, Tap, Path };

  Kind kind_ = Kind::Still;
  double depth_m_ = 0.005, mean_m_ = 0, hold_s_ = 2, rate_hz_ = 1;
  Vec3d inwards_{0, 0, -1};
  float gripper_ = 0;
  std::vector<Key> keys_;  // of a path, by time; never empty there

  Status set(std::string_view parameter, int& lengths);
  double depth_m(double seconds) const;
  // The key at or before `seconds`, and the share of the way to the next one.
  std::size_t key_before(double seconds, double& share) const;
};

}  // namespace trocar::device

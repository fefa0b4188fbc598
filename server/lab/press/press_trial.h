#pragma once

// A trial press: a round tip goes into an organ along the normal of its surface, tick by tick as in
// a session, and the organ is as it was afterwards, to the bit. One thread at a time.

#include <span>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/tick.h"
#include "common/math/frame.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/step/simulation.h"

namespace trocar::press {

inline constexpr double kTipSpeed_m_s = 0.04;  // as a hand presses
inline constexpr double kMostDepth_m = 0.1;
inline constexpr std::size_t kMostReadings = 4096;  // older ones are forgotten

// Read once per published frame.
struct Reading {
  double seconds = 0;  // since the press began
  double force_n = 0;  // of the tissue on the tip
  double depth_m = 0;  // how far the tip is below where the surface was at rest; not below 0
};

class PressTrial {
 public:
  // `radius_m` of the tip, as tool::ToolShape allows it. Costs as much as beginning a session.
  PressTrial(const organ::Organ& organ, double radius_m);

  // The tip stands above this place of the surface, m, whose outward normal has the length 1.
  void begin(const Vec3f& place, const Vec3f& outward);
  // Simulates one tick in which the tip moves towards `depth_m` below the place. Only while it is
  // pressed.
  void tick(double depth_m);
  // Takes the tip away; the organ is as it was.
  void end();

  bool is_pressed() const { return is_pressed_; }
  const std::vector<Reading>& readings() const { return readings_; }  // of this press, or the last
  // The tip as the tissue lets it be, the force of the tissue on it, N, and the displacement of
  // each node from rest, m.
  const Pose& world_from_tip() const { return tip_; }
  const Vec3f& force_n() const { return force_n_; }
  std::span<const Vec3f> displacements() const { return simulation_.state().world.displacements; }
  std::uint64_t state_hash() const { return simulation_.state_hash(); }
  double radius_m() const { return radius_m_; }

 private:
  void read(const step::PublishedFrame& frame);

  step::Simulation simulation_;
  step::TickDecisions decisions_;
  Bytes rest_;
  double radius_m_;
  bool is_pressed_ = false, has_joined_ = false;
  Vec3f place_, outward_{0, 1, 0};
  double way_m_ = 0;  // of the tip, below the place; negative above it
  Tick ticks_ = 0;    // of this press
  Pose tip_;
  Vec3f force_n_;
  std::vector<Reading> readings_;
};

}  // namespace trocar::press

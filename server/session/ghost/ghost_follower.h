#pragma once

// The full solution beside a session whose tissue a reduction moves: the session's own ticks, frame
// by frame, with the same inputs, but by the full solver, with decisions of its own but for the
// depth that forces need: it need not keep the tick's time.
//
// It begins from a snapshot of the session and follows until the surface changes: cuts of two
// solutions need not be the same, and then no vertex of one is a vertex of the other. After a cut,
// or a return to a mark, it begins again.

#include <optional>

#include "common/wire/ghost_status.h"
#include "server/tissue/step/simulation.h"

namespace trocar::ghost {

using wire::GhostStatus;

struct GhostReport {
  GhostStatus status = GhostStatus::Begins;
  Frame frame = 0;  // the rest is of it; only while it follows
  Tick tick = 0;
  std::uint32_t epoch = 0;
  wire::QuantisedSurface offsets;  // from where the session has its vertices to where they are here
  float largest_m = 0;             // of them
  float root_mean_square_m = 0;
  Tick behind_ticks = 0;  // the session's newest frame is later by so much
};

class GhostFollower {
 public:
  // Shares what does not change with `session`, whatever thread that is used by.
  GhostFollower(const step::Simulation& session, const step::TickDecisions& decisions);

  // Frames of the session one after another; afterwards status() says what became of it.
  void repeat(const step::PublishedFrame& frame);
  // Frames were left out.
  void lose() { drop(GhostStatus::Behind); }
  // Status Follows: how it is beside the session.
  GhostReport compare(const step::PublishedFrame& frame) const;

  GhostStatus status() const { return status_; }
  // A snapshot in one of the next frames is needed. Not yet just after a change: others follow it,
  // and while tissue is cut the session has the full solver itself.
  bool wants_snapshot() const { return status_ != GhostStatus::Follows && quiet_frames_ >= kQuiet; }
  const step::Simulation& simulation() const { return simulation_; }

 private:
  static constexpr Frame kQuiet = 25;  // 0.4 s

  void drop(GhostStatus status);
  bool begin(const step::PublishedFrame& frame);
  bool run(const step::PublishedFrame& frame);

  step::Simulation simulation_;
  step::TickDecisions decisions_;
  std::shared_ptr<const step::PublishedFrame> own_;  // of the last frame followed
  GhostStatus status_ = GhostStatus::Begins;
  Frame quiet_frames_ = kQuiet;  // since the surface changed
};

}  // namespace trocar::ghost

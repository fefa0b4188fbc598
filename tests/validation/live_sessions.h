#pragma once

// Sessions of one tool on a liver with a local reduction, for experiments that put the reduced
// solver beside the full one: scripts of the tool, what each tick had, and how far one session is
// from another with the same script.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/lab/calibration/converged.h"
#include "server/lab/reduce/local_build.h"
#include "server/organs/organ/local_reduction.h"
#include "server/tissue/step/simulation.h"
#include "tests/validation/references.h"
#include "tests/validation/report.h"

namespace trocar::validation {

struct LiveReduction {
  std::shared_ptr<const organ::LocalReduction> local;
  std::vector<NodeIndex> pressed;  // in the training
  double seconds = 0;              // wall time that it took
  std::size_t bytes = 0;           // of its file
};
LiveReduction make_live_reduction(const std::string& name, const organ::Organ& organ,
                                  const reduce::LocalSettings& settings);

// A place among a reduction's patches.
struct LivePlace {
  NodeIndex node;
  std::uint32_t patch = 0;  // whose member it is
  bool is_trained = false;  // pressed in the training; else at least 8 mm from all that were
  Vec3f position, outward;  // m; unit
  Vec3f inward;             // unit, along the surface to the middle of all patches
};
// Spread over the patches; fewer if there are no more.
std::vector<LivePlace> live_places(const organ::Organ& organ, const LiveReduction& reduction,
                                   std::size_t trained, std::size_t unseen);
// The centre of a patch and members of it that are spread around it.
std::vector<LivePlace> places_of_patch(const organ::Organ& organ, const LiveReduction& reduction,
                                       std::uint32_t patch, std::size_t count);

// A tip comes down on a place from above, stays, slides along the surface, and lifts.
struct Stroke {
  LivePlace place;
  Vec3f aside;  // unit, across place.outward: where it slants and slides to
  float radius_m = 0.008f, above_m = 0.002f;
  float depth_m = 0.008f, speed_m_s = 0.04f;
  float slant = 0;  // moved aside per way down
  float slide_m = 0;
  Tick hold_ticks = 250, slide_ticks = 0, free_ticks = 0;  // free: after it has lifted

  Tick down_ticks() const;
  Tick lift_ticks() const;  // 0 if it stays
  Tick ticks() const { return down_ticks() + hold_ticks + slide_ticks + lift_ticks() + free_ticks; }
  // Returns the inputs of the first hand; it joins in tick 1.
  hands::TickInputs at(Tick tick) const;
};

// Displacements of all nodes, m.
using LiveField = std::vector<Vec3f>;

struct LiveTick {
  Vec3d force_n;  // of the tissue on the first hand's tool
  double us = 0;  // CPU time
  bool is_reduced = false;
  wire::SolverFigures figures;  // of sessions with a reduction
  float estimate = 0;           // of the reduction's error, after this tick
};
struct Course {
  std::vector<LiveTick> ticks;
  Tick field_ticks = 1;                  // from one field to the next
  std::vector<LiveField> fields;         // fields[i] is after ticks[(i + 1) * field_ticks - 1]
  Tick lost = 0;                         // the first in which nodes had to be put back; 0: none
  calibration::Convergence convergence;  // of ticks that are solved to a tolerance
  calibration::Pilot pilot;              // of a session that ran as one

  double largest_force_n() const;
};

// A script says what a session does in each tick, numbered from 1.
struct Script {
  Tick ticks = 0;
  std::function<hands::TickInputs(Tick)> inputs;
  std::function<step::TickDecisions(Tick)> decisions;  // none: as sessions run by default
};
Script script_of(const Stroke& stroke);

// reduction: null for a session without one. field_ticks 0: no fields are kept.
Course run_session(const organ::Organ& organ,
                   const std::shared_ptr<const organ::LocalReduction>& reduction,
                   const Script& script, Tick field_ticks);

// A place with less is none that the tip can come to from above.
inline constexpr double kLeastForce_n = 0.05;

// The converged sessions of an experiment and what they are worth.
class References {
 public:
  // The same script without a reduction, solved to a tolerance that a pilot finds. One more run
  // with a looser tolerance tells its own error. Neither counts if the force stays below
  // kLeastForce_n.
  Course run(const organ::Organ& organ, Script script, Tick field_ticks);

  // Adds the two checks of check_reference().
  void check(Section& section, const std::string& name, Bound own_error) const;

 private:
  calibration::Convergence convergence_;
  double own_error_ = 0;  // the largest of all sessions
  std::size_t count_ = 0;
};

// Errors beside a converged session with the same script, in ticks in which the reference's force
// is at least least_n. A session that was lost errs without bound from there on.
double force_error(const Course& course, const Course& reference, std::size_t tick);
// Over all nodes; of field number `field`.
double field_error(const Course& course, const Course& reference, std::size_t field);

// The values may be infinite; both functions return NaN without values.
double quantile(std::vector<double> values, double share);
double mean(const std::vector<double>& values);
// "mean (95th percentile, worst)", in per cent.
std::string shown_errors(const std::vector<double>& errors);

}  // namespace trocar::validation

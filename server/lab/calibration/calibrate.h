#pragma once

// Force to depth (Choi 2002 sec. 3): measures an organ's organ::DepthTable. At places spread over
// the surface a round tip, its radius over three elements, presses until the deepest; the force of
// each limit of nodes (Frozen) and each depth (Graded) is compared with that of the full solution,
// tick by tick, in ranges of force that double. A limit is what all places but none needs: the
// largest over them. Deterministic for an organ and its settings.

#include <functional>
#include <optional>
#include <string>

#include "server/lab/calibration/converged.h"
#include "server/lab/calibration/press.h"
#include "server/organs/organ/depth_table.h"

namespace trocar::calibration {

struct Settings {
  double error = 0.03;  // asked of the contact force: mean difference over mean force in a range
  // The reference itself may err by this share of `error` in each range.
  double reference_error = 0.1;
  std::size_t places = 16;
  std::uint64_t seed = 1;
  std::optional<double> radius_m;  // nothing: 3.2 edges of the surface, as far as a tool may
  double depth_m = 0.012;          // of the deepest press
  double first_n = 0.125;          // upper end of the first range
  std::uint32_t first_nodes = 128;
  unsigned workers = 1;
};
Status validate(const Settings& settings);
// Error (BadFile): nothing holds the organ, so a press moves all of it.
Status check_held(const organ::Organ& organ);
double radius_of(const organ::Organ& organ, const Settings& settings);

// A finding is of one place and one range of force; it is for people.
struct Finding {
  std::size_t place = 0;
  NodeIndex node;
  double force_n = 0;  // upper end of the range
  struct Tried {
    std::uint32_t limit = 0;  // nodes or layers
    std::uint32_t nodes = 0;  // in the queue, mean over the range
    double error = 0;
  };
  std::vector<Tried> frozen, graded;
};

// All errors are against this: at each place the press in which every tick is solved to a
// tolerance.
struct Reference {
  Convergence convergence;
  // A tolerance kLooser times larger changes the force by this, measured as errors of limits are:
  // the largest over places and ranges.
  double own_error = 0;
  double allowed_error = 0;
  std::size_t places_missed = 0;  // Left out, because some tick did not reach its tolerance.

  bool is_converged() const {
    return convergence.is_reached() && places_missed == 0 && own_error <= allowed_error;
  }
};

struct Calibration {
  organ::DepthTable table;
  std::vector<Finding> findings;
  std::size_t places_left_out = 0;  // where the tip could not press, or the reference missed
  std::uint64_t ticks = 0;          // simulated, all presses together
  Reference reference;
};

// done and all: places. Called after each.
using Progress = std::function<void(std::size_t done, std::size_t all)>;
Calibration calibrate(const organ::Organ& organ, const Settings& settings,
                      const Progress& progress = {});

// The table at work, at other places, at half the speed and aslant: errors of the contact force per
// range, of what control::DepthChooser decides from the forces it meets. Where the table knows no
// limit, frozen is as decided without it and not counted.
struct Check {
  double force_n = 0;  // upper end of the range
  std::size_t places = 0, frozen_places = 0;
  double frozen_mean = 0, frozen_largest = 0;  // over places
  double graded_mean = 0, graded_largest = 0;
  double frozen_nodes = 0, graded_nodes = 0;  // in the queue, mean
};
struct Checks {
  std::vector<Check> ranges;
  Reference reference;
};
Checks check(const organ::Organ& organ, const organ::DepthTable& table, const Settings& settings,
             std::size_t places, const Progress& progress = {});

std::string to_csv(const Calibration& calibration);

}  // namespace trocar::calibration

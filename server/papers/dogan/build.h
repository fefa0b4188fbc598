#pragma once

// Makes a reduced model as Dogan 2011 does. Off-line: presses at places spread over the accessible
// surface, in several directions and of growing force, are solved by the full model; their
// displacements are the snapshots (eq. 9), their Karhunen-Loeve modes the basis (eq. 6 to 11). The
// tangent among the modes is taken at rest and at states of the training; of those the one whose
// solution errs least over the training is kept beside the first. For creep, nodes spread over the
// surface are pressed by the largest force for 20 s; the growth of their displacements, and of
// their neighbours within a radius of influence, is kept.
//
// Time: presses x magnitudes + creep nodes x kCreepTimes full solutions, no more. Deterministic for
// an organ and its settings.

#include <functional>

#include "server/papers/dogan/full_model.h"
#include "server/papers/reduction/reduction.h"

namespace trocar::dogan {

using reduction::CreepCurve;
using reduction::Reduction;

struct Settings {
  std::size_t modes = 8;        // 1 to 64
  std::size_t places = 40;      // of the surface
  std::size_t directions = 3;   // at each place
  std::size_t magnitudes = 3;   // of each direction: equal parts of the force
  double force_n = 0.4;         // the largest
  double radius_m = 0.015;      // of the patch that is pressed; 0: single nodes
  std::size_t tangents = 60;    // of snapshots that are tried
  std::size_t creep_nodes = 8;  // 0: without creep
  double creep_s = 20;
  double influence_m = 0.045;  // radius around a creep node
  std::uint64_t seed = 1;
  unsigned threads = 1;
};
// Error names the setting as trocar-organ calls it.
Status validate(const Settings& settings);

// Full solutions, off-line.
enum class Stage { Snapshots, Tangents, Creep, Check };
// done and all: presses, tangents or creep nodes. Called after each.
using Progress = std::function<void(Stage stage, std::size_t done, std::size_t all)>;

// One training solution.
struct Snapshot {
  Press press;
  Vector displacements;  // 3 per node, m
};
struct Training {
  std::vector<Snapshot> snapshots;
  std::vector<NodeIndex> places;
  std::size_t failed = 0;  // loads that no equilibrium was found for, left out
};
Training train(FullModel& model, const Settings& settings, const Progress& progress = {});

// How good a tangent is on the training: mean of |u - B xi| / |u|.
struct Tried {
  std::size_t snapshot = 0;  // at whose state
  double error = 0;
};
struct Built {
  Reduction reduction;
  KarhunenLoeve karhunen_loeve;
  double initial_error = 0, best_error = 0;
  std::optional<Press> best_at;  // none: the tissue at rest
  std::vector<Tried> tried;
  std::size_t indefinite = 0;  // tangents that were refused, their tissue would buckle
};
// Error: the training has no snapshot, or none that moves.
Result<Built> reduce(FullModel& model, const Training& training, const Settings& settings,
                     const Progress& progress = {});
// Adds curves of creep; nodes without an equilibrium at all times are left out.
void add_creep(FullModel& model, const Settings& settings, Reduction& reduction,
               const Progress& progress = {});

// Returns the times of the stored curves: they are denser at first, when tissue is fast.
std::vector<double> creep_times(double seconds);

}  // namespace trocar::dogan

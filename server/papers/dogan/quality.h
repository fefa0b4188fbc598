#pragma once

// How far a reduced model is from the full one on loads that it was not made of: at nodes as far as
// can be from those of the training, aslant at other angles, and of other forces.
//
// L2 error of a displacement field u': |u - u'| / |u| over all nodes; of the contact the same of
// the loaded node alone, which is the paper's 5.28 mm against 4.5 mm.

#include "server/papers/dogan/build.h"
#include "server/papers/dogan/errors.h"
#include "server/papers/dogan/reduced_model.h"

namespace trocar::dogan {

// An unseen load and its full solution.
struct Unseen {
  Press press;
  Vector displacements;
};
struct UnseenLoads {
  std::vector<Unseen> loads;
  std::size_t failed = 0;
};
// Two forces at each of `places` nodes: 0.3 and 0.85 of the largest of the training.
UnseenLoads solve_unseen(FullModel& model, const Training& training, const Settings& settings,
                         std::size_t places, const Progress& progress = {});

struct Quality {
  std::size_t modes = 0;
  Errors projection;  // L2, the best that the modes can show
  struct OfTangent {
    std::vector<double> field_errors, contact_errors;  // per load
    Errors field, contact;
    double contact_ratio = 0;  // mean of the contact's reduced over its full displacement
  } initial, best;
};
// Measures the first `modes` modes; 0 stands for all.
Quality quality_of(const Reduction& reduction, const organ::Organ& organ,
                   std::span<const Unseen> loads, std::size_t modes = 0);

// Creep of an unseen load, at the stored times, beside the full model's.
struct CreepCheck {
  Press press;
  std::vector<double> times_s, full_m, reduced_m;  // of the loaded node
  std::vector<double> field_errors;                // L2, of the reduced model with its best tangent
  std::vector<double> scaling_errors;              // L2, of the full one at once, scaled
};
// Nothing if the full model finds no equilibrium at some time.
std::optional<CreepCheck> check_creep(FullModel& model, const Reduction& reduction,
                                      const Press& press);

}  // namespace trocar::dogan

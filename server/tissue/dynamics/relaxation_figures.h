#pragma once

namespace trocar::dynamics {

// These figures sum up all tissue that relaxes, for people; each tet as it was last advanced.
struct RelaxationFigures {
  double energy_j = 0;       // elastic, as if nothing had relaxed
  double volume_change = 0;  // of the whole, over its volume without stress
  // This is the relaxed part of the instantaneous stress. It is over 1 where tissue remembers more
  // stress than it has, as when it has just been let go.
  double relaxed_share = 0;
};

}  // namespace trocar::dynamics

#pragma once

namespace trocar::dynamics {

// Of all tissue that relaxes, for people: each tet as it was when it was last advanced.
struct RelaxationFigures {
  double energy_j = 0;       // elastic, as if nothing had relaxed
  double volume_change = 0;  // of the whole, over its volume without stress
  // Of the stress that there would be at once; over 1 where tissue remembers more stress than it
  // has, as when it has just been let go.
  double relaxed_share = 0;
};

}  // namespace trocar::dynamics

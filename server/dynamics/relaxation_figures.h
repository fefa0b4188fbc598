#pragma once

namespace trocar::dynamics {

// Of all tissue that relaxes, for people: each tet as it was when it was last advanced.
struct RelaxationFigures {
  double energy_j = 0;       // elastic, as if nothing had relaxed
  double volume_change = 0;  // of the whole, over its volume without stress
  double relaxed_share = 0;  // of the stress that there would be at once, 0 to 1
};

}  // namespace trocar::dynamics

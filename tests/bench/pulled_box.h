#pragma once

// The load case in which solvers are compared: a box of tets, clamped at its low x face, pulled at
// its high x face along x by a constant total force from rest at t = 0.
//
// Node order: slabs of constant x, z fastest. Cells are split into five tets in alternating
// orientation, or into six around one diagonal. The force is spread with consistent weights (a
// third of the area of each face triangle to each of its nodes). Units SI. Immutable once made.

#include <array>
#include <string>
#include <vector>

#include "server/organs/organ/organ.h"

namespace trocar::bench {

enum class CellSplit { Five, Six };

struct BoxShape {
  std::string name;
  std::array<int, 3> cells{1, 1, 1};
  std::array<double, 3> size_m{0.01, 0.01, 0.01};
  CellSplit split = CellSplit::Five;
};

// E, nu and density of every comparison, and the damping of each node in proportion to its mass.
struct PulledMaterial {
  double young_modulus_pa = 10e3;
  double poisson_ratio = 0.4;
  double density_kg_m3 = 1000;
  double node_damping_per_s = 20;
  double nominal_strain = 0.05;  // total force = strain x E x area

  double lame_mu_pa() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }
  double lame_lambda_pa() const {
    return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  }
};

struct PulledBox {
  organ::Organ organ;  // springs: VolumeConsistent at the material's E, no damping along them
  PulledMaterial material;
  std::vector<NodeIndex> loaded_nodes;  // the high x face, ascending
  std::vector<Vec3f> forces_n;          // per node of the organ
  double total_force_n = 0;

  // Mean displacement along x of the loaded face, m; `displacement(node)` in m.
  template <typename F>
  double face_displacement(F&& displacement) const {
    double sum = 0;
    for (const auto node : loaded_nodes) sum += displacement(node);
    return sum / static_cast<double>(loaded_nodes.size());
  }
};

PulledBox make_pulled_box(const BoxShape& shape, const PulledMaterial& material = {});

// The built-in liver with the same kind of load: nodes within 20 mm of the one farthest along x are
// pulled along x by 0.4 N in all, each alike.
PulledBox make_pulled_liver(int target_tets);

// The three boxes on which other solvers were measured: a plate, a liver's and a chest wall's size.
BoxShape plate_box();
BoxShape liver_box();
BoxShape chest_box();
// About `tets` tets in a 2 x 1 x 1 box, 10 mm cells.
BoxShape growing_box(int tets);

}  // namespace trocar::bench

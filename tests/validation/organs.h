#pragma once

// Organs that only experiments need, and what their springs are as a continuum.

#include <vector>

#include "common/base/result.h"
#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::validation {

// Choi's lattice with springs along the diagonals of the cells' faces too, as stiff as the others:
// without them it has no shear stiffness; with them lambda = mu = k / spacing.
organ::Organ lattice_with_diagonals(const catalogue::LatticeSize& size);

// Box of cells between the given coordinates (m, increasing) along each axis; five tets per cell,
// mirrored from cell to cell. Volume-consistent springs of E = 4 kPa unless a scenario says
// otherwise; the lowest layer in y is fixed. The rest bounding box is centred on the origin.
organ::Organ tet_box(const std::vector<double>& x, const std::vector<double>& y,
                     const std::vector<double>& z);
// `cells` equal cells over a length.
std::vector<double> even(double length, int cells);

// Elastic constants of an organ's springs as a continuum with the symmetry of a cube along the
// axes: averages of k l^2 n_i n_j n_k n_l over its volume, Pa.
struct CubicConstants {
  double c11 = 0, c12 = 0, c44 = 0;

  double young_modulus() const { return c11 - 2 * c12 * c12 / (c11 + c12); }  // along an axis
  double poisson_ratio() const { return c12 / (c11 + c12); }
};
CubicConstants constants_of(const organ::Organ& organ);

}  // namespace trocar::validation

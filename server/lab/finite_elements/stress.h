#pragma once

// Second Piola-Kirchhoff stress of a hyperelastic material and its derivative by Green's strain, in
// two parts: the one that relaxes and the volumetric one
// (server/organs/material/hyperelastic_material.h).
//
// Six components are in the order xx, yy, zz, xy, yz, zx; shear strains are doubled (engineering),
// stresses are not. Pa. Double precision; any thread.

#include <Eigen/Core>
#include <optional>

#include "server/organs/material/hyperelastic_material.h"

namespace trocar::finite_elements {

using Matrix3 = Eigen::Matrix3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

struct StressPart {
  Vector6 stress;
  Matrix6 tangent;    // dS/dE, symmetric
  double energy = 0;  // J/m^3 at rest
};
struct Stress {
  StressPart relaxing, volumetric;
};

// Returns the stress of the instantaneous response to the deformation gradient. It is nothing where
// the volume ratio det F is not above 1e-4: turned inside out, or about to be.
std::optional<Stress> stress_of(const material::HyperelasticMaterial& material, const Matrix3& f);

Matrix3 to_matrix(const Vector6& stress);

}  // namespace trocar::finite_elements

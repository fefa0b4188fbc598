#pragma once

// Blocks of elements with what holds and loads them, for tests of the off-line solver.

#include <functional>
#include <map>
#include <vector>

#include "server/lab/finite_elements/solver.h"
#include "server/lab/finite_elements/surface_traction.h"
#include "server/lab/scenario/scenario_block.h"

namespace trocar::finite_elements::testing {

using material::HyperelasticMaterial;

const HyperelasticMaterial& liver();
HyperelasticMaterial liver_without_relaxation();
// Linear response of Young's modulus E and Poisson's ratio nu at small strains.
HyperelasticMaterial neo_hookean(double young_pa, double poisson);

using Shape = std::function<Vec3d(const Vec3d&)>;
using Where = std::function<bool(const Vec3d&)>;

// A block whose lowest corner is the origin before `shape` moves its nodes (straight edges stay).
class Specimen {
 public:
  Specimen(const std::array<int, 3>& cells, double spacing_m, ElementOrder order,
           const HyperelasticMaterial& material, const Shape& shape = {});

  // Holds nodes along an axis and moves them by a function of their place at rest.
  void hold(
      const Where& where, int axis,
      const std::function<double(const Vec3d&)>& move = [](const Vec3d&) { return 0.0; });
  void hold_all_axes(const Where& where);
  // An even traction, Pa, on the faces whose corners are all there.
  void pull(const Where& where, const Vec3d& traction_pa);

  ElementMesh& elements() { return problem_.mesh; }
  const mesh::TetMesh& mesh() const { return mesh_; }
  Problem problem() const;
  // All loads, of held moves and tractions the given share.
  Loads loads(double share = 1) const;

 private:
  mesh::TetMesh mesh_;
  Problem problem_;
  std::map<std::uint32_t, double> held_;
  Vector forces_;
};

Where plane(int axis, double at_m);
double component(const Vec3d& v, int axis);
// Force along an axis on the nodes there, N.
double reaction(const Solver& solver, const Where& where, int axis);
Vec3d mean_displacement(const Solver& solver, const Where& where);

}  // namespace trocar::finite_elements::testing

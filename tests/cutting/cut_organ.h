#pragma once

// Organs to cut, blades to cut them with, and what must hold after every cut.

#include <memory>

#include "server/cutting/cutter.h"
#include "server/cutting/validate.h"
#include "tests/support/random.h"

namespace trocar::cutting::testing {

// Cells of five tets each, mirrored in turn; nodes moved by up to `jitter` cells, on the outside
// along it only. Centred on the origin.
scene::Organ box_organ(int nx, int ny, int nz, double cell_m, double jitter = 0.2,
                       std::uint64_t seed = 1);
scene::Organ tet_organ();  // one tet, edges about 0.1 m

double least_dihedral_sine(const dynamics::Topology& topology);
double total_mass(const dynamics::Topology& topology);
// Over everything: places, tets, positions.
std::uint64_t topology_hash(const dynamics::Topology& topology);

// An organ, its cutter, and a copy that repeats every edit.
class CutOrgan {
 public:
  explicit CutOrgan(scene::Organ organ, const Settings& settings = {});

  const dynamics::Topology& topology() const { return topology_; }
  const scene::Organ& organ() const { return *organ_; }
  Cutter& cutter() { return cutter_; }
  // Sums over all calls.
  const CutOutput& total() const { return total_; }

  // One tick; afterwards check() holds.
  void tick(bool is_checked = false);
  void run_until_idle();
  // The blade from one place to another, in steps of at most step_m, then lifted.
  void stroke(std::span<const Vec3d> from, std::span<const Vec3d> to, double step_m);
  // Validity, volume, mass, floor, and the copy's equality; failures name what.
  void check();

  std::vector<Vec3f> displacements;  // none: at rest

 private:
  std::unique_ptr<const scene::Organ> organ_;
  dynamics::Topology topology_, copy_;
  Places copy_places_;
  Cutter cutter_;
  CutOutput output_, total_;
  const double volume_, mass_;
};

}  // namespace trocar::cutting::testing

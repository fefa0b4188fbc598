#pragma once

// Organs to cut, blades to cut them with, and what must hold after every cut.

#include <memory>
#include <string>

#include "server/tissue/cutting/cutter.h"
#include "server/tissue/cutting/validate.h"
#include "tests/support/random.h"

namespace trocar::cutting::testing {

// Cells of five tets each, mirrored in turn; nodes moved by up to `jitter` cells, on the outside
// along it only. Centred on the origin.
organ::Organ box_organ(int nx, int ny, int nz, double cell_m, double jitter = 0.2,
                       std::uint64_t seed = 1);
organ::Organ tet_organ();  // one tet, edges about 0.1 m

double least_dihedral_sine(const topology::Topology& topology);
double total_mass(const topology::Topology& topology);
// Over everything: places, tets, positions.
std::uint64_t topology_hash(const topology::Topology& topology);

// Places of a blade's edge, one per tick.
using Edge = std::vector<Vec3d>;
using Path = std::vector<Edge>;
// In steps of at most step_m.
Path straight_path(const Edge& from, const Edge& to, double step_m);

// An organ, its cutter, and a copy that repeats every edit.
class CutOrgan {
 public:
  explicit CutOrgan(organ::Organ organ, const Settings& settings = {});

  const topology::Topology& topology() const { return topology_; }
  const organ::Organ& organ() const { return *organ_; }
  Cutter& cutter() { return cutter_; }
  // CPU time of the last call of Cutter::cut().
  std::uint64_t last_ns() const { return last_ns_; }
  // Sums over all calls.
  const CutOutput& total() const { return total_; }
  const CutOutput& last() const { return output_; }
  const CutEvents& history() const { return history_; }
  Bytes state();
  // Becomes what the other one is, from its history and its state. It must be fresh itself. Returns
  // what is wrong, or nothing.
  std::string resume(CutOrgan& other);

  void tick();
  void run_until_idle();
  // A blade along a path, a place per tick, then lifted and all its work done.
  void stroke(const Path& path, std::uint32_t blade = 0);
  // Validity, volume, mass, surface, floor (if the method knows one), and the copy's equality: what
  // is wrong, or nothing.
  std::string check() const;

  std::vector<Vec3f> displacements;  // none: at rest
  double travel_m = kUnknownTravel;

 private:
  std::unique_ptr<const organ::Organ> organ_;
  topology::Topology topology_, copy_;
  Places copy_places_;
  Cutter cutter_;
  CutOutput output_, total_;
  CutEvents history_;
  std::string failure_;
  std::uint64_t last_ns_ = 0;
  const bool has_floor_;
  const double volume_, mass_, surface_;
};

}  // namespace trocar::cutting::testing

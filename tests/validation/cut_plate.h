#pragma once

// A plate under tension that is cut once and then left alone: topology, cutter and mechanics
// together, all nodes solved for, those of its two faces held in depth (Nakao 2003 sec. 5.1).
// Mechanics: the live solver, or the paper's own (remodelled_springs.h).

#include <memory>

#include "server/tissue/cutting/cutter.h"
#include "server/tissue/dynamics/block_descent.h"
#include "tests/validation/remodelled_springs.h"

namespace trocar::validation {

struct ElementCounts {
  std::size_t nodes = 0, edges = 0, polygons = 0, tets = 0;  // polygons: of the surface
};

enum class Mechanics { Live, AsPrinted };

class CutPlate {
 public:
  CutPlate(organ::Organ organ, const cutting::Settings& settings, Mechanics mechanics);

  void step(float dt);
  // A blade of this edge goes from one place to another at once.
  void cut(const std::array<Vec3d, 2>& from, const std::array<Vec3d, 2>& to);

  const cutting::CutOutput& output() const { return output_; }  // of cut()
  const topology::Topology& topology() const { return topology_; }
  Vec3d position(NodeIndex node) const;  // now, m
  ElementCounts counts() const;
  // Both return the area of the faces that cuts have opened, on both sides, m^2: as they are now
  // and as they were at rest.
  double wound_area() const;
  double wound_area_at_rest() const;
  // Per tet its smallest dihedral angle, or what is left of pi to its largest if that is less;
  // ascending.
  std::vector<double> dihedrals_rad() const;
  // Returns the elastic energy before and after cut(), J; only springs as printed have it.
  const std::array<double, 2>& energies_j() const { return energies_j_; }
  const RemodelledSprings* springs() const { return springs_.get(); }  // null: live
  // The farthest that two nodes are apart that were one, m.
  double opening() const;
  // Ends of edges of the upper face; of the wound or of the others; m.
  std::vector<std::array<Vec3d, 2>> upper_edges(bool is_of_wound) const;

 private:
  void update();
  void list_nodes();
  void take_positions();
  template <typename Place>
  double wound_area(Place&& place) const;

  std::unique_ptr<const organ::Organ> organ_;
  double half_thickness_ = 0;  // m
  topology::Topology topology_;
  cutting::Cutter cutter_;
  world::World world_;
  dynamics::BlockDescent solver_;
  std::unique_ptr<RemodelledSprings> springs_;  // as printed; null: live
  std::array<double, 2> energies_j_{};
  cutting::CutOutput output_;
  std::vector<NodeIndex> free_;
  std::vector<std::uint8_t> is_held_;  // per node: in depth
  std::vector<dynamics::AxisHold> holds_;
  std::vector<std::array<NodeIndex, 2>> parted_;  // a node and its copy
};

}  // namespace trocar::validation

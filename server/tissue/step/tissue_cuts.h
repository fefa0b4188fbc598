#pragma once

// The organ as it has been cut and torn: topology, blades at work in it, the surface that follows,
// and the list of all edits. That list is the state: who applies it to the organ has the same
// topology, surface and slots again. The tick hash covers a hash of it.
//
// An organ with links, or without tets, cannot be cut: claims to cut it are granted and do nothing.

#include <memory>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/wire/surface_layout.h"
#include "server/tissue/cutting/cutter.h"
#include "server/tissue/cutting/surface_mesh.h"
#include "server/tissue/cutting/tearing.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/step/blades.h"
#include "server/tissue/step/tick_report.h"
#include "server/tissue/world/world.h"

namespace trocar::step {

class TissueCuts {
 public:
  explicit TissueCuts(const organ::Organ& organ);

  bool can_cut() const { return cutter_ != nullptr; }
  const dynamics::Topology& topology() const { return topology_; }
  const wire::SurfaceLayout& layout() const { return layout_; }
  // Of the tissue on a blade, N, world frame.
  Vec3f force_n(ToolSlot tool) const { return blades_[tool].force_n; }

  // What is stretched too far around these nodes tears in the next cut().
  void tear(const world::World& world, std::span<const NodeIndex> nodes);
  bool can_tear() const { return can_cut() && tearing_.is_possible(); }

  // Blades of claims in effect go where their tools are; then what they cross is cut. True if the
  // topology has changed: then follow() is due, then clear_changes().
  // travel_m: a sum over ticks of the farthest that any node has moved.
  bool cut(const hands::ToolTable& tools, const hands::ClaimTable& claims,
           const world::World& world, double travel_m, CutReport& report);
  // Nodes that the last edit made, in order.
  std::span<const cutting::NewNode> new_nodes() const { return new_nodes_; }
  // Brings the world's arrays, the surface and its slots up to date with the topology.
  const world::SurfaceEdit& follow(world::World& world);
  void clear_changes() { topology_.clear_changes(); }

  // All edits, oldest first.
  std::span<const cutting::CutEvents> history() const { return history_; }

  // Takes the place of another state of the same organ: clients know that one's surface. Blades are
  // lifted.
  void follow_on(const TissueCuts& before);

  // After that, once: the surface as it is, which no change leads to; else null.
  std::shared_ptr<const wire::SurfaceLayout> take_new_layout();
  // What has changed since the last call, for clients, or null. Before a frame is published.
  std::shared_ptr<const wire::SurfaceChange> take_change();

  // History, strokes and forces; the world gets the nodes of the edits read, without their state.
  void visit_state(world::StateArchive& archive, world::World& world);

 private:
  bool is_full() const;
  void measure_friction(const hands::ToolTable& tools, const world::World& world, double travel_m);
  void forget_pending();
  void record(cutting::CutEvents events);
  void extend_layout(const world::World& world, const world::SurfaceEdit& edit);
  void name_region(std::uint16_t material);
  void read_history(world::StateArchive& archive, std::uint32_t count, world::World& world);

  dynamics::Topology topology_;
  std::unique_ptr<cutting::Cutter> cutter_;
  cutting::Tearing tearing_;
  cutting::SurfaceMesh surface_;
  wire::SurfaceLayout layout_;
  std::vector<cutting::CutEvents> history_;
  std::uint32_t published_ = 0;  // edits of history_ that clients know
  bool is_new_to_clients_ = false;
  std::uint64_t history_hash_ = 0;
  BladeTable blades_;
  wire::SurfaceChange pending_;
  std::uint32_t first_pending_ = 0;  // number of pending_.added[0]
  // Scratch.
  cutting::CutOutput output_;
  std::vector<cutting::NewNode> new_nodes_;
};

}  // namespace trocar::step

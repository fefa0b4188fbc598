#pragma once

// The organ as it has been cut and torn: topology, blades at work in it, the surface that follows,
// and the list of all edits. That list is the state: who applies it to the organ has the same
// topology, surface and slots again. The tick hash covers a hash of it.
//
// An organ with links, or without tets, cannot be cut: claims to cut it are granted and do nothing.

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/wire/surface_layout.h"
#include "server/tissue/blades/blades.h"
#include "server/tissue/blades/cut_report.h"
#include "server/tissue/cutting/cutter.h"
#include "server/tissue/cutting/tearing.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/topology/surface_mesh.h"
#include "server/tissue/world/world.h"

namespace trocar::blades {

class TissueCuts {
 public:
  explicit TissueCuts(const organ::Organ& organ, const cutting::Settings& settings = {});

  const cutting::Settings& settings() const { return settings_; }
  bool can_cut() const { return cutter_ != nullptr; }
  const topology::Topology& topology() const { return topology_; }
  const wire::SurfaceLayout& layout() const { return layout_; }
  // Returns what the tissue does to a blade.
  const Wrench& felt(ToolSlot tool) const { return blades_[tool].felt; }
  const EdgeForce& edge(ToolSlot tool) const { return blades_[tool].edge; }
  // Returns where the edge of a blade that cuts was after the last tick, and where it is now;
  // nothing for any other tool.
  std::optional<std::array<EdgeEnds, 2>> sweep_of(ToolSlot tool,
                                                  const hands::ToolTable& tools) const;
  // Returns how fast a blade goes through whole tissue, m/s; 0 for one that does not cut.
  float cutting_speed_m_s(ToolSlot tool) const {
    const Blade& blade = blades_[tool];
    return blade.is_at_work && blade.is_cutting ? blade.edge.cutting_speed_m_s() : 0;
  }

  // Looks for tissue around these nodes that is stretched too far; it tears in the next cut().
  void tear(const world::World& world, std::span<const NodeIndex> nodes);
  bool can_tear() const { return can_cut() && tearing_.is_possible(); }

  // Moves blades of claims in effect to where their tools are, then cuts what they cross. Returns
  // an edit if the topology has changed: hand it to all who follow the topology, among them
  // extend_layout(), then call end_edit().
  // travel_m: a sum over ticks of the farthest that any node has moved.
  std::optional<topology::Edit> cut(const BladeTable::Hands& hands, const world::World& world,
                                    double travel_m, CutReport& report);
  void end_edit() { topology_.clear_changes(); }
  // Breaks a tie, whose nodes count as changed until end_edit().
  void break_tie(std::size_t tie);
  // Gives what has come to the surface its slots and numbers. The world has applied the edit.
  void extend_layout(const topology::Edit& edit, const world::World& world);

  // Returns the last tick in which a blade was in tissue or something was cut or torn; 0: there was
  // none.
  Tick last_work() const { return last_work_; }
  // All edits, oldest first.
  std::span<const cutting::CutEvents> history() const { return history_; }

  // Takes the place of another state of the same organ: clients know that one's surface. Blades are
  // lifted.
  void replace(const TissueCuts& before);

  // Returns the whole surface once after replace(), because no change leads to it; otherwise null.
  std::shared_ptr<const wire::SurfaceLayout> pop_new_layout();
  // Returns the surface's changes since the last call, for clients, or null if there are none. Call
  // it before a frame is published.
  std::shared_ptr<const wire::SurfaceChange> pop_change();

  // History, strokes and forces. Each edit that is read goes to hand_out, as those of cut() do.
  using HandOut = std::function<void(const topology::Edit&)>;
  void visit_state(world::StateArchive& archive, const HandOut& hand_out);

 private:
  bool is_full() const;
  void look_at_edges(const hands::ToolTable& tools, const world::World& world, double travel_m);
  void forget_pending();
  void record(cutting::CutEvents events);
  topology::Edit edit();
  void name_region(std::uint16_t material);
  void read_history(world::StateArchive& archive, std::uint32_t count, const HandOut& hand_out);

  const cutting::Settings settings_;
  topology::Topology topology_;
  std::unique_ptr<cutting::Cutter> cutter_;
  cutting::Tearing tearing_;
  topology::SurfaceMesh surface_;
  wire::SurfaceLayout layout_;
  std::vector<cutting::CutEvents> history_;
  std::uint32_t published_ = 0;  // edits of history_ that clients know
  bool is_new_to_clients_ = false;
  std::uint64_t history_hash_ = 0;
  Tick last_work_ = 0;
  BladeTable blades_;
  wire::SurfaceChange pending_;
  std::uint32_t first_pending_ = 0;  // number of pending_.added[0]
  // Scratch.
  cutting::CutOutput output_;
  std::vector<topology::NewNode> new_nodes_;
};

}  // namespace trocar::blades

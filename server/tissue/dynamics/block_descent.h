#pragma once

// Implicit Euler by block descent (vertex block descent, Chen et al. 2024): for each node one
// Newton step on the node's own 3x3 block of the incremental potential
//   sum_i m_i/(2 dt^2) |x_i - u_i - dt v_i|^2 + energies + damping + contacts,
// colour after colour, several sweeps per step, over-relaxed. Over-relaxation is stepped down to 1
// for the rest of the step when a sweep's residual grew against the sweep before.
//
// Two classes of nodes (a graded far field): the near ones get `sweeps`; with far_sweeps > 0
// all other free nodes get that many, with an over-relaxation of their own, the last one together
// with the near nodes' last; there is no residual tolerance then. With far_sweeps = 0 the others
// stand still. Near nodes may come in bands with fewer sweeps each (SweepBand): these take part in
// the last ones. Near nodes that are few in their groups are swept in packs (lane_packs.h).
//
// Results do not depend on the number of workers. Work: sweeps x groups with a swept node x rows;
// no allocation after the first steps. One caller at a time.

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "common/base/index.h"
#include "common/base/workers.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/dynamics/far_plan.h"
#include "server/tissue/dynamics/lane_packs.h"
#include "server/tissue/dynamics/linear_far_field.h"
#include "server/tissue/dynamics/sweep_plan.h"
#include "server/tissue/dynamics/tissue.h"
#include "server/tissue/world/world.h"

namespace trocar::dynamics {

// A run of near nodes, up to `end`, with the sweeps it gets.
struct SweepBand {
  std::size_t end = 0;
  std::uint32_t sweeps = 1;
};
inline constexpr std::size_t kMaxSweepBands = 4;

struct SolveSettings {
  std::uint32_t sweeps = 4;
  float over_relaxation = 1.5f;  // below three sweeps at most 1.3 is used: more overshoots
  float dt = 1e-3f;              // s
  // Sweeping ends before `sweeps` when a sweep's residual is at most this; 0: never.
  float residual_tolerance_n = 0;
  std::uint32_t far_sweeps = 0;
  float far_over_relaxation = 1.3f;
  // Far nodes whose elements an edit has changed get at least so many sweeps.
  std::uint32_t cut_sweeps = 0;
  // Far nodes are swept in every so many steps, one group of eight after another, each then for all
  // the time since; in between they coast. Solve once per world.tick, then.
  std::uint32_t far_interval = 1;
  // Far nodes are linear about a pose of not long ago (LinearFarField), after
  // use_linear_far_field().
  bool has_linear_far_field = false;
  // False: the caller watches the residual over many sweeps. Near an optimum it grows at first.
  bool has_safeguard = true;
  // At most kMaxSweepBands, ends ascending up to the last near node, sweeps from `sweeps` down to 1
  // and not ascending; empty: all near nodes get `sweeps`. No tolerance then.
  std::span<const SweepBand> bands;
};

// A node that is held along some of the world's axes and free along the others.
struct AxisHold {
  NodeIndex node;
  std::uint8_t axes = 0;  // bits: 1 x, 2 y, 4 z
  Vec3f displacement;     // m; of held axes
};

// External loads act on tissue besides tools. The default is no loads.
struct ExternalLoads {
  std::span<const Vec3f> forces;  // N, per node of the organ; empty: none
  // Nodes put where `held_displacements` says at the end of the step, with whatever force that
  // takes (holding_force). None of them is free.
  std::span<const NodeIndex> held;
  std::span<const Vec3f> held_displacements;  // m, per entry of `held`
  // Free nodes, swept near or far, that are free along some axes alone.
  std::span<const AxisHold> axis_holds;
};

struct SolveReport {
  float residual_n = 0;  // root mean square over near nodes, last sweep, before each node's step
  bool is_stepped_down = false;
  std::uint32_t sweeps = 0;           // of near nodes, done
  std::uint64_t node_sweeps = 0;      // nodes stepped, all sweeps together
  std::uint64_t far_node_sweeps = 0;  // far ones of these
  std::uint32_t nodes_rejected = 0;   // their step was not finite in some sweep
  float largest_move_m = 0;           // of a node in this step
  std::uint32_t nodes_restored = 0;   // put back to the start of the step, at rest, for that reason
};

class BlockDescent {
 public:
  BlockDescent(const organ::Organ& organ, const world::World& world, unsigned workers = 1,
               StrainScheme scheme = StrainScheme::Implicit);

  // From the next step on so many of the workers work.
  void use_workers(unsigned count) { workers_.use(count); }

  // Takes displacements, velocities and classes anew: after a restored state, or whenever somebody
  // else than solve() changed them for more than single nodes.
  void read_state(const world::World& world);
  // Displacements and velocities alone, of all nodes: whoever else moved them went on from this
  // solver's state.
  void read_motion(const world::World& world);
  // Motion and classes of some nodes.
  void read_state(const world::World& world, std::span<const NodeIndex> nodes);

  // Makes ready for SolveSettings::has_linear_far_field, from the world as it is.
  void use_linear_far_field(const world::World& world);

  // From now on, until the next call, groups with these nodes have no linear far field: they turn
  // from step to step, which linear forces resist.
  void use_energies(std::span<const NodeIndex> nodes);

  // From now on, until the next call, no relaxed stress acts on these nodes: those of free pieces.
  // The span must stay as it is until then.
  void let_spring(std::span<const NodeIndex> nodes) { springing_ = nodes; }

  // Advances displacements and velocities by one step. near: distinct nodes that are not fixed.
  SolveReport solve(const contact::ContactList& contacts, std::span<const NodeIndex> near,
                    const SolveSettings& settings, world::World& world,
                    const ExternalLoads& loads = {});

  // Returns the force imbalance per entry of `near` in the last sweep, N.
  std::span<const float> residuals_n() const { return residuals_; }

  // Force on a node of the last solve's loads.held or axis_holds that put it where it is, N: what
  // energies, damping, loads and tools leave of its mass times acceleration.
  Vec3f holding_force(const contact::ContactList& contacts, NodeIndex node) const;

  FarPlan far_plan(float dt);
  const Tissue& tissue() const { return tissue_; }

  // Between steps: follows topology.changed(). The world already has its nodes, their masses,
  // classes and displacements; arrays over nodes have an entry for every place of one. The
  // topology must outlive the solver.
  UpdateReport update_topology(const topology::Topology& topology, const world::World& world);
  // After it, once there have been steps: the world's forces of stress that has relaxed, where the
  // topology changed.
  void refresh_relaxed_forces(world::World& world);

 private:
  struct Inertia {
    Lanes inertia;       // m/dt^2 + rate m/dt, N/m
    Vec3Lanes momentum;  // m v/dt and loads, N
  };
  struct Constants {
    Lanes mass;     // kg; 0 for padding
    Lanes damping;  // rate m, kg/s
  };
  // One sweep of the step's schedule.
  struct ScheduledSweep {
    const SweepPlan* plan = nullptr;   // groups and lanes that it steps
    const SweepPlan* packs = nullptr;  // of each colour packs go first; null: none
    std::uint64_t near_nodes = 0;      // of these
    float max_over_relaxation = 1;     // of near nodes
    bool is_near = false;              // counts as a sweep of near nodes, and is judged
  };
  struct PointLinks {
    std::array<Slot, contact::kMaxPointNodes> slots;
    std::array<std::uint32_t, contact::kMaxPointNodes> next;  // of the same slot's links
  };

  // Near nodes of bands 0 to its own.
  struct NearBand {
    SweepPlan nodes;  // all of them
    // How they are swept where there are packs: by groups, and by packs.
    SweepPlan kept, packed;
  };

  void plan_step(std::span<const NodeIndex> near, const SolveSettings& settings, Tick tick,
                 const ExternalLoads& loads);
  void plan_bands(std::span<const NodeIndex> near, std::span<const SweepBand> bands);
  void plan_packs(std::span<const NodeIndex> near, std::span<const SweepBand> bands);
  void plan_last_sweep(const SolveSettings& settings);
  // Returns the band whose nodes are swept when `left` sweeps are left, this one included.
  const NearBand& band_of(std::uint32_t left, std::span<const SweepBand> bands) const;
  const NearBand& last_band(std::span<const SweepBand> bands) const {
    return bands_[std::max<std::size_t>(bands.size(), 1) - 1];
  }
  void schedule_sweeps(const SolveSettings& settings);
  void begin_step(const contact::ContactList& contacts, std::span<const NodeIndex> near,
                  const SolveSettings& settings, world::World& world, const ExternalLoads& loads);
  void execute_schedule(const contact::ContactList& contacts, std::span<const NodeIndex> near,
                        const SolveSettings& settings, SolveReport& report);
  // Returns how far the farthest node has moved, m.
  float write_back(const ExternalLoads& loads, world::World& world);
  float note_residuals(std::span<const NodeIndex> near);
  void resize_arrays();
  // Returns whether the node is neither fixed nor asleep.
  static bool is_swept(NodeIndex node, const world::World& world);
  void link_contacts(const contact::ContactList& contacts);
  void begin_groups(world::World& world, const ExternalLoads& loads,
                    std::span<const SweepBand> bands);
  // Stress that has relaxed, where something relaxes.
  void read_relaxation(const world::World& world);
  void end_relaxation(world::World& world, std::span<const NodeIndex> held);
  void begin_inertia(Group group, std::span<const Vec3f> forces);
  bool coasts(Group group) const { return is_slow(group) && far_swept_.lanes[group] == 0; }
  // A group of far nodes alone goes by far_interval_, others by single steps.
  bool is_slow(Group group) const {
    return far_interval_ > 1 && near_.lanes[group] == 0 && far_.lanes[group] != 0;
  }
  float inverse_dt_of(Group group) const {
    return is_slow(group) ? inverse_dt_ / static_cast<float>(far_interval_) : inverse_dt_;
  }
  [[gnu::always_inline]] inline NodeStep8 inertia_of(Group group, const Vec8& own) const;
  NodeStep8 inertia_at(const SlotLanes& slots, const Vec8& own) const;
  NodeStep8 linearise(Group group, const Vec8& own) const;
  Vec3f displacement_of(const contact::ContactPoint& point, const PointLinks& links) const;
  // Whether a contact acts on one of these lanes.
  bool is_touched(Group group, std::uint8_t lanes) const;
  void add_contacts(const contact::ContactList& contacts, const SlotLanes& slots, NodeStep8& step,
                    Lanes& omega) const;
  void ask_energies(Group group, const Float4* start);
  void hold_axes(Group group, NodeStep8& step) const;
  void restart_nodal_strain();
  void place_held(const ExternalLoads& loads);
  // Over-relaxation of near and of far nodes.
  struct Relaxation {
    float near = 1, far = 1;
  };
  void sweep(const ScheduledSweep& scheduled, const contact::ContactList& contacts,
             Relaxation omega);
  void relax(const SweepPlan& plan, Group group, const contact::ContactList& contacts,
             Relaxation omega);
  void relax_pack(std::uint8_t lanes, Group pack, const contact::ContactList& contacts,
                  float omega);
  // Returns the sum of squared residuals of these lanes in the last sweep, N^2.
  double sum_of_squares(const SweepPlan& plan) const;
  void write_back(const SweepPlan& plan, world::World& world);
  struct Restored {
    std::uint32_t nodes = 0;
    float largest_move_m = 0;  // from where the step had put a node
  };
  Restored restore_rejected(world::World& world);
  Vec3f start_of(Slot slot) const;
  static constexpr std::size_t kGroupsInARow = 16;  // of one worker; less than a microsecond each
  template <typename Task>
  void for_each_group(std::span<const Group> groups, Task&& task) {
    workers_.for_each(groups.size(), kGroupsInARow,
                      [&](std::size_t i, unsigned) { task(groups[i]); });
  }

  const organ::Organ& organ_;
  const topology::Topology* topology_ = nullptr;  // once there was an edit
  Tissue tissue_;
  Workers workers_;
  std::vector<Linearisation::Scratch> scratch_;  // per worker
  Vec3f gravity_;
  NodalStrain* implicit_strain_ = nullptr;  // whose forces follow each move; else null
  bool has_explicit_strain_ = false;        // its forces are taken once per step

  std::vector<Constants> constants_;    // per group
  std::vector<std::uint8_t> free_;      // per group: lanes of nodes that is_swept() names
  std::vector<std::uint8_t> cut_;       // likewise: whose elements an edit has changed
  std::vector<std::uint8_t> is_cut_;    // per node: likewise
  std::vector<Float4> x_;               // per slot: displacements being solved, else the world's
  std::vector<Float4> v_;               // per slot: the world's velocities
  std::vector<Float4> start_;           // per slot: at the start of the step; begun groups
  std::vector<Inertia> inertia_;        // per group; begun groups
  std::vector<Lanes> squares_;          // per group: squared residuals of the last sweep
  std::vector<float> squared_moves_;    // per group: largest of a node in this step, m^2
  std::vector<std::uint8_t> rejected_;  // per group: lanes with a step that was not finite
  std::vector<Group> all_groups_;
  SweepPlan near_, far_, begun_;
  std::vector<ScheduledSweep> schedule_;  // of this step, in order
  std::vector<GroupLanes> relaxed_lanes_;
  SweepPlan relaxed_;    // whose forces of relaxed stress a step takes anew
  SweepPlan far_swept_;  // of far_, in this step; the others coast
  SweepPlan cut_swept_;  // of far_swept_: nodes whose elements an edit has changed
  SweepPlan last_;       // the last sweep: of near_ and far_swept_
  std::unique_ptr<LinearFarField> linear_far_field_;  // null: not used
  bool is_far_linear_ = false;                        // in this step
  std::vector<std::uint8_t> has_energies_;            // per group: see use_energies()
  std::vector<Group> groups_with_energies_;           // of these
  std::span<const NodeIndex> springing_;              // see let_spring()
  std::uint32_t far_interval_ = 1;                    // of this step
  float inverse_dt_ = 0;                              // of this step
  float far_over_relaxation_ = 1;                     // likewise
  std::vector<std::uint32_t> asked_stamp_;            // per group: energies have begun it
  std::vector<Group> due_;                            // to be linearised anew
  std::array<NearBand, kMaxSweepBands> bands_;
  LanePacks packs_;
  bool has_packs_ = false;                  // in this step
  std::vector<Slot> packed_slots_;          // likewise
  std::vector<std::uint32_t> begun_stamp_;  // per group
  std::vector<float> residuals_;
  // Contact points of a node as a linked list in contact order; valid where the stamp is current.
  // A link is kMaxPointNodes x point + corner.
  std::vector<std::uint32_t> first_link_;  // per slot
  std::vector<PointLinks> links_;          // per contact point
  // Groups with a node of a point that another node of their colour is in, too: one worker sweeps
  // them, after the others of the colour.
  std::vector<std::uint32_t> serial_stamp_;
  bool has_serial_ = false;
  std::vector<std::uint32_t> slot_stamp_, group_stamp_;
  std::vector<std::uint8_t> held_axes_;  // per slot, of this step; empty if there are none
  std::uint32_t current_ = 0;
};

}  // namespace trocar::dynamics

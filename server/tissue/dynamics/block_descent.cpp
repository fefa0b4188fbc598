// Why vertex block descent, and how a step goes.
//
// A step of implicit Euler is the minimum of the incremental potential (Chen 2024, sec. 3)
//   G(x) = sum_i m_i/(2 dt^2) |x_i - y_i|^2 + W(x),   y_i = x_i(t) + dt v_i(t) + dt^2 g,
// with W the energies of tissue, damping and contacts. A Newton step on all nodes at once needs a
// sparse factorisation that every cut and every new contact makes stale. A Newton step on one node,
//   (m_i/dt^2 I + d2W/dx_i^2) dx_i = -dG/dx_i,
// needs a 3 x 3 system. Its block is positive definite for every energy here whatever the
// deformation (psi.h), so each full step lowers the quadratic model of G, whatever the order. So a
// tick may stop after a fixed number of sweeps: what is left is an error of the step, not an
// instability. This is Gauss-Seidel on the nodes' blocks; nodes of one colour share no element and
// are stepped together, so the result does not depend on the number of workers.
//
// A sweep carries a force across one layer of elements and leaves long waves nearly as they were.
// Three things make few sweeps enough. The step starts from x + dt v (begin_inertia()), which is
// exact for rigid motion. Steps are over-relaxed by omega, which shortens the tail of smooth errors
// as in successive over-relaxation (Young 1954); where the residual of a sweep has grown against
// the one before, the rest of the step goes on with omega = 1, because over-relaxation of the
// nonlinear problem has no guarantee. Nodes near a tool get more sweeps than the far field, where a
// few suffice (FarPlan says how many, and with which omega).
//
// The far field is moved in one of three ways: not at all, by sweeps over its energies, or by
// sweeps over linear forces (linear_far_field.h). A schedule made before the first sweep
// (block_descent_schedule.cpp) says what each sweep goes over; execute_schedule() knows no modes.

#include "server/tissue/dynamics/block_descent.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/assert.h"
#include "server/tissue/contact/contact_law.h"
#include "server/tissue/dynamics/node_move.h"
#include "server/tissue/dynamics/room.h"

namespace trocar::dynamics {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
// A step of up to this many sweeps allocates nothing.
constexpr std::size_t kUsualSweeps = 64;
// If a node's step was not finite, the nodes within so many layers of it are restored with it.
constexpr int kRestoredLayers = 3;
// Drag is so many times the inertia that would do for domains that are folded or drawn out.
constexpr float kDrag = 2;
// One worker sweeps so many in a row: some microseconds.
constexpr std::size_t kSweptInARow = 4, kPacksInARow = 2;

// Returns the mean velocity of who shares a smoothing domain with each node; velocities: per slot.
Vec8 velocity_around(const NodalStrain& strain, Group group, const Float4* velocities) {
  Vec8 sum = zero_vec8();
  Float8 count = all(0);
  for (const auto& member : strain.members(group)) {
    const Vec8 part = load(member.part);
    const Float8 one = where(_mm256_cmp_ps(dot8(part, part), all(0), _CMP_GT_OQ), all(1));
    sum = fma8(gather(velocities, member.node), one, sum), count = count + one;
  }
  return sum * (all(1) / _mm256_max_ps(count, all(1)));
}

float sum(const Lanes& a) {
  return ((a.v[0] + a.v[4]) + (a.v[2] + a.v[6])) + ((a.v[1] + a.v[5]) + (a.v[3] + a.v[7]));
}

}  // namespace

bool BlockDescent::is_swept(NodeIndex node, const world::World& world) {
  const auto node_class = world.node_classes[node.value];
  return node_class != world::NodeClass::Fixed && node_class != world::NodeClass::Asleep;
}

BlockDescent::BlockDescent(const organ::Organ& organ, const world::World& world, unsigned workers,
                           StrainScheme scheme)
    : organ_(organ),
      tissue_(organ, scheme),
      workers_(workers),
      gravity_(to_float(organ.gravity_m_s2)) {
  if (scheme == StrainScheme::Implicit) implicit_strain_ = tissue_.nodal_strain();
  has_explicit_strain_ = implicit_strain_ != tissue_.nodal_strain();
  const auto& groups = tissue_.groups();
  const auto group_count = groups.group_count();
  for (auto* values : {&x_, &v_, &start_}) values->reserve(with_room(groups.slot_count()));
  constants_.reserve(with_room(group_count));
  inertia_.reserve(with_room(group_count));
  resize_arrays();
  links_.reserve(8 * contact::kMaxPointsPerTool + contact::kMaxSelfPoints);
  residuals_.reserve(world.node_count());
  packed_slots_.reserve(world.node_count());
  schedule_.reserve(kUsualSweeps);
  relaxed_lanes_.reserve(group_count);
  for (auto* plan : {&near_, &far_, &far_swept_, &cut_swept_, &last_, &begun_, &relaxed_})
    plan->reserve(groups);
  for (auto& band : bands_)
    for (auto* plan : {&band.nodes, &band.kept, &band.packed}) plan->reserve(groups);
  const auto map = organ::material_map(organ);
  for (Group g = 0; g < group_count; ++g) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(g)[lane];
      if (!node.is_valid()) continue;
      const float mass = world.masses[node.value];
      const auto rate =
          static_cast<float>(organ::material_at(organ, map.nodes[node.value]).node_damping_per_s);
      constants_[g].mass.v[lane] = mass;
      constants_[g].damping.v[lane] = mass * rate;
    }
  }
  read_state(world);
}

void BlockDescent::read_state(const world::World& world) {
  const auto& groups = tissue_.groups();
  for (Group g = 0; g < groups.group_count(); ++g) {
    free_[g] = 0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(g)[lane];
      if (!node.is_valid()) continue;
      if (is_swept(node, world)) free_[g] = static_cast<std::uint8_t>(free_[g] | 1u << lane);
    }
  }
  read_motion(world);
  if (linear_far_field_) linear_far_field_->read_state(x_.data(), world);
  read_relaxation(world);
}

void BlockDescent::read_motion(const world::World& world) {
  for (Slot slot = 0; slot < x_.size(); ++slot) {
    const auto node = tissue_.groups().node_at(slot);
    if (!node.is_valid()) continue;
    x_[slot] = to_float4(world.displacements[node.value]);
    v_[slot] = to_float4(world.velocities[node.value]);
  }
}

void BlockDescent::use_linear_far_field(const world::World& world) {
  linear_far_field_ = std::make_unique<LinearFarField>(tissue_, world);
  linear_far_field_->read_state(x_.data(), world);
  scratch_.resize(workers_.most());
  due_.reserve(all_groups_.size());
}

void BlockDescent::use_energies(std::span<const NodeIndex> nodes) {
  for (const auto g : groups_with_energies_) has_energies_[g] = 0;
  groups_with_energies_.clear();
  for (const auto node : nodes) {
    const Group g = tissue_.groups().slot_of(node) / kLanes;
    if (std::exchange(has_energies_[g], std::uint8_t{1}) == 0) groups_with_energies_.push_back(g);
  }
}

void BlockDescent::read_state(const world::World& world, std::span<const NodeIndex> nodes) {
  for (const auto node : nodes) {
    const Slot slot = tissue_.groups().slot_of(node);
    x_[slot] = to_float4(world.displacements[node.value]);
    v_[slot] = to_float4(world.velocities[node.value]);
    auto& free = free_[slot / kLanes];
    const unsigned lane = slot % kLanes;
    free =
        static_cast<std::uint8_t>((free & ~(1u << lane)) | unsigned{is_swept(node, world)} << lane);
  }
}

// --- Contacts ---

void BlockDescent::link_contacts(const contact::ContactList& contacts) {
  const auto& groups = tissue_.groups();
  has_serial_ = false;
  links_.resize(contacts.points.size());
  for (auto i = static_cast<std::uint32_t>(contacts.points.size()); i-- > 0;) {
    const auto& point = contacts.points[i];
    PointLinks& links = links_[i];
    for (std::uint32_t corner = 0; corner < point.node_count; ++corner) {
      const Slot slot = links.slots[corner] = groups.slot_of(point.nodes[corner]);
      if ((point.moved >> corner & 1) == 0) continue;
      links.next[corner] = slot_stamp_[slot] == current_ ? first_link_[slot] : kNone;
      slot_stamp_[slot] = group_stamp_[slot / kLanes] = current_;
      first_link_[slot] = i * contact::kMaxPointNodes + corner;
    }
    for (std::uint32_t a = 1; a < point.node_count; ++a)
      for (std::uint32_t b = 0; b < a; ++b) {
        const Group g = links.slots[a] / kLanes, h = links.slots[b] / kLanes;
        if (groups.colour_of(g) != groups.colour_of(h)) continue;
        serial_stamp_[g] = serial_stamp_[h] = current_;
        has_serial_ = true;
      }
  }
}

// --- The step ---

void BlockDescent::begin_inertia(Group group, std::span<const Vec3f> forces) {
  // Starting where inertia alone would lead makes rigid motion exact from the first sweep; starting
  // at rest instead acts as a drag as long as sweeps are few.
  Float4* const x = &x_[group * kLanes];
  const Vec8 v = load_group(&v_[group * kLanes]), before = load_group(x);
  const Float8 moves = mask_of(static_cast<std::uint8_t>(near_.lanes[group] | far_.lanes[group]));
  const Vec8 ahead = fma8(v, where(moves, all(1.0f / inverse_dt_)), before);
  store_group(x, ahead);
  Vec8 start = before;
  if (is_slow(group) && !coasts(group)) {
    // It has coasted to here for the steps before; a sweep is for them, too.
    const Float8 passed = all(static_cast<float>(far_interval_) / inverse_dt_);
    start = ahead - v * where(moves, passed);
  }
  store_group(&start_[group * kLanes], start);
  if (coasts(group)) return;
  const Float8 mass = load(constants_[group].mass), rate = all(inverse_dt_of(group));
  const Vec8 gravity{all(gravity_.x), all(gravity_.y), all(gravity_.z)};
  Vec8 momentum = fma8(gravity, mass, v * (mass * rate));
  if (!forces.empty()) {
    const auto nodes = tissue_.groups().nodes_of(group);
    Vec3Lanes load_n;
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (nodes[lane].is_valid()) load_n.set(lane, forces[nodes[lane].value]);
    momentum = momentum + load(load_n);
  }
  if (const auto* const stress = tissue_.relaxed_stress())
    momentum = momentum + stress->forces(group);
  Float8 inertia = (mass * rate + load(constants_[group].damping)) * rate;
  if (has_explicit_strain_) {
    const auto nodal = tissue_.nodal_forces(group);
    float least = kLeastInertia * far_over_relaxation_;
    // Forces are those of the last tick's end, so that to longer steps they are older.
    if (is_slow(group)) least *= 3 - 2 / static_cast<float>(far_interval_);
    const Float8 added =
        where(moves, _mm256_max_ps(fma8(nodal.stiffness, all(least), all(0) - inertia), all(0)));
    momentum = fma8(ahead - start, added, momentum) - nodal.gradient;
    // Drag resists a node's motion, not the change of it; against those around it, for what falls
    // as a whole is not held back.
    const Float8 drag = where(moves, nodal.drag * all(kDrag * least));
    if (_mm256_movemask_ps(_mm256_cmp_ps(drag, all(0), _CMP_GT_OQ)) != 0)
      momentum =
          fma8(velocity_around(*tissue_.nodal_strain(), group, v_.data()), drag / rate, momentum);
    inertia = inertia + added + drag;
  }
  store(inertia_[group].inertia, inertia);
  store(inertia_[group].momentum, momentum);
}

// Lets energies prepare, once per step, what stays constant in it, from displacements at its start.
void BlockDescent::ask_energies(Group group, const Float4* start) {
  if (asked_stamp_[group] == current_) return;
  asked_stamp_[group] = current_;
  tissue_.begin_group(group, start, inverse_dt_of(group));
}

void BlockDescent::begin_groups(world::World& world, const ExternalLoads& loads,
                                std::span<const SweepBand> bands) {
  if (is_far_linear_) {
    linear_far_field_->begin_step(x_.data(), world);
    due_.clear();
    for (const auto g : all_groups_)
      if (linear_far_field_->is_due(g)) due_.push_back(g);
    workers_.for_each(due_.size(), 1, [&](std::size_t i, unsigned w) {
      linear_far_field_->renew(due_[i], scratch_[w]);
    });
  } else {
    for_each_group(far_swept_.groups, [&](Group g) { ask_energies(g, x_.data()); });
  }
  // Linear groups ask when their forces do not do: rarely at rest, mostly where tips stir tissue.
  const NearBand& all_near = last_band(bands);
  for_each_group(has_packs_ ? all_near.kept.groups : near_.groups,
                 [&](Group g) { ask_energies(g, x_.data()); });
  if (has_packs_)
    for_each_group(all_near.packed.groups, [&](Group pack) {
      tissue_.begin_group(kFirstPack + pack, x_.data(), gather(x_.data(), packs_.slots(pack)),
                          inverse_dt_);
    });
  for (const auto node : loads.held)
    ask_energies(tissue_.groups().slot_of(node) / kLanes, x_.data());
  if (has_explicit_strain_)
    for_each_group(all_groups_, [&](Group g) { tissue_.update_nodal_stress(g, x_.data()); });
  for_each_group(begun_.groups, [&](Group g) { begin_inertia(g, loads.forces); });
  place_held(loads);
  if (is_far_linear_)
    for_each_group(begun_.groups, [&](Group g) {
      linear_far_field_->begin_group(g, x_.data(), start_.data(),
                                     coasts(g) ? inverse_dt_ : inverse_dt_of(g));
    });
  if (implicit_strain_ != nullptr) restart_nodal_strain();
  for (const auto g : begun_.groups) rejected_[g] = 0, squared_moves_[g] = 0;
}

void BlockDescent::restart_nodal_strain() {
  if (auto* const strain = tissue_.nodal_strain())
    for_each_group(all_groups_, [&](Group g) { strain->restart_group(g, x_.data()); });
}

NodeStep8 BlockDescent::inertia_of(Group group, const Vec8& own) const {
  const Inertia& inertia = inertia_[group];
  const Float8 m = load(inertia.inertia);
  const Vec8 moved = own - load_group(&start_[group * kLanes]);
  NodeStep8 step{moved * m - load(inertia.momentum), zero_sym_mat8()};
  step.block.add_identity(m);
  return step;
}

NodeStep8 BlockDescent::linearise(Group group, const Vec8& own) const {
  NodeStep8 step = inertia_of(group, own);
  tissue_.add_elements(group, x_.data(), own, step);
  if (implicit_strain_ != nullptr) tissue_.add_averaged(group, step);
  return step;
}

Vec3f BlockDescent::displacement_of(const contact::ContactPoint& point,
                                    const PointLinks& links) const {
  Vec3f sum;
  for (std::size_t i = 0; i < point.node_count; ++i)
    sum += to_vec3(x_[links.slots[i]]) * point.weights[i];
  return sum;
}

bool BlockDescent::is_touched(Group group, std::uint8_t lanes) const {
  if (group_stamp_[group] != current_) return false;
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    if ((lanes >> lane & 1) && slot_stamp_[group * kLanes + lane] == current_) return true;
  return false;
}

void BlockDescent::add_contacts(const contact::ContactList& contacts, const SlotLanes& slots,
                                NodeStep8& step, Lanes& omega) const {
  Vec3Lanes gradients;
  SymMat3Lanes blocks;
  store(gradients, step.gradient);
  store(blocks, step.block);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Slot slot = slots.v[lane];
    if (slot_stamp_[slot] != current_) continue;
    // No over-relaxation across a contact's kink: it would cycle for ever.
    omega.v[lane] = 1.0f;
    Vec3f gradient = gradients.at(lane);
    SymMat3f block = blocks.at(lane);
    for (auto link = first_link_[slot]; link != kNone;) {
      const auto i = link / contact::kMaxPointNodes, corner = link % contact::kMaxPointNodes;
      const auto& point = contacts.points[i];
      const auto load = contact::load_at(point, displacement_of(point, links_[i]));
      gradient += load.gradient * point.weights[corner];
      contact::add_block(point, load, point.weights[corner], block);
      link = links_[i].next[corner];
    }
    gradients.set(lane, gradient);
    blocks.set(lane, block);
  }
  step.gradient = load(gradients);
  step.block = load(blocks);
}

void BlockDescent::relax(const SweepPlan& plan, Group group, const contact::ContactList& contacts,
                         Relaxation omega) {
  const auto lanes = plan.lanes[group];
  Float4* const x = &x_[group * kLanes];
  const Vec8 own = load_group(x);
  NodeStep8 step = inertia_of(group, own);
  const bool has_near = (lanes & near_.lanes[group]) != 0, touched = is_touched(group, lanes);
  const bool is_linear = is_far_linear_ && !has_near && has_energies_[group] == 0 &&
                         !tissue_.has_ties(group) &&
                         linear_far_field_->add(group, lanes, inverse_dt_of(group), step);
  if (!is_linear) {
    ask_energies(group, start_.data());
    tissue_.add_elements(group, x_.data(), own, step);
  }
  if (implicit_strain_ != nullptr) tissue_.add_averaged(group, step);
  Float8 factor = _mm256_blendv_ps(all(-omega.far), all(-omega.near), mask_of(near_.lanes[group]));
  if (touched) {
    Lanes factors;
    store(factors, all(0) - factor);
    add_contacts(contacts, slots_of(group), step, factors);
    factor = all(0) - load(factors);
  }
  if (!held_axes_.empty()) hold_axes(group, step);
  const NodeMove move = move_of(step, factor, lanes);
  store_group(x, own + move.dx);
  if (implicit_strain_ != nullptr) implicit_strain_->after_move(group, move.dx, lanes);
  if (is_far_linear_) linear_far_field_->after_move(group, move.dx, inverse_dt_of(group));
  store(squares_[group], _mm256_blendv_ps(load(squares_[group]), move.squared, mask_of(lanes)));
  rejected_[group] = static_cast<std::uint8_t>(rejected_[group] | move.rejected);
}

void BlockDescent::sweep(const ScheduledSweep& scheduled, const contact::ContactList& contacts,
                         Relaxation omega) {
  const SweepPlan& plan = *scheduled.plan;
  for (std::size_t colour = 0; colour < tissue_.groups().colour_count(); ++colour) {
    if (scheduled.packs != nullptr) {
      const auto packs = scheduled.packs->of_colour(colour);
      workers_.for_each(packs.size(), kPacksInARow, [&](std::size_t i, unsigned) {
        relax_pack(scheduled.packs->lanes[packs[i]], packs[i], contacts, omega.near);
      });
    }
    const auto groups = plan.of_colour(colour);
    const auto is_serial = [&](Group g) { return has_serial_ && serial_stamp_[g] == current_; };
    workers_.for_each(groups.size(), kSweptInARow, [&](std::size_t i, unsigned) {
      if (!is_serial(groups[i])) relax(plan, groups[i], contacts, omega);
    });
    if (!has_serial_) continue;
    for (const auto g : groups)
      if (is_serial(g)) relax(plan, g, contacts, omega);
  }
}

double BlockDescent::sum_of_squares(const SweepPlan& core) const {
  double total = 0;
  for (const auto g : core.groups) {
    Lanes squares;
    store(squares, where(mask_of(core.lanes[g]), load(squares_[g])));
    total += static_cast<double>(sum(squares));
  }
  return total;
}

void BlockDescent::write_back(const SweepPlan& plan, world::World& world) {
  for_each_group(plan.groups, [&](Group g) {
    const auto first = g * kLanes;
    const auto* const nodes = tissue_.groups().nodes_of(g).data();
    const bool is_swept = !coasts(g);
    const Vec8 x = load_group(&x_[first]);
    Vec8 v = load_group(&v_[first]);
    if (is_swept) {
      const Float8 moved = mask_of(plan.lanes[g]),
                   stays = mask_of(static_cast<std::uint8_t>(~plan.lanes[g]));
      const Vec8 next = (x - load_group(&start_[first])) * all(inverse_dt_of(g));
      v = {_mm256_or_ps(where(moved, next.x), where(stays, v.x)),
           _mm256_or_ps(where(moved, next.y), where(stays, v.y)),
           _mm256_or_ps(where(moved, next.z), where(stays, v.z))};
      store_group(&v_[first], v);
    }
    float most = 0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if ((plan.lanes[g] >> lane & 1) == 0) continue;
      const Vec3f now = to_vec3(x_[first + lane]);
      Vec3f& displacement = world.displacements[nodes[lane].value];
      most = std::max(most, length_squared(now - displacement));
      displacement = now;
      if (is_swept) world.velocities[nodes[lane].value] = to_vec3(v_[first + lane]);
    }
    squared_moves_[g] = std::max(squared_moves_[g], most);
  });
}

BlockDescent::Restored BlockDescent::restore_rejected(world::World& world) {
  std::vector<NodeIndex> nodes;  // allocates: this is not a tick like others
  std::vector<std::uint8_t> is_in(world.node_count());
  const auto add = [&](NodeIndex node) {
    if (is_in[node.value] || world.node_classes[node.value] == world::NodeClass::Fixed) return;
    is_in[node.value] = 1;
    nodes.push_back(node);
  };
  for (const auto g : begun_.groups)
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (rejected_[g] >> lane & 1) add(tissue_.groups().nodes_of(g)[lane]);
  for (std::size_t layer = 0, i = 0; layer < kRestoredLayers; ++layer)
    for (const auto end = nodes.size(); i < end; ++i) {
      if (topology_ != nullptr)
        topology_->for_each_neighbour(nodes[i], add);
      else
        for (const auto neighbour : organ_.mesh.node_neighbours[nodes[i]]) add(neighbour);
    }
  Restored restored;
  for (const auto node : nodes) {
    const Slot slot = tissue_.groups().slot_of(node);
    x_[slot] = to_float4(start_of(slot));
    Vec3f& displacement = world.displacements[node.value];
    restored.largest_move_m =
        std::max(restored.largest_move_m, length(to_vec3(x_[slot]) - displacement));
    displacement = to_vec3(x_[slot]);
    world.velocities[node.value] = {};
    v_[slot] = {};
  }
  restored.nodes = static_cast<std::uint32_t>(nodes.size());
  return restored;
}

void BlockDescent::begin_step(const contact::ContactList& contacts, std::span<const NodeIndex> near,
                              const SolveSettings& settings, world::World& world,
                              const ExternalLoads& loads) {
  if (++current_ == 0) {
    for (auto* stamps : {&slot_stamp_, &group_stamp_, &begun_stamp_, &serial_stamp_, &asked_stamp_})
      std::ranges::fill(*stamps, 0u);
    current_ = 1;
  }
  inverse_dt_ = 1.0f / settings.dt;
  far_over_relaxation_ = settings.far_sweeps > 0 ? settings.far_over_relaxation : 1;
  // A node that is held along an axis alone has no linear form.
  is_far_linear_ =
      settings.far_sweeps > 0 && settings.has_linear_far_field && loads.axis_holds.empty();
  TROCAR_ASSERT(!is_far_linear_ || linear_far_field_);
  link_contacts(contacts);
  plan_step(near, settings, world.tick, loads);
  plan_bands(near, settings.bands);
  plan_last_sweep(settings);
  schedule_sweeps(settings);
  if (auto* const ties = tissue_.ties()) ties->use_memory(world.tie_extensions.data());
  if (auto* const relaxation = tissue_.relaxation())
    relaxation->begin_step(settings.dt, world.relaxation, workers_);
  begin_groups(world, loads, settings.bands);
}

void BlockDescent::execute_schedule(const contact::ContactList& contacts,
                                    std::span<const NodeIndex> near, const SolveSettings& settings,
                                    SolveReport& report) {
  // Growth is judged by the nodes that every sweep has.
  const SweepPlan& judged = band_of(settings.sweeps, settings.bands).nodes;
  const auto tolerance = static_cast<double>(settings.residual_tolerance_n);
  const auto enough = tolerance * tolerance * static_cast<double>(near.size());
  float omega = settings.over_relaxation;
  double last_squares = INFINITY;
  for (const auto& scheduled : schedule_) {
    sweep(scheduled, contacts,
          {std::min(omega, scheduled.max_over_relaxation), settings.far_over_relaxation});
    if (!scheduled.is_near) continue;
    report.node_sweeps += scheduled.near_nodes;
    ++report.sweeps;
    const double squares = sum_of_squares(judged);
    if (settings.has_safeguard && squares > last_squares && omega > 1.0f) {
      omega = 1.0f;
      report.is_stepped_down = true;
    }
    last_squares = squares;
    if (tolerance > 0 && squares <= enough) break;
  }
  report.far_node_sweeps = settings.far_sweeps * far_swept_.node_count;
  if (settings.cut_sweeps > settings.far_sweeps)
    report.far_node_sweeps += (settings.cut_sweeps - settings.far_sweeps) * cut_swept_.node_count;
  report.node_sweeps += report.far_node_sweeps;
}

float BlockDescent::write_back(const ExternalLoads& loads, world::World& world) {
  write_back(near_, world);
  write_back(far_, world);
  float squared_move = 0;
  for (const auto* plan : {&near_, &far_})
    for (const auto g : plan->groups) squared_move = std::max(squared_move, squared_moves_[g]);
  for (const auto node : loads.held) {
    const Slot slot = tissue_.groups().slot_of(node);
    const Vec3f move = to_vec3(x_[slot]) - start_of(slot);
    squared_move = std::max(squared_move, length_squared(move));
    world.displacements[node.value] = to_vec3(x_[slot]);
    world.velocities[node.value] = move * inverse_dt_;
    v_[slot] = to_float4(world.velocities[node.value]);
  }
  return std::sqrt(squared_move);
}

// The root mean square of the near nodes' residuals in the last sweep.
float BlockDescent::note_residuals(std::span<const NodeIndex> near) {
  residuals_.clear();
  for (const auto node : near) {
    const Slot slot = tissue_.groups().slot_of(node);
    residuals_.push_back(std::sqrt(squares_[slot / kLanes].v[slot % kLanes]));
  }
  if (near.empty()) return 0;
  return static_cast<float>(std::sqrt(sum_of_squares(near_) / static_cast<double>(near.size())));
}

SolveReport BlockDescent::solve(const contact::ContactList& contacts,
                                std::span<const NodeIndex> near, const SolveSettings& settings,
                                world::World& world, const ExternalLoads& loads) {
  TROCAR_ASSERT(loads.held.size() == loads.held_displacements.size());
  TROCAR_ASSERT(loads.forces.empty() || loads.forces.size() == world.node_count());
  const bool is_plain = settings.far_sweeps == 0 && settings.bands.empty();
  TROCAR_ASSERT(is_plain || settings.residual_tolerance_n == 0);

  SolveReport report;
  begin_step(contacts, near, settings, world, loads);
  execute_schedule(contacts, near, settings, report);
  report.largest_move_m = write_back(loads, world);
  for (const auto g : begun_.groups)
    report.nodes_rejected += static_cast<unsigned>(__builtin_popcount(rejected_[g]));
  if (report.nodes_rejected > 0) {
    // The start of a slow group's step is not where the last tick left its nodes.
    const auto restored = restore_rejected(world);
    report.nodes_restored = restored.nodes;
    report.largest_move_m += restored.largest_move_m;
    restart_nodal_strain();
  }
  end_relaxation(world, loads.held);
  report.residual_n = note_residuals(near);
  return report;
}

Vec3f BlockDescent::start_of(Slot slot) const {
  return to_vec3(begun_stamp_[slot / kLanes] == current_ ? start_[slot] : x_[slot]);
}

}  // namespace trocar::dynamics

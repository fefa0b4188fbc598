#include "server/tissue/dynamics/block_descent.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"
#include "server/tissue/contact/contact_law.h"

namespace trocar::dynamics {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
// Groups next to one another that take turns together, so that memory is read in runs.
constexpr std::uint32_t kPhaseGroups = 16;
constexpr float kMaxOverRelaxationFewSweeps = 1.3f;
// A step of one node beyond this, m, is as broken as one that is not finite.
constexpr float kMaxNodeStep = 1.0f;
// What goes back with a node whose step was not finite: the nodes within so many layers.
constexpr int kRestoredLayers = 3;

float sum(const Lanes& a) {
  return ((a.v[0] + a.v[4]) + (a.v[2] + a.v[6])) + ((a.v[1] + a.v[5]) + (a.v[3] + a.v[7]));
}

}  // namespace

BlockDescent::BlockDescent(const organ::Organ& organ, const world::World& world, unsigned workers)
    : organ_(organ), tissue_(organ), workers_(workers), gravity_(to_float(organ.gravity_m_s2)) {
  const auto& groups = tissue_.groups();
  const auto group_count = groups.group_count(), slot_count = groups.slot_count();
  constants_.resize(group_count);
  free_.resize(group_count);
  x_.resize(slot_count);
  v_.resize(slot_count);
  start_.resize(slot_count);
  inertia_.resize(group_count);
  squares_.resize(group_count);
  group_squares_.resize(group_count);
  squared_moves_.resize(group_count);
  rejected_.resize(group_count);
  begun_stamp_.resize(group_count);
  group_stamp_.resize(group_count);
  asked_stamp_.resize(group_count);
  serial_stamp_.resize(group_count);
  slot_stamp_.resize(slot_count);
  first_link_.resize(slot_count);
  links_.reserve(8 * contact::kMaxPointsPerTool + contact::kMaxSelfPoints);
  residuals_.reserve(world.node_count());
  relaxed_lanes_.reserve(group_count);
  for (auto* plan : {&near_, &far_, &far_swept_, &last_, &begun_, &relaxed_}) plan->reserve(groups);
  for (auto& band : bands_) band.reserve(groups);
  const auto map = organ::material_map(organ);
  for (Group g = 0; g < group_count; ++g) {
    all_groups_.push_back(g);
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
  take_state(world);
}

void BlockDescent::take_state(const world::World& world) {
  const auto& groups = tissue_.groups();
  for (Group g = 0; g < groups.group_count(); ++g) {
    free_[g] = 0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto node = groups.nodes_of(g)[lane];
      if (!node.is_valid()) continue;
      if (world.node_classes[node.value] != world::NodeClass::Fixed)
        free_[g] = static_cast<std::uint8_t>(free_[g] | 1u << lane);
    }
  }
  take_motion(world);
  if (far_field_) far_field_->take_state(x_.data(), world);
  take_relaxation(world);
}

void BlockDescent::take_motion(const world::World& world) {
  for (Slot slot = 0; slot < x_.size(); ++slot) {
    const auto node = tissue_.groups().node_at(slot);
    if (!node.is_valid()) continue;
    x_[slot] = to_float4(world.displacements[node.value]);
    v_[slot] = to_float4(world.velocities[node.value]);
  }
}

void BlockDescent::use_linear_far_field(const world::World& world) {
  far_field_ = std::make_unique<FarField>(tissue_, world);
  far_field_->take_state(x_.data(), world);
  takings_.resize(workers_.count());
  due_.reserve(all_groups_.size());
}

void BlockDescent::take_state(const world::World& world, std::span<const NodeIndex> nodes) {
  for (const auto node : nodes) {
    const Slot slot = tissue_.groups().slot_of(node);
    x_[slot] = to_float4(world.displacements[node.value]);
    v_[slot] = to_float4(world.velocities[node.value]);
  }
}

// --- Which groups and lanes ---

void BlockDescent::plan_step(std::span<const NodeIndex> near, const SolveSettings& settings,
                             Tick tick, std::span<const NodeIndex> held) {
  const auto& groups = tissue_.groups();
  for (auto* plan : {&near_, &far_, &far_swept_, &last_, &begun_}) plan->clear();
  for (const auto node : near) near_.add(groups, node);
  near_.finish(groups);
  far_interval_ = settings.far_interval;
  if (settings.far_sweeps > 0)
    for (Group g = 0; g < free_.size(); ++g) {
      const auto lanes = static_cast<std::uint8_t>(free_[g] & ~near_.lanes[g]);
      far_.add(g, lanes);
      if (!is_slow(g) || (g / kPhaseGroups + tick) % far_interval_ == 0) far_swept_.add(g, lanes);
    }
  far_swept_.finish(groups);
  if (settings.far_sweeps > 0) {
    for (const auto g : near_.groups) last_.add(g, near_.lanes[g]);
    for (const auto g : far_swept_.groups) last_.add(g, far_swept_.lanes[g]);
    last_.finish(groups);
  }
  for (const auto g : near_.groups) begun_.add(g, 0xff);
  for (const auto g : is_far_linear_ ? all_groups_ : far_.groups) begun_.add(g, 0xff);
  for (const auto node : held) begun_.add(groups.slot_of(node) / kLanes, 0xff);
  for (const auto g : begun_.groups) begun_stamp_[g] = current_;
}

void BlockDescent::plan_bands(std::span<const NodeIndex> near, std::span<const SweepBand> bands) {
  TROCAR_ASSERT(bands.size() <= kMaxSweepBands);
  for (std::size_t b = 0; b + 1 < bands.size(); ++b) {
    bands_[b].clear();
    for (const auto node : near.first(bands[b].end)) bands_[b].add(tissue_.groups(), node);
    bands_[b].finish(tissue_.groups());
  }
}

const SweepPlan& BlockDescent::plan_of(std::uint32_t left, std::span<const SweepBand> bands) const {
  for (std::size_t b = 0; b + 1 < bands.size(); ++b)
    if (bands[b + 1].sweeps < left) return bands_[b];
  return near_;
}

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
  store(inertia_[group].inertia, (mass * rate + load(constants_[group].damping)) * rate);
  store(inertia_[group].momentum, momentum);
}

// What energies keep for a step, from displacements at its start.
void BlockDescent::ask_energies(Group group, const Float4* start) {
  if (asked_stamp_[group] == current_) return;
  asked_stamp_[group] = current_;
  tissue_.begin_group(group, start, inverse_dt_of(group));
}

void BlockDescent::begin_groups(world::World& world, const ExternalLoads& loads) {
  if (is_far_linear_) {
    far_field_->begin_step(x_.data(), world);
    due_.clear();
    for (const auto g : all_groups_)
      if (far_field_->is_due(g)) due_.push_back(g);
    workers_.run([&](unsigned w) {
      const auto n = due_.size(), count = std::size_t{workers_.count()};
      for (auto i = n * w / count; i < n * (w + 1) / count; ++i)
        far_field_->renew(due_[i], takings_[w]);
    });
  } else {
    for_each_group(far_swept_.groups, [&](Group g) { ask_energies(g, x_.data()); });
  }
  // Linear groups ask when their forces do not do, which is rare.
  for_each_group(near_.groups, [&](Group g) { ask_energies(g, x_.data()); });
  for (const auto node : loads.held)
    ask_energies(tissue_.groups().slot_of(node) / kLanes, x_.data());
  for_each_group(begun_.groups, [&](Group g) { begin_inertia(g, loads.forces); });
  place_held(loads);
  if (is_far_linear_)
    for_each_group(begun_.groups, [&](Group g) {
      far_field_->begin_group(g, x_.data(), start_.data(),
                              coasts(g) ? inverse_dt_ : inverse_dt_of(g));
    });
  restart_stars();
  for (const auto g : begun_.groups) rejected_[g] = 0, squared_moves_[g] = 0;
}

void BlockDescent::restart_stars() {
  if (auto* const stars = tissue_.stars())
    for_each_group(all_groups_, [&](Group g) { stars->restart_group(g, x_.data()); });
}

void BlockDescent::place_held(const ExternalLoads& loads) {
  const auto& groups = tissue_.groups();
  for (std::size_t i = 0; i < loads.held.size(); ++i)
    x_[groups.slot_of(loads.held[i])] = to_float4(loads.held_displacements[i]);
  held_axes_.clear();
  if (loads.axis_holds.empty()) return;
  held_axes_.resize(groups.slot_count());
  for (const auto& hold : loads.axis_holds) {
    const Slot slot = groups.slot_of(hold.node);
    held_axes_[slot] = hold.axes;
    if (hold.axes & 1) x_[slot].x = hold.displacement.x;
    if (hold.axes & 2) x_[slot].y = hold.displacement.y;
    if (hold.axes & 4) x_[slot].z = hold.displacement.z;
  }
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
  tissue_.add(group, x_.data(), own, step);
  return step;
}

Vec3f BlockDescent::displacement_of(const contact::ContactPoint& point,
                                    const PointLinks& links) const {
  Vec3f sum;
  for (std::size_t i = 0; i < point.node_count; ++i)
    sum += to_vec3(x_[links.slots[i]]) * point.weights[i];
  return sum;
}

void BlockDescent::add_contacts(const contact::ContactList& contacts, Group group, NodeStep8& step,
                                Lanes& omega) const {
  Vec3Lanes gradients;
  SymMat3Lanes blocks;
  store(gradients, step.gradient);
  store(blocks, step.block);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Slot slot = static_cast<Slot>(group * kLanes + lane);
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

// Along a held axis nothing pushes and nothing couples, so that the step has no part there.
void BlockDescent::hold_axes(Group group, NodeStep8& step) const {
  Vec3Lanes gradients;
  SymMat3Lanes blocks;
  store(gradients, step.gradient);
  store(blocks, step.block);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const auto axes = held_axes_[group * kLanes + lane];
    if (axes & 1) gradients.x.v[lane] = 0, blocks.xy.v[lane] = 0, blocks.xz.v[lane] = 0;
    if (axes & 2) gradients.y.v[lane] = 0, blocks.xy.v[lane] = 0, blocks.yz.v[lane] = 0;
    if (axes & 4) gradients.z.v[lane] = 0, blocks.xz.v[lane] = 0, blocks.yz.v[lane] = 0;
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
  const bool is_linear = is_far_linear_ && near_.lanes[group] == 0 &&
                         group_stamp_[group] != current_ &&
                         far_field_->add(group, lanes, inverse_dt_of(group), step);
  if (is_linear) {
    tissue_.add_averaged(group, step);
  } else {
    ask_energies(group, start_.data());
    tissue_.add(group, x_.data(), own, step);
  }
  Float8 factor = _mm256_blendv_ps(all(-omega.far), all(-omega.near), mask_of(near_.lanes[group]));
  if (group_stamp_[group] == current_) {
    Lanes factors;
    store(factors, all(0) - factor);
    add_contacts(contacts, group, step, factors);
    factor = all(0) - load(factors);
  }
  if (!held_axes_.empty()) hold_axes(group, step);
  const Vec8 dx = solve_positive_definite(step.block, step.gradient) * factor;
  const Float8 squared = dot8(step.gradient, step.gradient);
  const Float8 swept = mask_of(lanes);
  const Float8 is_sound =
      _mm256_and_ps(is_below(squared, 3e38f), is_below(dot8(dx, dx), kMaxNodeStep * kMaxNodeStep));
  const Float8 moves = _mm256_and_ps(swept, is_sound);
  const Vec8 moved{where(moves, dx.x), where(moves, dx.y), where(moves, dx.z)};
  store_group(x, own + moved);
  if (auto* const stars = tissue_.stars()) stars->after_move(group, moved, lanes);
  if (is_far_linear_) far_field_->after_move(group, moved, inverse_dt_of(group));
  store(squares_[group], where(moves, squared));
  group_squares_[group] = sum(squares_[group]);
  const auto bad = static_cast<std::uint8_t>(lanes & ~bits_of(is_sound));
  rejected_[group] = static_cast<std::uint8_t>(rejected_[group] | bad);
}

void BlockDescent::sweep(const SweepPlan& plan, const contact::ContactList& contacts,
                         Relaxation omega) {
  workers_.run([&](unsigned w) {
    for (std::size_t colour = 0; colour + 1 < plan.colour_begins.size(); ++colour) {
      const auto begin = plan.colour_begins[colour];
      const auto n = std::size_t{plan.colour_begins[colour + 1]} - begin;
      const auto count = std::size_t{workers_.count()};
      for (auto i = n * w / count; i < n * (w + 1) / count; ++i) {
        const Group g = plan.groups[begin + i];
        if (has_serial_ && serial_stamp_[g] == current_) continue;
        relax(plan, g, contacts, omega);
      }
      if (n > 0) workers_.barrier();
      if (!has_serial_ || n == 0) continue;
      if (w == 0)
        for (std::size_t i = 0; i < n; ++i) {
          const Group g = plan.groups[begin + i];
          if (serial_stamp_[g] == current_) relax(plan, g, contacts, omega);
        }
      workers_.barrier();
    }
  });
}

double BlockDescent::sum_of_squares(const SweepPlan& plan) const {
  double total = 0;
  for (const auto g : plan.groups) total += static_cast<double>(group_squares_[g]);
  return total;
}

double BlockDescent::sum_of_squares_within(const SweepPlan& core) const {
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

SolveReport BlockDescent::solve(const contact::ContactList& contacts,
                                std::span<const NodeIndex> near, const SolveSettings& settings,
                                world::World& world, const ExternalLoads& loads) {
  TROCAR_ASSERT(loads.held.size() == loads.held_displacements.size());
  TROCAR_ASSERT(loads.forces.empty() || loads.forces.size() == world.node_count());
  // A tolerance ends the sweeps early, before the far ones.
  has_exterior_ = settings.exterior != nullptr;
  TROCAR_ASSERT((settings.far_sweeps == 0 && settings.bands.empty() && !has_exterior_) ||
                settings.residual_tolerance_n == 0);
  TROCAR_ASSERT(!has_exterior_ || settings.far_sweeps == 0);
  if (++current_ == 0) {
    for (auto* stamps : {&slot_stamp_, &group_stamp_, &begun_stamp_, &serial_stamp_, &asked_stamp_})
      std::ranges::fill(*stamps, 0u);
    current_ = 1;
  }
  inverse_dt_ = 1.0f / settings.dt;
  // A node that is held along an axis alone has no linear form.
  is_far_linear_ =
      settings.far_sweeps > 0 && settings.has_linear_far_field && loads.axis_holds.empty();
  TROCAR_ASSERT(!is_far_linear_ || far_field_);
  plan_step(near, settings, world.tick, loads.held);
  plan_bands(near, settings.bands);
  link_contacts(contacts);
  if (auto* const relaxation = tissue_.relaxation())
    relaxation->begin_step(settings.dt, world.relaxation, workers_);
  begin_groups(world, loads);
  const ExteriorStep outside{tissue_.groups(), x_.data(), world, contacts, near, settings.dt};
  if (has_exterior_) settings.exterior->begin(outside);

  SolveReport report;
  float omega = settings.sweeps < 3
                    ? std::min(settings.over_relaxation, kMaxOverRelaxationFewSweeps)
                    : settings.over_relaxation;
  double squares = 0, last_squares = INFINITY;
  const auto tolerance = static_cast<double>(settings.residual_tolerance_n);
  for (std::uint32_t i = 0; i < settings.sweeps; ++i) {
    const bool has_far = i + 1 == settings.sweeps && settings.far_sweeps > 0;
    for (std::uint32_t far = 1; has_far && far < settings.far_sweeps; ++far)
      sweep(far_swept_, contacts, {1, settings.far_over_relaxation});
    const auto left = settings.sweeps - i;
    if (has_exterior_ && left <= settings.corrections) settings.exterior->correct(outside);
    const bool has_few = std::ranges::any_of(settings.bands, [left](const SweepBand& band) {
      return band.sweeps >= left && band.sweeps < 3;
    });
    const SweepPlan& plan = plan_of(left, settings.bands);
    // The last is one for all: a group with near and far nodes costs no more than near ones.
    sweep(has_far ? last_ : plan, contacts,
          {has_few ? std::min(omega, kMaxOverRelaxationFewSweeps) : omega,
           settings.far_over_relaxation});
    report.node_sweeps += plan.node_count;
    ++report.sweeps;
    // Growth is judged by the nodes that every sweep has.
    squares = settings.bands.empty() && !has_far
                  ? sum_of_squares(near_)
                  : sum_of_squares_within(plan_of(settings.sweeps, settings.bands));
    if (settings.has_safeguard && squares > last_squares && omega > 1.0f) {
      omega = 1.0f;
      report.is_stepped_down = true;
    }
    last_squares = squares;
    if (tolerance > 0 && squares <= tolerance * tolerance * static_cast<double>(near.size())) break;
  }

  report.far_node_sweeps = settings.far_sweeps * far_swept_.node_count;
  report.node_sweeps += report.far_node_sweeps;
  if (!settings.bands.empty()) squares = sum_of_squares_within(near_);
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
  report.largest_move_m = std::sqrt(squared_move);
  if (has_exterior_)
    report.largest_move_m =
        std::max(report.largest_move_m, settings.exterior->end(outside, v_.data(), world));
  for (const auto g : begun_.groups)
    report.nodes_rejected += static_cast<unsigned>(__builtin_popcount(rejected_[g]));
  if (report.nodes_rejected > 0) {
    // The start of a slow group's step is not where the last tick left its nodes.
    const auto restored = restore_rejected(world);
    report.nodes_restored = restored.nodes;
    report.largest_move_m += restored.largest_move_m;
    restart_stars();
  }
  end_relaxation(world, loads.held);
  residuals_.clear();
  for (const auto node : near) {
    const Slot slot = tissue_.groups().slot_of(node);
    residuals_.push_back(std::sqrt(squares_[slot / kLanes].v[slot % kLanes]));
  }
  if (!near.empty())
    report.residual_n = static_cast<float>(std::sqrt(squares / static_cast<double>(near.size())));
  return report;
}

Vec3f BlockDescent::start_of(Slot slot) const {
  return to_vec3(begun_stamp_[slot / kLanes] == current_ ? start_[slot] : x_[slot]);
}

}  // namespace trocar::dynamics

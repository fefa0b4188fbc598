#include "server/tissue/step/external_loads.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace trocar::step {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

void set_axes(std::uint8_t axes, const Vec3f& from, Vec3f& to) {
  if (axes & 1) to.x = from.x;
  if (axes & 2) to.y = from.y;
  if (axes & 4) to.z = from.z;
}

// These say what is wrong, or nothing.

std::string wrong_nodes(std::span<const NodeIndex> nodes, std::size_t node_count) {
  if (nodes.empty()) return "has no nodes";
  if (std::ranges::adjacent_find(nodes, std::ranges::greater_equal{}) != nodes.end())
    return "its nodes are not in ascending order, each once";
  if (nodes.back().value >= node_count)
    return "node " + std::to_string(nodes.back().value) + " is none of the organ's " +
           std::to_string(node_count);
  return {};
}

bool is_within(const Vec3d& v, double most) {
  return std::abs(v.x) <= most && std::abs(v.y) <= most && std::abs(v.z) <= most;
}

std::string wrong_curve(const TimedVector& curve, double most) {
  if (curve.keys.empty()) return "has no keys";
  for (std::size_t i = 0; i < curve.keys.size(); ++i) {
    const auto& [time_s, value] = curve.keys[i];
    if (!std::isfinite(time_s) || (i > 0 && !(time_s > curve.keys[i - 1].time_s)))
      return "the times of its keys do not increase";
    if (!is_within(value, most))
      return "a key's value is not within " + std::to_string(std::llround(most));
  }
  return {};
}

std::string wrong_displacement(const DisplacedNodes& load, std::vector<std::uint8_t>& held) {
  if (auto wrong = wrong_nodes(load.nodes, held.size()); !wrong.empty()) return wrong;
  if (load.axes == 0 || load.axes > kAllAxes) return "holds along no axis";
  for (const auto node : load.nodes) {
    if ((held[node.value] & load.axes) != 0)
      return "node " + std::to_string(node.value) + " is held already along that axis";
    held[node.value] |= load.axes;
  }
  return wrong_curve(load.over_time, kMaxDisplacementMetres);
}

std::string wrong_force(const LoadedNodes& load, std::size_t node_count) {
  if (auto wrong = wrong_nodes(load.nodes, node_count); !wrong.empty()) return wrong;
  const auto& areas = load.normal_areas_m2;
  const bool is_complete = areas.empty() ? load.shares.size() == load.nodes.size()
                                         : areas.size() == load.nodes.size() && load.shares.empty();
  if (!is_complete) return "it needs one share, or one area, for each node";
  const auto is_share = [](double share) { return std::abs(share) <= kMaxLoadShare; };
  const auto is_area = [](const Vec3d& area) { return is_within(area, kMaxLoadShare); };
  if (!std::ranges::all_of(load.shares, is_share) || !std::ranges::all_of(areas, is_area))
    return "a node's share is not within " + std::to_string(std::llround(kMaxLoadShare));
  return wrong_curve(load.over_time, kMaxLoad);
}

}  // namespace

Status validate(const LoadRules& rules, const organ::Organ& organ) {
  std::vector<std::uint8_t> held(organ.mesh.node_count());
  for (const auto node : organ.fixed_nodes) held[node.value] = kAllAxes;
  const auto check = [](const char* kind, std::size_t i, const std::string& wrong) -> Status {
    if (wrong.empty()) return {};
    return Error{ErrorCode::BadFile, kind + ("[" + std::to_string(i)) + "]: " + wrong};
  };
  for (std::size_t i = 0; i < rules.displaced.size(); ++i)
    if (auto s = check("displaced", i, wrong_displacement(rules.displaced[i], held)); !s) return s;
  for (std::size_t i = 0; i < rules.forces.size(); ++i)
    if (auto s = check("loaded", i, wrong_force(rules.forces[i], held.size())); !s) return s;
  return {};
}

Vec3d TimedVector::at(double time_s) const {
  if (time_s <= keys.front().time_s) return keys.front().value;
  for (std::size_t i = 1; i < keys.size(); ++i) {
    if (time_s > keys[i].time_s) continue;
    const auto& [t0, a] = keys[i - 1];
    const auto& [t1, b] = keys[i];
    return a + (b - a) * ((time_s - t0) / (t1 - t0));
  }
  return keys.back().value;
}

ExternalLoads::ExternalLoads(const LoadRules& rules, std::span<const NodeIndex> fixed,
                             std::size_t node_count)
    : rules_(rules), fixed_(fixed.begin(), fixed.end()), organ_nodes_(node_count) {
  const auto moves = [](const auto& key) { return length(key.value) > 0; };
  for (const auto& load : rules_.displaced)
    if (std::ranges::any_of(load.over_time.keys, moves)) seeds_.push_back(load.nodes);
  for (const auto& load : rules_.forces) seeds_.push_back(load.nodes);
  start();
}

// The lists of the uncut organ. One axis hold per node, though several sets may hold it.
void ExternalLoads::start() {
  node_count_ = organ_nodes_;
  held_ = fixed_;
  axis_holds_.clear();
  between_.clear();
  axis_between_.clear();
  for (const auto& load : rules_.displaced) {
    if (load.axes == kAllAxes)
      held_.insert(held_.end(), load.nodes.begin(), load.nodes.end());
    else
      for (const auto node : load.nodes) axis_holds_.push_back({node, 0, {}});
  }
  std::ranges::sort(axis_holds_, {}, &dynamics::AxisHold::node);
  const auto is_same = [](const auto& a, const auto& b) { return a.node == b.node; };
  axis_holds_.erase(std::unique(axis_holds_.begin(), axis_holds_.end(), is_same),
                    axis_holds_.end());
  hold_of_.assign(organ_nodes_, kNone);
  axis_hold_of_.assign(organ_nodes_, kNone);
  for (std::size_t i = 0; i < held_.size(); ++i)
    hold_of_[held_[i].value] = static_cast<std::uint32_t>(i);
  for (std::size_t i = 0; i < axis_holds_.size(); ++i)
    axis_hold_of_[axis_holds_[i].node.value] = static_cast<std::uint32_t>(i);
  for (const auto& load : rules_.displaced)
    if (load.axes != kAllAxes)
      for (const auto node : load.nodes) axis_holds_[axis_hold_of_[node.value]].axes |= load.axes;
  held_displacements_.assign(held_.size(), Vec3f{});
  if (!rules_.forces.empty()) forces_.assign(organ_nodes_, Vec3f{});
  for (auto& watched : watched_) {
    watched.has.resize(organ_nodes_);
    std::erase_if(watched.nodes, [this](NodeIndex n) { return n.value >= organ_nodes_; });
  }
}

void ExternalLoads::update(const world::World& world) {
  if (world.node_count() < node_count_) start();  // of a state before those cuts
  if (world.node_count() == node_count_) return;
  hold_of_.resize(world.node_count(), kNone);
  axis_hold_of_.resize(world.node_count(), kNone);
  for (; node_count_ < world.node_count(); ++node_count_)
    add_hold(NodeIndex(node_count_), world.origins[node_count_ - organ_nodes_]);
  held_displacements_.resize(held_.size());
  if (!rules_.forces.empty()) forces_.resize(node_count_);
}

void ExternalLoads::add_hold(NodeIndex node, const world::NodeOrigin& origin) {
  const float t = static_cast<float>(origin.t) / 65536.0f;
  if (const auto a = hold_of_[origin.a.value], b = hold_of_[origin.b.value];
      a != kNone && b != kNone) {
    hold_of_[node.value] = static_cast<std::uint32_t>(held_.size());
    between_.push_back({held_.size(), a, b, t});
    held_.push_back(node);
  }
  for (auto& watched : watched_) {
    const bool is_in = watched.has[origin.a.value] != 0 && watched.has[origin.b.value] != 0;
    watched.has.push_back(is_in ? 1 : 0);
    if (is_in) watched.nodes.push_back(node);
  }
  const auto a = axis_hold_of_[origin.a.value], b = axis_hold_of_[origin.b.value];
  if (a == kNone || b == kNone) return;
  const auto axes = static_cast<std::uint8_t>(axis_holds_[a].axes & axis_holds_[b].axes);
  if (axes == 0) return;
  axis_hold_of_[node.value] = static_cast<std::uint32_t>(axis_holds_.size());
  axis_between_.push_back({axis_holds_.size(), a, b, t});
  axis_holds_.push_back({node, axes, {}});
}

void ExternalLoads::place(double time_s) {
  std::size_t entry = fixed_.size();
  for (const auto& load : rules_.displaced) {
    const Vec3f displacement = to_float(load.over_time.at(time_s));
    for (const auto node : load.nodes) {
      if (load.axes == kAllAxes)
        held_displacements_[entry++] = displacement;
      else
        set_axes(load.axes, displacement, axis_holds_[axis_hold_of_[node.value]].displacement);
    }
  }
  for (const auto& [made, a, b, t] : between_)
    held_displacements_[made] =
        held_displacements_[a] + (held_displacements_[b] - held_displacements_[a]) * t;
  for (const auto& [made, a, b, t] : axis_between_) {
    const Vec3f from = axis_holds_[a].displacement;
    axis_holds_[made].displacement = from + (axis_holds_[b].displacement - from) * t;
  }
}

void ExternalLoads::push(double time_s, const world::World& world) {
  std::ranges::fill(forces_, Vec3f{});
  for (const auto& load : rules_.forces) {
    const Vec3d value = load.over_time.at(time_s);
    for (std::size_t i = 0; i < load.nodes.size(); ++i)
      forces_[load.nodes[i].value] += to_float(load.on_node(i, value));
  }
  for (std::size_t n = organ_nodes_; n < forces_.size(); ++n) {
    const auto& origin = world.origins[n - organ_nodes_];
    if (origin.a != origin.b) continue;
    forces_[origin.a.value] = forces_[origin.a.value] * 0.5f;
    forces_[n] = forces_[origin.a.value];
  }
}

dynamics::ExternalLoads ExternalLoads::at(double time_s, const world::World& world) {
  update(world);
  place(time_s);
  if (!forces_.empty()) push(time_s, world);
  return {forces_, held_, held_displacements_, axis_holds_};
}

dynamics::ExternalLoads ExternalLoads::at_rest(const world::World& world) {
  update(world);
  std::ranges::fill(held_displacements_, Vec3f{});
  for (auto& hold : axis_holds_) hold.displacement = {};
  return {{}, held_, held_displacements_, axis_holds_};
}

std::size_t ExternalLoads::watch(std::span<const NodeIndex> nodes) {
  auto& watched = watched_.emplace_back();
  watched.nodes.assign(nodes.begin(), nodes.end());
  watched.has.resize(organ_nodes_);
  for (const auto node : nodes) watched.has[node.value] = 1;
  return watched_.size() - 1;
}

void ExternalLoads::measure(const dynamics::BlockDescent& solver,
                            const contact::ContactList& contacts) {
  for (auto& watched : watched_) {
    watched.force_n = {};
    for (const auto node : watched.nodes)
      watched.force_n += on_held_axes(node, to_double(solver.holding_force(contacts, node)));
  }
}

// Along the others the solver's figure is what it left out of balance.
Vec3d ExternalLoads::on_held_axes(NodeIndex node, Vec3d force_n) const {
  if (hold_of_[node.value] != kNone) return force_n;
  const auto hold = axis_hold_of_[node.value];
  const auto axes = hold == kNone ? std::uint8_t{0} : axis_holds_[hold].axes;
  if (!(axes & 1)) force_n.x = 0;
  if (!(axes & 2)) force_n.y = 0;
  if (!(axes & 4)) force_n.z = 0;
  return force_n;
}

}  // namespace trocar::step

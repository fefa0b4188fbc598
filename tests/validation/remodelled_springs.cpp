#include "tests/validation/remodelled_springs.h"

#include <algorithm>
#include <cmath>

#include "common/base/assert.h"

namespace trocar::validation {
namespace {

constexpr double kShareOfStable = 0.7;
// A cut near a node leaves others of some nanograms; with the springs of their short edges these
// would ask for steps of half a microsecond. Heavier, they still follow at once.
constexpr double kLeastStep_s = 1e-5;

std::pair<NodeIndex, NodeIndex> edge_of(NodeIndex a, NodeIndex b) {
  return std::minmax(a, b);
}

}  // namespace

RemodelledSprings::RemodelledSprings(const organ::Organ& organ, double viscosity_n_s_m)
    : organ_(organ),
      viscosity_n_s_m_(viscosity_n_s_m),
      topology_(organ),
      places_(topology_),
      positions_(organ.mesh.rest_positions),
      velocities_(positions_.size()),
      is_fixed_(positions_.size()) {
  for (const auto node : organ.fixed_nodes) is_fixed_[node.value] = 1;
  std::vector<NodeIndex> others;
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n) {
    topology_.neighbours_of(NodeIndex(n), others);
    for (const auto j : others) {
      const auto edge = edge_of(NodeIndex(n), j);
      springs_[edge] = {organ.material.spring_stiffness_n_m,
                        distance(edge) * (1 - organ.material.tension), false};
    }
  }
  list_pulls();
  take_masses();
}

double RemodelledSprings::distance(const Edge& edge) const {
  return length(positions_[edge.second.value] - positions_[edge.first.value]);
}

void RemodelledSprings::list_pulls() {
  pulls_.clear();
  for (const auto& [edge, spring] : springs_)
    pulls_.push_back(
        {edge.first.value, edge.second.value, spring.stiffness_n_m, spring.rest_length_m});
}

// The topology has been split already.
void RemodelledSprings::split(const cutting::Split& split) {
  const auto [a, b, t, node] = split;
  const auto between = [&, a = a, b = b, t = t](std::vector<Vec3d>& values) {
    values.push_back(cutting::along(values[a.value], values[b.value], t));
  };
  TROCAR_ASSERT(node.value == positions_.size());
  between(positions_);
  between(velocities_);
  is_fixed_.push_back(is_fixed_[a.value] & is_fixed_[b.value]);
  const auto old = springs_.extract(edge_of(a, b)).mapped();
  const double share = t / 65536.0;
  std::vector<NodeIndex> others;
  topology_.neighbours_of(node, others);
  for (const auto j : others) {
    auto& spring = springs_[edge_of(node, j)];
    if (j == a || j == b) {
      const double part = j == a ? share : 1 - share;
      spring = {old.stiffness_n_m / part, old.rest_length_m * part, old.is_of_ring};
    } else {
      spring = {organ_.material.spring_stiffness_n_m, distance(edge_of(node, j)), true};
    }
  }
}

void RemodelledSprings::move(const cutting::Move& move) {
  const auto [node, toward, t] = move;
  for (auto* values : {&positions_, &velocities_})
    (*values)[node.value] = cutting::along((*values)[node.value], (*values)[toward.value], t);
  std::vector<NodeIndex> others;
  topology_.neighbours_of(node, others);
  const auto rest = topology_.rest();
  for (const auto j : others) {
    auto& spring = springs_.at(edge_of(node, j));
    spring.rest_length_m = spring.is_of_ring ? distance(edge_of(node, j))
                                             : length(rest[j.value] - rest[node.value]) *
                                                   (1 - organ_.material.tension);
  }
}

void RemodelledSprings::open(std::span<const cutting::CutEvent> copies) {
  std::map<NodeIndex, NodeIndex> originals;
  std::vector<NodeIndex> touched, others;
  for (const auto& event : copies) {
    const auto& copy = std::get<cutting::Duplicate>(event);
    TROCAR_ASSERT(copy.copy.value == positions_.size());
    positions_.push_back(Vec3d(positions_[copy.node.value]));
    velocities_.push_back(Vec3d(velocities_[copy.node.value]));
    is_fixed_.push_back(std::uint8_t(is_fixed_[copy.node.value]));
    originals[copy.copy] = copy.node;
    touched.insert(touched.end(), {copy.node, copy.copy});
  }
  const auto original = [&](NodeIndex n) {
    const auto at = originals.find(n);
    return at == originals.end() ? n : at->second;
  };
  std::map<Edge, std::vector<Edge>> sides;  // per edge as it was
  for (const auto node : touched) {
    topology_.neighbours_of(node, others);
    for (const auto j : others)
      sides[edge_of(original(node), original(j))].push_back(edge_of(node, j));
  }
  for (auto& [old, edges] : sides) {
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    auto spring = springs_.extract(old).mapped();
    spring.stiffness_n_m /= static_cast<double>(edges.size());
    for (const auto& edge : edges) springs_[edge] = spring;
  }
}

Status RemodelledSprings::update(const cutting::CutEvents& events) {
  const std::span all(events.events);
  for (std::size_t at = 0; at < all.size();) {
    std::size_t end = at + 1;
    cutting::CutEvents part;
    auto event = all[at];
    if (auto* const open = std::get_if<cutting::Open>(&event)) {
      const auto faces = std::span(events.faces).subspan(open->first_face, open->face_count);
      part.faces.assign(faces.begin(), faces.end());
      open->first_face = 0;
      while (end < all.size() && std::holds_alternative<cutting::Duplicate>(all[end])) ++end;
    }
    part.events.push_back(event);
    part.events.insert(part.events.end(), all.begin() + static_cast<std::ptrdiff_t>(at + 1),
                       all.begin() + static_cast<std::ptrdiff_t>(end));
    if (auto status = cutting::apply(part, topology_, places_); !status) return status;
    if (const auto* was_split = std::get_if<cutting::Split>(&event)) split(*was_split);
    if (const auto* was_moved = std::get_if<cutting::Move>(&event)) move(*was_moved);
    if (std::holds_alternative<cutting::Open>(event)) open(all.subspan(at + 1, end - at - 1));
    at = end;
  }
  topology_.clear_changes();
  list_pulls();
  take_masses();
  return {};
}

double RemodelledSprings::energy_j() const {
  double sum = 0;
  for (const auto& [edge, spring] : springs_) {
    const double stretch = distance(edge) - spring.rest_length_m;
    sum += spring.stiffness_n_m * stretch * stretch / 2;
  }
  return sum;
}

// The highest frequency is at most that of the node with the most stiffness per mass, twice.
void RemodelledSprings::take_masses() {
  std::vector<double> stiffness(topology_.node_count());
  for (const auto& pull : pulls_) {
    stiffness[pull.a] += pull.stiffness_n_m;
    stiffness[pull.b] += pull.stiffness_n_m;
  }
  masses_.resize(topology_.node_count());
  double total = 0, most = 0;
  added_mass_ = 0;
  for (std::uint32_t n = 0; n < masses_.size(); ++n) {
    const double mass = topology_.lumped_mass(NodeIndex(n));
    const double per_rate = kLeastStep_s / (2 * kShareOfStable);
    masses_[n] = std::max(mass, 2 * stiffness[n] * per_rate * per_rate);
    total += mass;
    added_mass_ += masses_[n] - mass;
    if (is_fixed_[n] == 0) most = std::max(most, stiffness[n] / masses_[n]);
  }
  added_mass_ /= total;
  stable_step_s_ = kShareOfStable * 2 / std::sqrt(2 * most);
}

void RemodelledSprings::advance(double seconds, std::span<const std::uint8_t> held) {
  const double steps = std::ceil(seconds / stable_step_s_), dt = seconds / steps;
  for (double s = 0; s < steps; ++s) {
    forces_.assign(positions_.size(), {});
    for (const auto& pull : pulls_) {
      const Vec3d r = positions_[pull.b] - positions_[pull.a];
      const double now = length(r);
      if (!(now > 0)) continue;
      const Vec3d force = r * (pull.stiffness_n_m * (now - pull.rest_length_m) / now);
      forces_[pull.a] += force;
      forces_[pull.b] = forces_[pull.b] - force;
    }
    for (std::size_t n = 0; n < positions_.size(); ++n) {
      if (is_fixed_[n] != 0) continue;
      auto& v = velocities_[n];
      v = (v + forces_[n] * (dt / masses_[n])) * (1 / (1 + dt * viscosity_n_s_m_ / masses_[n]));
      if (held[n] != 0) v.y = 0;
      positions_[n] += v * dt;
    }
  }
}

}  // namespace trocar::validation

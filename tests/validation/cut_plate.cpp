#include "tests/validation/cut_plate.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "common/base/assert.h"

namespace trocar::validation {
namespace {

constexpr std::uint8_t kCutDepth = 2;  // the y axis
constexpr double kOnFace_m = 1e-6;
constexpr std::uint32_t kMaxCalls = 10'000;

dynamics::SolveSettings solve_settings(float dt) {
  return {.sweeps = 60, .over_relaxation = 1.6f, .dt = dt, .residual_tolerance_n = 1e-6f};
}

double half_thickness(const organ::Organ& organ) {
  double most = 0;
  for (const auto& p : organ.mesh.rest_positions) most = std::max(most, p.y);
  return most;
}

void add(cutting::CutOutput& sum, const cutting::CutOutput& more) {
  sum.events.append(more.events);
  sum.opened_area_m2 += more.opened_area_m2;
  sum.waiting_area_m2 += more.waiting_area_m2;
  sum.crossed_tets += more.crossed_tets;
  sum.splits += more.splits;
  sum.labels += more.labels;
  sum.four_tets += more.four_tets;
  sum.six_tets += more.six_tets;
  sum.other_tets += more.other_tets;
  sum.moved_nodes += more.moved_nodes;
  sum.refused_moves += more.refused_moves;
  sum.smoothed_nodes += more.smoothed_nodes;
}

}  // namespace

CutPlate::CutPlate(organ::Organ organ, const cutting::Settings& settings, Mechanics mechanics)
    : organ_(std::make_unique<const organ::Organ>(std::move(organ))),
      half_thickness_(half_thickness(*organ_)),
      topology_(*organ_),
      cutter_(topology_, settings),
      world_(*organ_),
      solver_(*organ_, world_) {
  const auto& material = organ_->material;
  if (mechanics == Mechanics::AsPrinted)
    springs_ = std::make_unique<RemodelledSprings>(
        *organ_, material.edge_damping_time_s * material.spring_stiffness_n_m);
  list_nodes();
}

void CutPlate::list_nodes() {
  free_.clear();
  holds_.clear();
  is_held_.assign(topology_.node_count(), 0);
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n) {
    if (world_.node_classes[n] == world::NodeClass::Fixed) continue;
    free_.emplace_back(n);
    if (std::abs(topology_.rest()[n].y) > half_thickness_ - kOnFace_m)
      holds_.push_back({.node = NodeIndex(n), .axes = kCutDepth, .displacement = {}});
    is_held_[n] = !holds_.empty() && holds_.back().node.value == n;
  }
}

void CutPlate::step(float dt) {
  if (springs_) {
    springs_->advance(static_cast<double>(dt), is_held_);
    take_positions();
    return;
  }
  solver_.solve({}, free_, solve_settings(dt), world_,
                dynamics::ExternalLoads{.axis_holds = holds_});
}

void CutPlate::take_positions() {
  for (std::size_t n = 0; n < world_.node_count(); ++n)
    world_.displacements[n] = to_float(springs_->positions()[n] - topology_.rest()[n]);
}

void CutPlate::cut(const std::array<Vec3d, 2>& from, const std::array<Vec3d, 2>& to) {
  cutter_.move(0, from);
  cutter_.move(0, to);
  cutter_.lift(0);
  cutting::CutOutput call;
  output_.clear();
  if (springs_) energies_j_[0] = springs_->energy_j();
  for (std::uint32_t i = 0; i < kMaxCalls && !cutter_.is_idle(); ++i) {
    cutter_.cut(world_.displacements, call);
    world_.apply({topology_, call.new_nodes, {}});
    for (const auto& made : call.new_nodes)
      if (made.is_copy()) parted_.push_back({made.a, made.node});
    add(output_, call);
    if (!springs_) continue;
    const auto status = springs_->update(call.events);
    TROCAR_ASSERT(status);
  }
  if (springs_) energies_j_[1] = springs_->energy_j();
  update();
}

void CutPlate::update() {
  solver_.update_topology(topology_, world_);
  topology_.clear_changes();
  solver_.read_state(world_);
  list_nodes();
}

Vec3d CutPlate::position(NodeIndex node) const {
  return topology_.rest()[node.value] + to_double(world_.displacements[node.value]);
}

ElementCounts CutPlate::counts() const {
  ElementCounts counts;
  std::set<std::pair<NodeIndex, NodeIndex>> edges;
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n)
    counts.nodes += topology_.has_node(NodeIndex(n)) ? 1 : 0;
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t) {
    if (!topology_.has_tet(TetIndex(t))) continue;
    ++counts.tets;
    const auto& tet = topology_.tet(TetIndex(t));
    for (std::uint8_t i = 0; i < 4; ++i) {
      if (!cutting::across(topology_, {TetIndex(t), i})) ++counts.polygons;
      for (std::uint8_t j = 0; j < i; ++j) edges.insert(std::minmax(tet[i], tet[j]));
    }
  }
  counts.edges = edges.size();
  return counts;
}

template <typename Place>
double CutPlate::wound_area(Place&& place) const {
  double sum = 0;
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t)
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      if ((topology_.wound_faces(TetIndex(t)) >> corner & 1) == 0) continue;
      const auto nodes = cutting::face_nodes(topology_.tet(TetIndex(t)), corner);
      const Vec3d p = place(nodes[0]);
      sum += length(cross(place(nodes[1]) - p, place(nodes[2]) - p)) / 2;
    }
  return sum;
}

double CutPlate::wound_area() const {
  return wound_area([&](NodeIndex n) { return position(n); });
}

double CutPlate::wound_area_at_rest() const {
  return wound_area([&](NodeIndex n) { return topology_.rest()[n.value]; });
}

std::vector<double> CutPlate::dihedrals_rad() const {
  std::vector<double> angles;
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t)
    if (topology_.has_tet(TetIndex(t)))
      angles.push_back(std::asin(
          cutting::least_sine(cutting::rest_corners(topology_, topology_.tet(TetIndex(t))))));
  std::sort(angles.begin(), angles.end());
  return angles;
}

double CutPlate::opening() const {
  double most = 0;
  for (const auto& [node, copy] : parted_)
    most = std::max(most, length(position(node) - position(copy)));
  return most;
}

std::vector<std::array<Vec3d, 2>> CutPlate::upper_edges(bool is_of_wound) const {
  const auto is_upper = [&](NodeIndex n) {
    return topology_.rest()[n.value].y > half_thickness_ - kOnFace_m;
  };
  std::set<std::pair<NodeIndex, NodeIndex>> edges;
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t)
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const bool is_wound = (topology_.wound_faces(TetIndex(t)) >> corner & 1) != 0;
      if (!topology_.has_tet(TetIndex(t)) || is_wound != is_of_wound) continue;
      const auto nodes = cutting::face_nodes(topology_.tet(TetIndex(t)), corner);
      if (!is_wound && !std::ranges::all_of(nodes, is_upper)) continue;
      for (std::size_t i = 0; i < 3; ++i)
        if (is_upper(nodes[i]) && is_upper(nodes[(i + 1) % 3]))
          edges.insert(std::minmax(nodes[i], nodes[(i + 1) % 3]));
    }
  std::vector<std::array<Vec3d, 2>> ends;
  for (const auto& [a, b] : edges) ends.push_back({position(a), position(b)});
  return ends;
}

}  // namespace trocar::validation

#include "server/tissue/cutting/cut_mesh.h"

#include <algorithm>

#include "common/base/assert.h"
#include "server/organs/organ/organ.h"

namespace trocar::cutting {
namespace {

constexpr double kShareOfWorst = 0.9;

// sin(share asin(sine)) by series; for small angles, where floors are.
double sine_of_share(double sine, double share) {
  const double s2 = sine * sine;
  const double angle = share * sine * (1 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336))));
  const double a2 = angle * angle;
  return angle * (1 - a2 * (1.0 / 6 - a2 * (1.0 / 120 - a2 / 5040)));
}

}  // namespace

void CutOutput::clear() {
  auto kept_events = std::move(events);
  auto kept_nodes = std::move(new_nodes);
  kept_events.clear();
  kept_nodes.clear();
  *this = {};
  events = std::move(kept_events);
  new_nodes = std::move(kept_nodes);
}

CutMesh::CutMesh(topology::Topology& topology, const Settings& settings, std::span<Stroke> strokes)
    : topology_(topology), settings_(settings), strokes_(strokes), places_(topology) {
  TROCAR_ASSERT(!topology.has_links());
  measure_scale();
  bundles_.emplace(topology.rest(), reach_);
}

void CutMesh::measure_scale() {
  h_.assign(topology_.node_count(), 0);
  reach_.assign(topology_.node_count(), 0);
  std::vector<NodeIndex> neighbours;
  double total = 0, worst = 1;
  std::size_t nodes = 0;
  for (std::uint32_t n = 0; n < topology_.node_count(); ++n) {
    topology_.neighbours_of(NodeIndex(n), neighbours);
    if (neighbours.empty()) continue;
    for (const auto j : neighbours) {
      const double edge = length(topology_.rest()[j.value] - topology_.rest()[n]);
      h_[n] += edge;
      reach_[n] = std::max(reach_[n], edge);
    }
    h_[n] /= static_cast<double>(neighbours.size());
    longest_reach_ = std::max(longest_reach_, reach_[n]);
    total += h_[n];
    ++nodes;
  }
  mean_h_ = nodes > 0 ? total / static_cast<double>(nodes) : 0;
  for (std::uint32_t t = 0; t < topology_.tet_count(); ++t)
    if (topology_.has_tet(TetIndex(t)))
      worst = std::min(worst, least_sine(rest_corners(topology_, topology_.tet(TetIndex(t)))));
  floor_sine_ = settings_.floor_sine;
  if (worst * kShareOfWorst < floor_sine_)
    floor_sine_ = std::min(floor_sine_, sine_of_share(worst, kShareOfWorst));
}

void CutMesh::begin(std::span<const Vec3f> displacements, double travel_m, CutOutput& out) {
  TROCAR_ASSERT(displacements.empty() || displacements.size() >= topology_.node_count());
  out_ = &out;
  displacements_ = displacements;
  travel_m_ = travel_m < kUnknownTravel ? travel_m : 0;
  if (!(travel_m < kUnknownTravel)) bundles_->forget();
}

void CutMesh::end() {
  for (const auto& made : out_->new_nodes) is_made_[made.node.value] = 0;
  displacements_ = {};
  out_ = nullptr;
}

void CutMesh::collect(std::span<const PatchTriangle> patch, double reaches,
                      std::vector<NodeIndex>& out) {
  out.clear();
  Box box;
  for (const auto& triangle : patch)
    for (const auto& p : triangle.corners) box.include(p);
  box.grow(reaches * longest_reach_);
  const auto place = [this](NodeIndex n) { return position(n); };
  const auto may_hold = [&](const Vec3d& centre, double radius, double reach) {
    const double slack = radius + reaches * reach;
    return std::ranges::any_of(patch, [&](const PatchTriangle& triangle) {
      return std::abs(signed_distance(triangle, centre)) <= slack &&
             is_inside(triangle, centre, slack);
    });
  };
  bundles_->collect(box, travel_m_, place, may_hold, out);
  std::erase_if(out, [this](NodeIndex n) { return !topology_.has_node(n); });
  std::sort(out.begin(), out.end());
}

double CutMesh::length_floor_h() const {
  const auto uncut =
      std::max<std::size_t>(topology_.organ().mesh.tets.size(), settings_.roomy_tets);
  const double growth = static_cast<double>(topology_.tet_count()) / static_cast<double>(uncut);
  if (growth < settings_.growing) return settings_.length_floor_h;
  return growth < settings_.grown ? settings_.growing_length_floor_h
                                  : settings_.grown_length_floor_h;
}

double CutMesh::sine_after_split(NodeIndex a, NodeIndex b, std::uint16_t t, double least_h) {
  const auto rest = topology_.rest();
  const double edge = length(rest[b.value] - rest[a.value]), share = t / 65536.0;
  const double least_length = least_h * (h_[a.value] + h_[b.value]) / 2;
  if (t == 0 || edge * std::min(share, 1 - share) < least_length) return -1;
  const Vec3d middle = along(rest[a.value], rest[b.value], t);
  ring_of(topology_, a, b, ring_);
  double least = 1;
  for (const auto tet : ring_)
    for (const auto end : {a, b}) {
      auto corners = rest_corners(topology_, topology_.tet(tet));
      corners[corner_of(topology_.tet(tet), end)] = middle;
      least = std::min(least, least_sine(corners));
    }
  return least;
}

void CutMesh::measure_scale_of(const topology::NewNode& made) {
  h_.resize(topology_.node_count());
  reach_.resize(topology_.node_count());
  const auto n = made.node.value, a = made.a.value, b = made.b.value;
  h_[n] = h_[a] + (h_[b] - h_[a]) * (made.t / 65536.0);
  reach_[n] = 0;
  topology_.for_each_neighbour(made.node, [&](NodeIndex j) {
    reach_[n] = std::max(reach_[n], length(topology_.rest()[j.value] - topology_.rest()[n]));
  });
}

void CutMesh::add_node(const topology::NewNode& made) {
  measure_scale_of(made);
  made_.resize(topology_.node_count());
  is_made_.resize(topology_.node_count());
  made_[made.node.value] = along(position(made.a), position(made.b), made.t);
  is_made_[made.node.value] = 1;
  bundles_->add(made.node, made.a, reach(made.node), travel_m_,
                [this](NodeIndex n) { return position(n); });
  out_->new_nodes.push_back(made);
}

Status CutMesh::repeat(const CutEvents& events, std::vector<topology::NewNode>& made_nodes) {
  const auto place = [this](NodeIndex n) { return topology_.rest()[n.value]; };
  made_nodes.clear();
  auto status = apply(events, topology_, places_, [&](const topology::NewNode& made) {
    made_nodes.push_back(made);
    if (made.has_moved()) return update_moved_node(made);
    measure_scale_of(made);
    bundles_->add(made.node, made.a, reach(made.node), 0, place);
  });
  bundles_->forget();
  return status;
}

NodeIndex CutMesh::split(NodeIndex a, NodeIndex b, std::uint16_t t) {
  const auto node = split_edge(topology_, places_, a, b, t, children_);
  add_node({node, a, b, t});
  for (auto& stroke : strokes_)
    if (stroke.is_active)
      for (const auto& [parent, child] : children_) stroke.inherit(parent, child);
  out_->events.events.push_back(Split{a, b, t, node});
  ++out_->splits;
  return node;
}

void CutMesh::move(const Move& move) {
  const Vec3d now = along(position(move.node), position(move.toward), move.t);
  move_node(topology_, move);
  made_.resize(topology_.node_count());
  is_made_.resize(topology_.node_count());
  made_[move.node.value] = now;
  is_made_[move.node.value] = 1;
  const topology::NewNode moved{move.node, move.node, move.toward, move.t};
  update_moved_node(moved);
  out_->new_nodes.push_back(moved);
  out_->events.events.emplace_back(move);
}

// Its neighbours may reach farther now, and bundles hold for nodes that move with the tissue.
void CutMesh::update_moved_node(const topology::NewNode& moved) {
  measure_scale_of(moved);
  topology_.for_each_neighbour(moved.node, [&](NodeIndex j) {
    const double edge = length(topology_.rest()[j.value] - topology_.rest()[moved.node.value]);
    reach_[j.value] = std::max(reach_[j.value], edge);
    longest_reach_ = std::max(longest_reach_, edge);
  });
  bundles_->forget();
}

void CutMesh::open(std::span<const TetFace> faces, std::span<const Star> stars) {
  auto& events = out_->events;
  events.events.push_back(Open{static_cast<std::uint32_t>(events.faces.size()),
                               static_cast<std::uint32_t>(faces.size())});
  for (const auto& face : faces) {
    events.faces.push_back(face);
    const double area = face_area(topology_, face);
    out_->opened_area_m2 += area;
    out_->work_j +=
        area *
        organ::material_at(topology_.organ(), topology_.material_of(face.tet)).cut_energy_j_m2;
  }
  copies_.clear();
  mark_wound(topology_, faces);
  part(topology_, places_, stars, copies_);
  for (const auto& copy : copies_) {
    events.events.push_back(copy);
    add_node({copy.copy, copy.node, copy.node, 0});
    for (auto& stroke : strokes_)
      if (stroke.is_active) stroke.inherit(copy.node, copy.copy);
  }
}

}  // namespace trocar::cutting

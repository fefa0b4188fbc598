#include "server/papers/nakao/adaptive_splitter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

namespace trocar::nakao {
namespace {

using namespace cutting;

constexpr double kMostStretch = 1.5;  // of an edge, over its length at rest
constexpr double kSlack_h = 1e-6;
constexpr double kOnPlane = 1.0 / 64;  // share of an edge
constexpr double kSmoothing = 0.5;     // of the way to the mean of the neighbours
constexpr int kBisections = 30;

// Never nothing.
std::uint16_t quantised(double share) {
  return std::max<std::uint16_t>(1, quantised_share(share));
}

template <typename T>
void sort_unique(std::vector<T>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

bool is_inside_patch(std::span<const PatchTriangle> patch, const Vec3d& p, double slack) {
  return std::ranges::any_of(
      patch, [&](const PatchTriangle& triangle) { return is_inside(triangle, p, slack); });
}

bool is_surface_edge(const dynamics::Topology& topology, std::span<const TetIndex> ring,
                     NodeIndex a, NodeIndex b) {
  for (const auto t : ring)
    for (std::uint8_t corner = 0; corner < 4; ++corner)
      if (topology.tet(t)[corner] != a && topology.tet(t)[corner] != b &&
          !across(topology, {t, corner}))
        return true;
  return false;
}

// Steps that end at (1 - share) node + share x mean of ends: the last goes share / count, those
// before more, because later ones take back a part.
template <typename Step>
bool step_to_mean(std::size_t count, double share, Step&& step) {
  const double each = share / static_cast<double>(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto later = static_cast<double>(count - 1 - i);
    if (!step(i, quantised(each / (1 - later * each)))) return false;
  }
  return true;
}

template <Variant kVariant>
std::unique_ptr<PatchSplitter> make() {
  return std::make_unique<AdaptiveSplitter>(kVariant);
}

}  // namespace

Settings settings_of(Variant variant, double piece_h) {
  Settings settings;
  settings.make_splitter =
      variant == Variant::Adaptive ? make<Variant::Adaptive> : make<Variant::Plain>;
  settings.extension_h = 0;
  settings.piece_h = settings.collect_h = piece_h;
  settings.collect_ticks = 0xffffffff;
  settings.debris_tets = 0;
  settings.debris_volume_h3 = 0;
  return settings;
}

double AdaptiveSplitter::height(const CutMesh& mesh, std::span<const PatchTriangle> patch,
                                NodeIndex n) const {
  const auto p = mesh.position(n);
  double nearest = std::numeric_limits<double>::infinity(), height = 0;
  for (const auto& triangle : patch) {
    const double d = distance_squared(triangle, p);
    if (!(d < nearest)) continue;
    nearest = d;
    height = signed_distance(triangle, p);
  }
  return height;
}

void AdaptiveSplitter::measure(CutMesh& mesh, Stroke& stroke,
                               std::span<const PatchTriangle> patch) {
  mesh.collect(patch, kMostStretch, near_);
  stroke.h = near_.empty() ? stroke.h : 0;
  for (const auto node : near_) {
    stroke.h += mesh.h(node) / static_cast<double>(near_.size());
    if (stroke.is_labelled(node)) continue;
    const auto p = mesh.position(node);
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& triangle : patch) nearest = std::min(nearest, distance_squared(triangle, p));
    stroke.measure(node, {nearest, height(mesh, patch, node)});
  }
}

void AdaptiveSplitter::find_inside(const CutMesh& mesh, const Stroke& stroke,
                                   std::span<const PatchTriangle> patch) {
  crossings_.clear();
  for (const auto a : near_) {
    if (stroke.is_labelled(a)) continue;
    mesh.topology().neighbours_of(a, ends_);
    const auto pa = mesh.position(a);
    for (const auto b : ends_) {
      if (b < a || stroke.is_labelled(b)) continue;
      const auto pb = mesh.position(b);
      for (const auto& triangle : patch) {
        const double da = signed_distance(triangle, pa), db = signed_distance(triangle, pb);
        if ((da < 0) == (db < 0)) continue;
        const double t = da / (da - db);
        if (!is_inside(triangle, pa + (pb - pa) * t, kSlack_h * mesh.h(a))) continue;
        crossings_.push_back({a, b, t, true, {}});
        break;
      }
    }
  }
}

void AdaptiveSplitter::label_on_plane(CutMesh& mesh, Stroke& stroke) {
  for (const auto& crossing : crossings_) {
    const bool is_at_a = crossing.t < kOnPlane;
    if (!is_at_a && crossing.t <= 1 - kOnPlane) continue;
    if (stroke.is_labelled(crossing.a) || stroke.is_labelled(crossing.b)) continue;
    stroke.label(is_at_a ? crossing.a : crossing.b);
    ++mesh.out().labels;
  }
  std::erase_if(crossings_, [&](const Crossing& crossing) {
    return stroke.is_labelled(crossing.a) || stroke.is_labelled(crossing.b);
  });
}

std::optional<std::uint32_t> AdaptiveSplitter::find(NodeIndex a, NodeIndex b) const {
  const auto key = std::minmax(a, b);
  const auto at = std::lower_bound(
      crossings_.begin(), crossings_.end(), key, [](const Crossing& crossing, const auto& wanted) {
        return std::tie(crossing.a, crossing.b) < std::tie(wanted.first, wanted.second);
      });
  if (at == crossings_.end() || at->a != key.first || at->b != key.second) return std::nullopt;
  return static_cast<std::uint32_t>(at - crossings_.begin());
}

// Tets with an edge crossed inside C, and their other crossed edges.
void AdaptiveSplitter::complete_tets(CutMesh& mesh, const Stroke& stroke,
                                     std::span<const PatchTriangle> patch) {
  const auto& topology = mesh.topology();
  tets_.clear();
  for (const auto& crossing : crossings_) {
    ring_of(topology, crossing.a, crossing.b, ring_);
    tets_.insert(tets_.end(), ring_.begin(), ring_.end());
  }
  sort_unique(tets_);
  std::vector<Crossing> outside;
  for (const auto t : tets_) {
    const auto& tet = topology.tet(t);
    std::uint32_t crossed = 0;
    bool has_label = false;
    for (std::size_t i = 0; i < 4; ++i) {
      has_label = has_label || stroke.is_labelled(tet[i]);
      for (std::size_t j = i + 1; j < 4; ++j) {
        const auto [a, b] = std::minmax(tet[i], tet[j]);
        if (stroke.is_labelled(a) || stroke.is_labelled(b)) continue;
        if (find(a, b)) {
          ++crossed;
          continue;
        }
        const double ha = height(mesh, patch, a), hb = height(mesh, patch, b);
        if ((ha < 0) == (hb < 0)) continue;
        ++crossed;
        outside.push_back({a, b, std::clamp(ha / (ha - hb), kOnPlane, 1 - kOnPlane), false, {}});
      }
    }
    auto& out = mesh.out();
    ++(has_label || crossed < 3 ? out.other_tets : crossed == 3 ? out.four_tets : out.six_tets);
  }
  mesh.out().crossed_tets += static_cast<std::uint32_t>(tets_.size());
  crossings_.insert(crossings_.end(), outside.begin(), outside.end());
  const auto by_nodes = [](const Crossing& x, const Crossing& y) {
    return std::tie(x.a, x.b) < std::tie(y.a, y.b);
  };
  std::sort(crossings_.begin(), crossings_.end(), by_nodes);
  const auto is_same = [](const Crossing& x, const Crossing& y) {
    return x.a == y.a && x.b == y.b;
  };
  crossings_.erase(std::unique(crossings_.begin(), crossings_.end(), is_same), crossings_.end());
}

// Sides of a section lie in faces: those of the edge whose third node has an edge crossed inside
// with one of its ends, or is on the wound inside C.
void AdaptiveSplitter::add_ends(const CutMesh& mesh, const Stroke& stroke,
                                std::span<const PatchTriangle> patch, Pull& pull) const {
  const auto& topology = mesh.topology();
  const auto& own = crossings_[pull.crossing];
  std::vector<TetIndex> ring;
  ring_of(topology, own.a, own.b, ring);
  const bool is_on_surface = is_surface_edge(topology, ring, own.a, own.b);
  for (const auto t : ring) {
    if (!std::binary_search(tets_.begin(), tets_.end(), t)) continue;
    const auto& tet = topology.tet(t);
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      if (tet[corner] == own.a || tet[corner] == own.b) continue;
      if (is_on_surface && across(topology, {t, corner})) continue;
      for (const auto third : face_nodes(tet, corner)) {
        if (third == own.a || third == own.b) continue;
        if (stroke.is_labelled(third)) {
          if (is_inside_patch(patch, mesh.position(third), kSlack_h * stroke.h))
            pull.nodes.push_back(third);
          continue;
        }
        for (const auto end : {own.a, own.b})
          if (const auto other = find(third, end); other && crossings_[*other].is_inside)
            pull.crossings.push_back(*other);
      }
    }
  }
  sort_unique(pull.crossings);
  sort_unique(pull.nodes);
}

Vec3d AdaptiveSplitter::mean_end(const CutMesh& mesh, const Pull& pull, bool is_at_rest) const {
  const auto place = [&](NodeIndex n) {
    return is_at_rest ? mesh.topology().rest()[n.value] : mesh.position(n);
  };
  Vec3d sum;
  for (const auto c : pull.crossings) {
    const auto& crossing = crossings_[c];
    sum += along(place(crossing.a), place(crossing.b), quantised(crossing.t));
  }
  for (const auto n : pull.nodes) sum += place(n);
  return sum / static_cast<double>(pull.crossings.size() + pull.nodes.size());
}

void AdaptiveSplitter::find_pulls(const CutMesh& mesh, const Stroke& stroke,
                                  std::span<const PatchTriangle> patch) {
  pulls_.clear();
  for (std::uint32_t c = 0; c < crossings_.size(); ++c) {
    const auto& crossing = crossings_[c];
    if (crossing.is_inside) continue;
    auto& pull = pulls_.emplace_back();
    pull.crossing = c;
    add_ends(mesh, stroke, patch, pull);
    if (pull.crossings.empty() && pull.nodes.empty()) continue;
    const auto from =
        along(mesh.position(crossing.a), mesh.position(crossing.b), quantised(crossing.t));
    const Vec3d way = mean_end(mesh, pull, false) - from;
    double out = 0, in = 1;
    if (!is_inside_patch(patch, from + way, kSlack_h * stroke.h)) continue;
    for (int i = 0; i < kBisections; ++i) {
      const double middle = (out + in) / 2;
      (is_inside_patch(patch, from + way * middle, 0) ? in : out) = middle;
    }
    pull.share = in;
  }
}

void AdaptiveSplitter::split(CutMesh& mesh, Stroke& stroke) {
  cuts_.clear();
  const auto rest = mesh.topology().rest();
  for (const auto& [a, b, t, is_inside, node] : crossings_) {
    const auto q = quantised(t);
    cuts_.push_back({a, b, q, along(rest[a.value], rest[b.value], q)});
  }
  for (const auto& pull : pulls_) {
    auto& place = cuts_[pull.crossing].place;
    if (pull.share > 0) place += (mean_end(mesh, pull, true) - place) * pull.share;
  }
  std::vector<std::uint32_t> order(cuts_.size());
  std::iota(order.begin(), order.end(), 0u);
  if (is_adaptive_) {
    const auto chosen = subdivision_.order(mesh.topology(), cuts_);
    order.assign(chosen.begin(), chosen.end());
  }
  for (const auto c : order) {
    crossings_[c].node = mesh.split(cuts_[c].a, cuts_[c].b, cuts_[c].t);
    stroke.label(crossings_[c].node);
  }
}

void AdaptiveSplitter::pull_all(CutMesh& mesh) {
  pulled_.clear();
  for (const auto& pull : pulls_) {
    const auto node = crossings_[pull.crossing].node;
    ends_ = pull.nodes;
    for (const auto c : pull.crossings) ends_.push_back(crossings_[c].node);
    const bool has_come =
        pull.share > 0 && step_to_mean(ends_.size(), pull.share, [&](std::size_t i, auto t) {
          const Move move{node, ends_[i], t};
          if (!can_move(mesh.topology(), move)) return false;
          mesh.move(move);
          return true;
        });
    if (has_come) pulled_.push_back(node);
    ++(has_come ? mesh.out().moved_nodes : mesh.out().refused_moves);
  }
}

// Smooths those neighbours of nodes that moved that are not on the wound.
void AdaptiveSplitter::smooth(CutMesh& mesh, const Stroke& stroke) {
  std::vector<NodeIndex> beside;
  for (const auto node : pulled_)
    mesh.topology().for_each_neighbour(node, [&](NodeIndex n) {
      if (!stroke.is_labelled(n)) beside.push_back(n);
    });
  sort_unique(beside);
  for (const auto node : beside)
    if (smooth(mesh, node)) ++mesh.out().smoothed_nodes;
}

bool AdaptiveSplitter::smooth(CutMesh& mesh, NodeIndex node) {
  const auto& topology = mesh.topology();
  ends_.clear();
  for (const auto t : topology.tets_of(node))
    for (std::uint8_t corner = 0; corner < 4; ++corner)
      if (topology.tet(t)[corner] != node && !across(topology, {t, corner}))
        for (const auto n : face_nodes(topology.tet(t), corner)) ends_.push_back(n);
  if (ends_.empty()) topology.neighbours_of(node, ends_);
  std::erase(ends_, node);
  sort_unique(ends_);
  const auto rest = topology.rest();
  Vec3d mean;
  for (const auto n : ends_) mean += rest[n.value] / static_cast<double>(ends_.size());
  const Vec3d place = rest[node.value] + (mean - rest[node.value]) * kSmoothing;
  double before = 1, after = 1;
  for (const auto t : topology.tets_of(node)) {
    auto corners = rest_corners(topology, topology.tet(t));
    before = std::min(before, least_sine(corners));
    corners[corner_of(topology.tet(t), node)] = place;
    after = std::min(after, least_sine(corners));
  }
  if (!(after > before)) return false;
  return step_to_mean(ends_.size(), kSmoothing, [&](std::size_t i, std::uint16_t t) {
    const Move move{node, ends_[i], t};
    if (!can_move(topology, move)) return false;
    mesh.move(move);
    return true;
  });
}

bool AdaptiveSplitter::run(CutMesh& mesh, Stroke& stroke, std::span<const PatchTriangle> patch,
                           std::uint32_t& budget) {
  if (patch.empty()) return true;
  measure(mesh, stroke, patch);
  find_inside(mesh, stroke, patch);
  label_on_plane(mesh, stroke);
  complete_tets(mesh, stroke, patch);
  pulls_.clear();
  if (is_adaptive_) find_pulls(mesh, stroke, patch);
  split(mesh, stroke);
  if (is_adaptive_) {
    pull_all(mesh);
    smooth(mesh, stroke);
  }
  budget -= std::min(budget, static_cast<std::uint32_t>(crossings_.size()) + 1);
  return true;
}

}  // namespace trocar::nakao

#include "server/organs/mesh/conform.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "server/organs/mesh/pieces.h"
#include "server/organs/mesh/tet_stars.h"

namespace trocar::mesh {
namespace {

// Shares of an edge within which a crossing pulls its end, as in stuffing. With 0.36 on short
// edges, which is best there, six of 61,000 tets of a liver with vessel and lump keep a step; with
// 0.42 none does, and there are fewer nodes.
constexpr double kPullLong = 0.24999, kPullShort = 0.42;
constexpr double kLongEdge = 0.93;  // spacings; the lattice has edges of 0.87 and 1
// Moved nodes leave room for the splits that follow.
constexpr double kMovedMinDihedral_deg = 14, kMovedMaxDihedral_deg = 155;
// A label hidden in the middle of an edge gets a node where it has so much of the edge. With it a
// tube 1.2 spacings across comes out whole, without it in three pieces.
constexpr double kHiddenShare = 0.3;
constexpr double kHiddenMinDihedral_deg = 25, kHiddenMaxDihedral_deg = 150;
constexpr double kSamePlace = 0.1;  // share of an edge
constexpr int kHalvings = 24, kRounds = 6;
constexpr double kSlope = 0.02;     // spacings over which the slope of the surface is measured
constexpr int kSamplesPerEdge = 5;  // along an edge of a tet, 35 in all

// Labels that meet at a node, ascending.
class Labels {
 public:
  static constexpr std::size_t kMost = 4;

  bool has(std::uint16_t label) const { return std::find(begin(), end(), label) != end(); }
  bool meets(const Labels& b) const {
    return std::any_of(begin(), end(), [&](std::uint16_t label) { return b.has(label); });
  }
  // False if there is no room.
  bool add(std::uint16_t label) {
    if (has(label)) return true;
    if (count_ == kMost) return false;
    items_[count_++] = label;
    std::sort(items_.begin(), items_.begin() + static_cast<std::ptrdiff_t>(count_));
    return true;
  }
  bool add(const Labels& b) {
    return std::all_of(b.begin(), b.end(), [&](std::uint16_t label) { return add(label); });
  }
  std::size_t count() const { return count_; }
  const std::uint16_t* begin() const { return items_.data(); }
  const std::uint16_t* end() const { return items_.data() + count_; }

 private:
  std::array<std::uint16_t, kMost> items_{};
  std::size_t count_ = 0;
};

Labels common_of(const std::vector<Labels>& of_node, const Tet& tet) {
  Labels out;
  for (const auto label : of_node[tet[0].value])
    if (of_node[tet[1].value].has(label) && of_node[tet[2].value].has(label) &&
        of_node[tet[3].value].has(label))
      out.add(label);
  return out;
}

class Conformer {
 public:
  Conformer(const TetMesh& mesh, double spacing_m, const LabelAt& label_at,
            const SignedField& surface)
      : stars_(mesh.rest_positions, mesh.tets),
        spacing_m_(spacing_m),
        label_at_(label_at),
        surface_(surface) {}

  Result<ConformingMesh> run() {
    labels_.resize(stars_.node_count());
    for (std::uint32_t n = 0; n < stars_.node_count(); ++n)
      labels_[n].add(label_at_(stars_.position(NodeIndex(n))));
    split_hidden_edges();
    pull_nodes();
    for (int round = 0; round < kRounds; ++round)
      if (!split_edges()) break;
    return assemble();
  }

 private:
  struct Crossing {
    double share = 0;  // of the way from the first end
    Vec3d place;       // m
    Labels labels;     // of a node there
  };
  struct Edge {
    bool is_long = false;
    NodeIndex a, b;
    auto operator<=>(const Edge&) const = default;
  };

  bool is_long(NodeIndex a, NodeIndex b) const {
    return length_squared(stars_.position(b) - stars_.position(a)) >
           kLongEdge * kLongEdge * spacing_m_ * spacing_m_;
  }

  // The edges for which `holds`, the short ones first.
  template <typename Holds>
  std::vector<Edge> edges_where(const Holds& holds) const {
    std::vector<Edge> edges;
    for (const Tet& tet : stars_.tets())
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j)
          if (holds(tet[i], tet[j]))
            edges.push_back(
                {is_long(tet[i], tet[j]), std::min(tet[i], tet[j]), std::max(tet[i], tet[j])});
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
  }

  // Finds where the labels of b begin on the way from a; none if more labels meet than a node can
  // have.
  std::optional<Crossing> crossing(NodeIndex a, NodeIndex b) const {
    const Vec3d& from = stars_.position(a);
    const Vec3d way = stars_.position(b) - from;
    const Labels& of_b = labels_[b.value];
    double low = 0, high = 1;
    std::uint16_t before = label_at_(from);
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = (low + high) / 2;
      const auto label = label_at_(from + way * middle);
      if (of_b.has(label)) {
        high = middle;
      } else {
        low = middle;
        before = label;
      }
    }
    Crossing out{(low + high) / 2, from + way * ((low + high) / 2), of_b};
    const Labels& of_a = labels_[a.value];
    // Another label lies between: the rest of the way crosses once more.
    const bool has_room =
        of_a.has(before) || of_b.has(before) ? out.labels.add(of_a) : out.labels.add(before);
    return has_room ? std::optional(out) : std::nullopt;
  }

  // Returns the place on the outer surface next to p.
  Vec3d on_surface(const Vec3d& p) const {
    const double h = kSlope * spacing_m_, value = surface_(p);
    const Vec3d x{h, 0, 0}, y{0, h, 0}, z{0, 0, h};
    const Vec3d slope = Vec3d{surface_(p + x) - surface_(p - x), surface_(p + y) - surface_(p - y),
                              surface_(p + z) - surface_(p - z)} /
                        (2 * h);
    const double steepness = length_squared(slope);
    return steepness > 0.25 ? p - slope * (value / steepness) : p;
  }

  // Moves a node onto the crossing; false if that would leave the bound.
  bool pull(NodeIndex node, const Crossing& to, const ShapeBound& bound) {
    const Vec3d place = stars_.is_on_surface(node) ? on_surface(to.place) : to.place;
    if (!stars_.can_move(node, place, bound)) return false;
    stars_.move(node, place);
    labels_[node.value] = to.labels;
    ++moved_;
    return true;
  }
  bool may_follow(NodeIndex node, NodeIndex towards) const {
    return !stars_.is_on_surface(node) || stars_.is_surface_edge(node, towards);
  }

  // Splits edges between nodes of one label in whose middle another is, so that it has a node
  // there.
  void split_hidden_edges() {
    const auto bound = ShapeBound::of_degrees(kHiddenMinDihedral_deg, kHiddenMaxDihedral_deg);
    for (const Edge& edge : edges_where(
             [&](NodeIndex a, NodeIndex b) { return labels_[a.value].meets(labels_[b.value]); })) {
      const Vec3d from = stars_.position(edge.a), way = stars_.position(edge.b) - from;
      const auto own = *labels_[edge.a.value].begin();
      const auto at = [&](double share) { return label_at_(from + way * share); };
      for (const double share : {0.5, 0.25, 0.75}) {
        const auto hidden = at(share);
        if (hidden == own) continue;
        const double begin = where_it_ends(at, hidden, share, 0),
                     end = where_it_ends(at, hidden, share, 1);
        const Vec3d middle = from + way * ((begin + end) / 2);
        if (end - begin < kHiddenShare || !stars_.can_split(edge.a, edge.b, middle, bound)) break;
        stars_.split(edge.a, edge.b, middle);
        labels_.emplace_back().add(hidden);
        ++split_;
        break;
      }
    }
  }
  // Returns the end of the label's stretch of an edge, between a share within it and one beyond.
  template <typename At>
  static double where_it_ends(const At& at, std::uint16_t label, double inside, double outside) {
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = (inside + outside) / 2;
      (at(middle) == label ? inside : outside) = middle;
    }
    return inside;
  }

  void pull_nodes() {
    const auto bound = ShapeBound::of_degrees(kMovedMinDihedral_deg, kMovedMaxDihedral_deg);
    for (std::uint32_t n = 0; n < stars_.node_count(); ++n) {
      const NodeIndex node(n);
      if (labels_[n].count() != 1) continue;
      std::vector<std::pair<double, Crossing>> near;
      for (const NodeIndex other : stars_.neighbours(node)) {
        if (labels_[n].meets(labels_[other.value]) || !may_follow(node, other)) continue;
        const auto found = crossing(node, other);
        if (!found || !found->labels.meets(labels_[n])) continue;
        const double share = found->share / (is_long(node, other) ? kPullLong : kPullShort);
        if (share < 1) near.emplace_back(share, *found);
      }
      std::ranges::stable_sort(near, {}, &std::pair<double, Crossing>::first);
      for (const auto& candidate : near)
        if (pull(node, candidate.second, bound)) break;
    }
  }

  // Splits the edges that cross now, the short ones first. Returns whether anything changed.
  bool split_edges() {
    const auto bound = conforming_bound();
    const auto edges = edges_where(
        [&](NodeIndex a, NodeIndex b) { return !labels_[a.value].meets(labels_[b.value]); });
    bool has_changed = false;
    for (const Edge& edge : edges)
      if (!labels_[edge.a.value].meets(labels_[edge.b.value]))
        has_changed = conform_edge(edge.a, edge.b, bound) || has_changed;
    return has_changed;
  }

  bool conform_edge(NodeIndex a, NodeIndex b, const ShapeBound& bound) {
    const auto at = crossing(a, b);
    if (!at) return false;
    if (stars_.can_split(a, b, at->place, bound)) {
      stars_.split(a, b, at->place);
      labels_.push_back(at->labels);
      ++split_;
      return true;
    }
    // The nearer end moves there instead, if it was on no interface.
    const bool is_a_nearer = at->share < 0.5;
    for (const auto& [end, other] : {std::pair(is_a_nearer ? a : b, is_a_nearer ? b : a),
                                     std::pair(is_a_nearer ? b : a, is_a_nearer ? a : b)})
      if (labels_[end.value].count() == 1 && may_follow(end, other) && pull(end, *at, bound))
        return true;
    // A node on an interface stays, and is where another begins if that is close by.
    const NodeIndex nearer = is_a_nearer ? a : b;
    if (std::min(at->share, 1 - at->share) > kSamePlace) return false;
    labels_[nearer.value] = at->labels;
    return true;
  }

  // By points spread evenly in the tet; the lowest of equal ones. among: empty, or which may be.
  std::uint16_t label_of_most(const Tet& tet, const Labels& among) const {
    std::vector<std::pair<std::uint16_t, int>> counts;
    for (int a = 0; a < kSamplesPerEdge; ++a)
      for (int b = 0; a + b < kSamplesPerEdge; ++b)
        for (int c = 0; a + b + c < kSamplesPerEdge; ++c) {
          const int d = kSamplesPerEdge - 1 - a - b - c;
          const double weights[4] = {a + 0.25, b + 0.25, c + 0.25, d + 0.25};
          Vec3d p;
          for (std::size_t i = 0; i < 4; ++i)
            p += stars_.position(tet[i]) * (weights[i] / kSamplesPerEdge);
          const auto label = label_at_(p);
          if (among.count() > 0 && !among.has(label)) continue;
          const auto known =
              std::ranges::find(counts, label, &std::pair<std::uint16_t, int>::first);
          if (known == counts.end())
            counts.emplace_back(label, 1);
          else
            ++known->second;
        }
    std::uint16_t best = *(among.count() > 0 ? among : labels_[tet[0].value]).begin();
    int most = 0;
    for (const auto& [label, count] : counts)
      if (count > most || (count == most && label < best)) best = label, most = count;
    return best;
  }

  Result<ConformingMesh> assemble() {
    ConformingMesh out;
    out.moved_nodes = moved_;
    out.split_edges = split_;
    out.mesh.rest_positions = stars_.take_positions();
    out.mesh.tets = stars_.take_tets();
    const auto old_numbers = renumber_along_z(out.mesh);
    std::vector<Labels> labels;
    labels.reserve(old_numbers.size());
    for (const auto old : old_numbers) labels.push_back(labels_[old]);
    labels_ = std::move(labels);
    stars_ = TetStars(out.mesh.rest_positions, out.mesh.tets);
    out.tet_labels.reserve(out.mesh.tets.size());
    for (const Tet& tet : out.mesh.tets) {
      const Labels common = common_of(labels_, tet);
      out.steps += common.count() == 0 ? 1 : 0;
      out.tet_labels.push_back(common.count() == 1 ? *common.begin() : label_of_most(tet, common));
    }
    out.mesh.build_adjacency();
    if (auto s = validate(out.mesh); !s)
      return Error{ErrorCode::BadFile, "interfaces: " + s.error().message};
    return out;
  }

  TetStars stars_;
  std::vector<Labels> labels_;  // of each node
  double spacing_m_;
  const LabelAt& label_at_;
  const SignedField& surface_;
  std::size_t moved_ = 0, split_ = 0;
};

}  // namespace

ShapeBound conforming_bound() {
  return ShapeBound::of_degrees(kStuffingMinDihedral_deg, kStuffingMaxDihedral_deg);
}

Result<ConformingMesh> conform_to_labels(const TetMesh& mesh, double spacing_m,
                                         const LabelAt& label_at, const SignedField& surface) {
  TROCAR_ASSERT(spacing_m > 0);
  return Conformer(mesh, spacing_m, label_at, surface).run();
}

}  // namespace trocar::mesh

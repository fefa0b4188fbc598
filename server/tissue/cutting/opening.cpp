// Why faces are opened by topology alone, and why the loop ends.
//
// A blade's path and a tet mesh agree only where nodes lie on the path. The wound is therefore a
// set of faces between tets of different sides, and what it does to the surface is decided by
// counting, never by coordinates: two computers, and a replay, come to the same wound. Opening all
// proposed faces gives every component of tets around a node a node of its own (star.h). The
// surface stays manifold there if the link of each component is a disc or a sphere; with fans as
// the link's vertices, faces as its edges and tets as its triangles that is Euler's characteristic,
//   chi = fans - faces + tets = 1 (disc) or 2 (sphere),
// and if no edge has two fans that are in the same components at both of its ends: these would be
// one edge with four wound faces.
//
// A proposal that breaks this can't be mended by parting more, for the blade has not been there. So
// faces are closed again, one for each breach: the one that parts the fewest nodes, because it is
// the one that does least for the wound. Closing a face changes the stars of its three nodes alone,
// so that only these are looked at again. Each round closes a face or ends, and with no face open
// there is no breach: the loop ends after at most as many rounds as there are proposals. What was
// closed waits until the blade has changed something beside it.

#include "server/tissue/cutting/opening.h"

#include <algorithm>

#include "common/base/assert.h"

namespace trocar::cutting {
namespace {

constexpr int kDebrisRounds = 3;

template <typename T>
void sort_unique(std::vector<T>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

bool are_labelled(const Stroke& stroke, const mesh::Triangle& nodes) {
  return stroke.is_labelled(nodes[0]) && stroke.is_labelled(nodes[1]) &&
         stroke.is_labelled(nodes[2]);
}

bool is_flat(const CutMesh& mesh, const Stroke& stroke, TetIndex t) {
  return std::ranges::all_of(mesh.topology().tet(t),
                             [&](NodeIndex n) { return stroke.is_labelled(n); });
}

// Returns a point's height above the nearest triangle of the patch, m. It stands in for
// Stroke::height() where no part of the path was near yet.
double height_above(const Stroke& stroke, const Vec3d& p) {
  double nearest = -1, height = 0;
  for (const auto& triangle : stroke.patch) {
    const double d = distance_squared(triangle, p);
    if (nearest >= 0 && nearest <= d) continue;
    nearest = d;
    height = signed_distance(triangle, p);
  }
  return height;
}

double height_of(const CutMesh& mesh, const Stroke& stroke, NodeIndex node) {
  const auto height = stroke.height(node);
  return height.nearest_squared >= 0 ? height.height : height_above(stroke, mesh.position(node));
}

}  // namespace

int Opening::side(const CutMesh& mesh, Stroke& stroke, TetIndex t) {
  if (const int own = stroke.side(t); own != 0) return own;
  double sum = 0;
  bool is_flat = true;
  for (const auto node : mesh.topology().tet(t)) {
    if (stroke.is_labelled(node)) continue;
    is_flat = false;
    sum += height_of(mesh, stroke, node);
  }
  if (is_flat) return side_of_flat(mesh, stroke, t);
  return sum < 0 ? -1 : 1;
}

// Decides for good the side of a tet whose nodes are all labelled: that of most of its neighbours,
// weighted by the area of the shared faces.
int Opening::side_of_flat(const CutMesh& mesh, Stroke& stroke, TetIndex t) {
  double sum = 0;
  for (std::uint8_t corner = 0; corner < 4; ++corner) {
    const auto other = across(mesh.topology(), {t, corner});
    if (!other || (stroke.side(other->tet) == 0 && is_flat(mesh, stroke, other->tet))) continue;
    sum += side(mesh, stroke, other->tet) * face_area(mesh.topology(), {t, corner});
  }
  if (sum == 0) {
    Vec3d centre;
    for (const auto node : mesh.topology().tet(t)) centre += mesh.position(node) / 4;
    sum = height_above(stroke, centre);
  }
  const int own = sum < 0 ? -1 : 1;
  stroke.decide(t, own);
  return own;
}

// Tets at fresh nodes, and waiting ones that hang together with them: the others would only be
// refused again.
void Opening::gather(const CutMesh& mesh, const Stroke& stroke) {
  const auto& topology = mesh.topology();
  tets_.clear();
  is_reached_.resize(std::max(is_reached_.size(), topology.node_count()));
  reached_.clear();
  const auto reach = [&](TetIndex t) {
    int labelled = 0;
    for (const auto node : topology.tet(t)) {
      labelled += stroke.is_labelled(node);
      if (is_reached_[node.value] != 0) continue;
      is_reached_[node.value] = 1;
      reached_.push_back(node);
    }
    if (labelled > 2) tets_.push_back(t);
  };
  for (const auto node : stroke.fresh)
    for (const auto t : topology.tets_of(node)) reach(t);
  still_waiting_ = stroke.waiting;
  for (std::size_t before = 0; before != still_waiting_.size();) {
    before = still_waiting_.size();
    std::erase_if(still_waiting_, [&](TetIndex t) {
      const bool is_taken = std::ranges::any_of(
          topology.tet(t), [&](NodeIndex node) { return is_reached_[node.value] != 0; });
      if (is_taken) reach(t);
      return is_taken;
    });
  }
  for (const auto node : reached_) is_reached_[node.value] = 0;
  sort_unique(tets_);
}

void Opening::propose(const CutMesh& mesh, Stroke& stroke) {
  proposals_.clear();
  for (const auto t : tets_)
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      const TetFace face{t, corner};
      const auto nodes = face_nodes(mesh.topology().tet(t), corner);
      if (!are_labelled(stroke, nodes)) continue;
      const auto other = across(mesh.topology(), face);
      if (!other || side(mesh, stroke, t) == side(mesh, stroke, other->tet)) continue;
      if (t < other->tet)
        proposals_.push_back({face, other->tet, nodes});
      else
        proposals_.push_back({*other, t, nodes});
    }
  std::sort(proposals_.begin(), proposals_.end(),
            [](const Proposal& a, const Proposal& b) { return a.face < b.face; });
  proposals_.erase(
      std::unique(proposals_.begin(), proposals_.end(),
                  [](const Proposal& a, const Proposal& b) { return a.face == b.face; }),
      proposals_.end());
}

std::size_t Opening::star_index(NodeIndex node) const {
  const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), node);
  TROCAR_ASSERT(at != nodes_.end() && *at == node);
  return static_cast<std::size_t>(at - nodes_.begin());
}

void Opening::cut_all(const CutMesh& mesh) {
  if (!cuts_) cuts_.emplace(mesh.topology());
  cuts_->clear();
  nodes_.clear();
  for (const auto& proposal : proposals_) {
    cuts_->cut(proposal.face);
    nodes_.insert(nodes_.end(), proposal.nodes.begin(), proposal.nodes.end());
  }
  sort_unique(nodes_);
}

// Whether the tet belongs to a part, cut off as proposed, that is debris: debris_.
bool Opening::find_debris(const CutMesh& mesh, TetIndex start) {
  const auto& settings = mesh.settings();
  const auto& topology = mesh.topology();
  const double h = mesh.h(topology.tet(start)[0]);
  const auto volume_of = [&](TetIndex t) {
    return six_volumes(rest_corners(topology, topology.tet(t))) / 6;
  };
  const auto is_more = [&](double volume) {
    return debris_.size() >= settings.debris_tets &&
           (debris_.size() > 4 * settings.debris_tets ||
            volume >= settings.debris_volume_h3 * h * h * h);
  };
  debris_.assign(1, start);
  double volume = volume_of(start);
  for (std::size_t i = 0; i < debris_.size(); ++i)
    for (std::uint8_t corner = 0; corner < 4; ++corner) {
      if (is_more(volume)) return false;
      if (cuts_->is_cut({debris_[i], corner})) continue;
      const auto other = across(topology, {debris_[i], corner});
      if (!other || std::ranges::find(debris_, other->tet) != debris_.end()) continue;
      debris_.push_back(other->tet);
      volume += volume_of(other->tet);
    }
  return !is_more(volume);
}

bool Opening::turn_debris(const CutMesh& mesh, Stroke& stroke) {
  debris_starts_.clear();
  for (const auto& proposal : proposals_)
    for (const auto start : {proposal.face.tet, proposal.other}) {
      if (std::ranges::find(debris_starts_, start) != debris_starts_.end()) continue;
      debris_starts_.push_back(start);
      if (!find_debris(mesh, start)) continue;
      const int other_side = -side(mesh, stroke, start);
      for (const auto t : debris_) {
        stroke.decide(t, other_side);
        tets_.push_back(t);
      }
      sort_unique(tets_);
      return true;
    }
  return false;
}

std::uint32_t Opening::parted_nodes(const Proposal& proposal) const {
  std::uint32_t count = 0;
  for (const auto node : proposal.nodes) {
    const auto& star = stars_[star_index(node)];
    count += star.component_of(proposal.face.tet) != star.component_of(proposal.other);
  }
  return count;
}

// Fans of one edge that are in the same components at both ends: visit(other end).
template <typename Visit>
void Opening::for_each_twin_breach(const Star& star, Visit&& visit) const {
  const auto& fans = star.twin_fans;
  for (std::size_t i = 0; i < fans.size(); ++i)
    for (std::size_t k = i + 1; k < fans.size() && fans[k].other == fans[i].other &&
                                fans[k].component == fans[i].component;
         ++k) {
      const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), fans[i].other);
      if (at == nodes_.end() || *at != fans[i].other) continue;
      const auto& end = stars_[static_cast<std::size_t>(at - nodes_.begin())];
      if (end.component_of(fans[i].tet) != end.component_of(fans[k].tet)) continue;
      visit(fans[i].other);
    }
}

// Adds an offender: of a node's open faces among the causes, the one that parts the fewest nodes.
template <typename Causes>
void Opening::offend(std::size_t star, Causes&& causes) {
  std::uint32_t weakest = 0, least = 4;
  for (auto i = first_face_at_[star]; i < first_face_at_[star + 1]; ++i) {
    const auto p = faces_at_[i].second;
    if (!proposals_[p].is_open || !causes(proposals_[p])) continue;
    const auto parted = parted_nodes(proposals_[p]);
    if (parted >= least) continue;
    least = parted;
    weakest = p;
  }
  if (least < 4) offenders_.push_back(weakest);
}

// Only where something has changed since the last time.
void Opening::find_offenders() {
  offenders_.clear();
  for (std::size_t s = 0; s < nodes_.size(); ++s) {
    if ((stale_[s] & kFacesStale) == 0) continue;
    stale_[s] &= kBreachesStale;
    for (auto i = first_face_at_[s]; i < first_face_at_[s + 1]; ++i) {
      const auto p = faces_at_[i].second;
      if (proposals_[p].is_open && parted_nodes(proposals_[p]) == 0) offenders_.push_back(p);
    }
  }
  sort_unique(offenders_);
  if (!offenders_.empty()) return;
  for (std::size_t s = 0; s < nodes_.size(); ++s) {
    if (stale_[s] == 0) continue;
    stale_[s] = 0;
    const auto& star = stars_[s];
    for (const auto c : star.bad_components)
      offend(s, [&](const Proposal& p) {
        return star.component_of(p.face.tet) == c || star.component_of(p.other) == c;
      });
    for_each_twin_breach(star, [&](NodeIndex other) {
      offend(s,
             [&](const Proposal& p) { return std::ranges::find(p.nodes, other) != p.nodes.end(); });
    });
  }
  sort_unique(offenders_);
}

bool Opening::close_offenders(const CutMesh& mesh) {
  find_offenders();
  changed_.clear();
  for (const auto p : offenders_) {
    proposals_[p].is_open = false;
    cuts_->mend(proposals_[p].face);
    for (const auto node : proposals_[p].nodes)
      changed_.push_back(static_cast<std::uint32_t>(star_index(node)));
  }
  sort_unique(changed_);
  for (const auto s : changed_) {
    analysis_.run(mesh.topology(), *cuts_, nodes_[s], stars_[s]);
    stale_[s] = kFacesStale | kBreachesStale;
    // Whether fans are twins is decided at both ends of an edge.
    for (auto i = first_face_at_[s]; i < first_face_at_[s + 1]; ++i)
      for (const auto node : proposals_[faces_at_[i].second].nodes)
        stale_[star_index(node)] |= kBreachesStale;
  }
  return !offenders_.empty();
}

void Opening::commit(CutMesh& mesh, Stroke& stroke) {
  faces_.clear();
  stroke.waiting = still_waiting_;
  for (const auto& proposal : proposals_) {
    if (proposal.is_open) {
      faces_.push_back(proposal.face);
    } else {
      stroke.waiting.push_back(proposal.face.tet);
      stroke.waiting.push_back(proposal.other);
    }
  }
  sort_unique(stroke.waiting);
  if (!faces_.empty()) mesh.open(faces_, std::span(stars_).first(nodes_.size()));
}

void Opening::run(CutMesh& mesh, Stroke& stroke) {
  if (stroke.fresh.empty()) return;
  gather(mesh, stroke);
  propose(mesh, stroke);
  cut_all(mesh);
  for (int round = 0; round < kDebrisRounds && turn_debris(mesh, stroke); ++round) {
    propose(mesh, stroke);
    cut_all(mesh);
  }
  check_all(mesh);
  commit(mesh, stroke);
  cuts_->clear();
  stroke.fresh.clear();
}

void Opening::check_all(const CutMesh& mesh) {
  analyse_all(mesh);
  while (close_offenders(mesh)) {
  }
}

void Opening::open(CutMesh& mesh, std::span<const TetFace> faces) {
  proposals_.clear();
  for (const auto& face : faces) {
    const auto other = across(mesh.topology(), face);
    TROCAR_ASSERT(other && face.tet < other->tet);
    proposals_.push_back(
        {face, other->tet, face_nodes(mesh.topology().tet(face.tet), face.corner)});
  }
  cut_all(mesh);
  check_all(mesh);
  faces_.clear();
  for (const auto& proposal : proposals_)
    if (proposal.is_open) faces_.push_back(proposal.face);
  if (!faces_.empty()) mesh.open(faces_, std::span(stars_).first(nodes_.size()));
  cuts_->clear();
}

void Opening::analyse_all(const CutMesh& mesh) {
  if (stars_.size() < nodes_.size()) stars_.resize(nodes_.size());
  for (std::size_t s = 0; s < nodes_.size(); ++s)
    analysis_.run(mesh.topology(), *cuts_, nodes_[s], stars_[s]);
  faces_at_.clear();
  for (std::uint32_t p = 0; p < proposals_.size(); ++p)
    for (const auto node : proposals_[p].nodes)
      faces_at_.emplace_back(static_cast<std::uint32_t>(star_index(node)), p);
  std::sort(faces_at_.begin(), faces_at_.end());
  stale_.assign(nodes_.size(), kFacesStale | kBreachesStale);
  first_face_at_.assign(nodes_.size() + 1, 0);
  for (const auto& [star, proposal] : faces_at_) ++first_face_at_[star + 1];
  for (std::size_t s = 0; s < nodes_.size(); ++s) first_face_at_[s + 1] += first_face_at_[s];
}

double Opening::waiting_area(CutMesh& mesh, Stroke& stroke) {
  tets_ = stroke.waiting;
  propose(mesh, stroke);
  double area = 0;
  for (const auto& proposal : proposals_) area += face_area(mesh.topology(), proposal.face);
  return area;
}

double Opening::closed_area(const CutMesh& mesh, Stroke& stroke, std::span<const TetIndex> others) {
  tets_ = stroke.waiting;
  tets_.insert(tets_.end(), others.begin(), others.end());
  sort_unique(tets_);
  propose(mesh, stroke);
  cut_all(mesh);
  check_all(mesh);
  cuts_->clear();
  double area = 0;
  for (const auto& proposal : proposals_)
    if (!proposal.is_open) area += face_area(mesh.topology(), proposal.face);
  return area;
}

std::span<const Opening::Breach> Opening::breaches_of_all(CutMesh& mesh, Stroke& stroke) {
  tets_ = stroke.waiting;
  propose(mesh, stroke);
  cut_all(mesh);
  analyse_all(mesh);
  breaches_.clear();
  for (std::size_t s = 0; s < nodes_.size(); ++s) {
    for (const auto c : stars_[s].bad_components) {
      const auto at = std::ranges::find(stars_[s].components, c) - stars_[s].components.begin();
      const auto tet = stars_[s].tets[static_cast<std::size_t>(at)];
      breaches_.push_back({nodes_[s], {}, side(mesh, stroke, tet)});
    }
    for_each_twin_breach(stars_[s], [&](NodeIndex other) {
      if (nodes_[s] < other) breaches_.push_back({nodes_[s], other, 0});
    });
  }
  cuts_->clear();
  return breaches_;
}

}  // namespace trocar::cutting

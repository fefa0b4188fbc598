#include "server/tissue/contact/self_contact_list.h"

#include <cmath>
#include <utility>

#include "common/math/box.h"
#include "server/tissue/contact/contact_list.h"

namespace trocar::contact {
namespace {

// Each tick takes at least so many references of a new list, or searches around so many nodes.
constexpr std::size_t kReferencesPerTick = 512, kSitesPerTick = 32;
// Taking references is this part of the work on a list.
constexpr double kReferencesShare = 0.3;
constexpr std::size_t kReservedPairs = 1u << 15;
// How far a node is from rest that may meet others, in mean edges; in metres at most kMaxMoved_m.
constexpr float kMovedEdges = 1, kMaxMoved_m = 0.006f;
// How far the surface may move between lists, as a part of that.
constexpr float kSlack = 0.5f;
// A new list is begun when a node is so far from its reference, and looks again for those that are
// so far then, in slacks.
constexpr float kBegins = 0.375f, kDue = 0.25f;
// Travels are rounded up, and are forgotten before float has no room for a tick's.
constexpr float kLonger = 1.0001f, kTravelRounding_m = 6e-8f, kLongestTravel_m = 0.5f;
// The nearest corner of a triangle is this far from any point on it at most, in its longest edges.
constexpr float kCornerReach = 0.6f;
// A pair whose distance nobody knows has this far_until, which is less than any travel.
constexpr float kMayBeNear_m = -1;

Vec3f position(SelfSurface::Site site, const world::World& world) {
  return world.position(NodeIndex(site));
}
// Returns whether the node is farther than this from where it was at rest.
bool has_moved(SelfSurface::Site site, float by_m, const world::World& world) {
  return length_squared(world.displacements[site]) > by_m * by_m;
}

}  // namespace

void NodePairList::reserve(std::size_t most_pairs, std::size_t nodes) {
  pairs.reserve(most_pairs);
  far_until.reserve(most_pairs);
  runs.reserve(nodes);
}

void NodePairList::resize(std::size_t nodes) {
  references.resize(nodes);
  has_left.resize(nodes);
}

void NodePairList::clear() {
  least_distance = 1;
  pairs.clear();
  far_until.clear();
}

void NodePairList::note_squared_distance(float squared) {
  least_distance = std::min(least_distance, std::sqrt(squared));
}

void NodePairList::add(std::vector<NodePair>& found) {
  std::ranges::sort(found, {}, [](const NodePair& pair) {
    return std::uint64_t{pair.node} << 32 | pair.across;  // in one comparison
  });
  found.erase(std::unique(found.begin(), found.end()), found.end());
  // Entries are merged from the back, so that each moves only once.
  auto old = pairs.size(), fresh = found.size();
  pairs.resize(old + fresh);
  far_until.resize(old + fresh);
  while (fresh > 0) {
    const auto place = old + fresh - 1;
    const bool is_old = old > 0 && found[fresh - 1] < pairs[old - 1];
    pairs[place] = is_old ? pairs[old - 1] : found[fresh - 1];
    far_until[place] = is_old ? far_until[old - 1] : kMayBeNear_m;
    --(is_old ? old : fresh);
  }
  runs.clear();
  for (std::uint32_t i = 0; i < pairs.size(); ++i)
    if (i == 0 || pairs[i].node != pairs[i - 1].node) runs.push_back({pairs[i].node, i});
}

void NodePairList::forget_distances(Site site) {
  const auto place_of = [&](NodePair pair) {
    return static_cast<std::size_t>(std::ranges::lower_bound(pairs, pair) - pairs.begin());
  };
  for (auto i = place_of({site, 0}); i < pairs.size() && pairs[i].node == site; ++i) {
    far_until[i] = kMayBeNear_m;
    far_until[place_of({pairs[i].across, site})] = kMayBeNear_m;
  }
}

void NodePairList::forget_distances() {
  std::ranges::fill(far_until, kMayBeNear_m);
}

SelfReach::SelfReach(const SelfSurface& surface) {
  moved_m = std::clamp(kMovedEdges * surface.mean_edge_m(), 1e-4f, kMaxMoved_m);
  slack_m = kSlack * moved_m;
  // An edge far longer than the mean one is a flaw of the mesh.
  of_corner_m = kCornerReach * std::min(surface.longest_edge_m(), 3 * surface.mean_edge_m());
}

bool SelfReach::measure(Site site, const SelfSurface& surface) {
  float squared = 0;
  for (const auto t : surface.triangles_of(site)) {
    const auto& [a, b, c] = surface[t];
    const Vec3f &pa = surface.rest_position(a), &pb = surface.rest_position(b),
                &pc = surface.rest_position(c);
    squared = std::max(
        {squared, length_squared(pa - pb), length_squared(pb - pc), length_squared(pc - pa)});
  }
  const float now = std::min(kCornerReach * std::sqrt(squared), of_corner_m);
  return now > std::exchange(of_corner[site], now);
}

SelfContactList::SelfContactList(const organ::Organ& organ)
    : surface_(organ),
      reach_(surface_),
      next_{.grid = PointGrid(reach_.greatest() + reach_.slack_m, surface_.sites().size())} {
  const auto sites = surface_.sites();
  next_.due.reserve(sites.size());
  next_.grid_sites.reserve(sites.size());
  for (auto* list : {&list_, &next_.list}) list->reserve(kReservedPairs, sites.size());
  found_.reserve(kReservedPairs);
  next_.found.reserve(kReservedPairs);
  extend();
  measure_corners(sites);
  // Two nodes that have both moved by this come so much nearer.
  const float range = reach_.greatest() + 2 * reach_.moved_m;
  PointGrid grid(range, sites.size());
  grid.build(sites.size(), [&](std::size_t i) { return surface_.rest_position(sites[i]); });
  for (const Site s : sites)
    grid.visit(surface_.rest_position(s), range, [&](std::uint32_t place, float) {
      if (surface_.faced_at_rest(s, sites[place]) && !surface_.is_near(s, sites[place]))
        is_close_at_rest_[s] = 1;
    });
}

// Makes room for all nodes.
void SelfContactList::extend() {
  const auto count = surface_.node_count();
  is_close_at_rest_.resize(count);
  reach_.of_corner.resize(count);
  places_.resize(count);
  travels_.resize(count);
  for (auto* list : {&list_, &next_.list}) list->resize(count);
  next_.is_due.resize(count);
  is_near_.resize(count);
}

// Pairs of nodes that now reach farther are looked at again.
void SelfContactList::measure_corners(std::span<const Site> sites) {
  for (const Site s : sites)
    if (reach_.measure(s, surface_))
      for (auto* list : {&list_, &next_.list}) list->forget_distances(s);
}

float SelfContactList::squared_distance(std::size_t listed, float margin_m,
                                        const world::World& world) {
  const auto& pair = list_.pairs[listed];
  const float squared = length_squared(position(pair.across, world) - position(pair.node, world));
  const float reach = reach_.between(pair.node, pair.across);
  const float reach_now = reach - (kSelfMaxMargin_m - margin_m);
  if (squared > reach_now * reach_now)
    list_.far_until[listed] =
        travels_[pair.node] + travels_[pair.across] + (std::sqrt(squared) - reach) - kRounding_m;
  return squared;
}

void SelfContactList::set_reference(Site site, const world::World& world,
                                    NodePairList& list) const {
  list.references[site] = position(site, world);
  list.has_left[site] = has_moved(site, reach_.moved_m - 0.5f * reach_.slack_m, world) ? 1 : 0;
}

// Adds the pairs of nodes that the edit has changed to the present list and to the next one.
// add() drops what the next one finds twice.
void SelfContactList::update(const topology::Edit& edit, const world::World& world) {
  const auto before = surface_.sites();
  const bool has_references = is_listing_ && next_.sites_seen == before.size();
  // The first site whose reference the next list lacks.
  const Site unseen = !has_references && is_listing_ ? before[next_.sites_seen] : Site{0};
  surface_.update(edit, world);
  extend();
  measure_corners(surface_.updated());
  for (const auto node : edit.surface.touched) is_close_at_rest_[node.value] = 1;
  for (const auto node : edit.surface.surfaced) {
    const Site s = node.value;
    set_reference(s, world, list_);
    places_[s] = list_.references[s];
    next_.is_due[s] = 0;
    if (has_references || s < unseen) set_reference(s, world, next_.list);
  }
  if (has_list_) list_pairs_of(surface_.updated(), list_), list_.add(found_);
  if (!is_listing_) return;
  const auto sites = surface_.sites();
  if (!has_references) {
    next_.sites_seen =
        static_cast<std::size_t>(std::ranges::lower_bound(sites, unseen) - sites.begin());
    return;
  }
  next_.sites_seen = sites.size();
  list_pairs_of(surface_.updated(), next_.list);
  next_.found.insert(next_.found.end(), found_.begin(), found_.end());
}

// Returns whether the node may meet nodes that do not look around themselves.
bool SelfContactList::looks_around(Site site, const NodePairList& list) const {
  return list.has_left[site] == 1 || is_close_at_rest_[site] == 1 ||
         surface_.is_of(site, Sort::Wound);
}

void SelfContactList::list_pairs_of(std::span<const Site> sites, NodePairList& list) {
  const float range = reach_.greatest() + reach_.slack_m;
  const auto& references = list.references;
  trocar::Box<float> box;
  for (const Site s : sites) box.include(references[s]);
  box.grow(range);
  around_.clear();
  looking_.clear();
  for (const Site s : surface_.sites()) {
    if (!box.contains(references[s])) continue;
    around_.push_back(s);
    if (looks_around(s, list)) looking_.push_back(s);
  }
  found_.clear();
  float least_squared = 1;
  for (const Site s : sites) {
    auto known = std::ranges::lower_bound(list.pairs, NodePair{s, 0});
    for (const Site other : looks_around(s, list) ? around_ : looking_) {
      const float squared = length_squared(references[s] - references[other]);
      const float pair_range = reach_.range(s, other);
      if (squared > pair_range * pair_range || other == s) continue;
      while (known != list.pairs.end() && *known < NodePair{s, other}) ++known;
      const bool is_known = known != list.pairs.end() && *known == NodePair{s, other};
      if (is_known || !may_meet(s, other, list)) continue;
      found_.push_back({s, other});
      found_.push_back({other, s});
      least_squared = std::min(least_squared, squared);
    }
  }
  list.note_squared_distance(least_squared);
}

void SelfContactList::begin_list() {
  is_listing_ = true;
  next_.list.clear();
  next_.found.clear();
  next_.sites_seen = next_.sites_listed = next_.due_count = 0;
}

void SelfContactList::set_references(std::size_t end, const world::World& world) {
  const float far = kDue * reach_.slack_m;
  for (; next_.sites_seen < end; ++next_.sites_seen) {
    const Site s = surface_.sites()[next_.sites_seen];
    const Vec3f& old = list_.references[s];
    next_.is_due[s] = !has_list_ || length_squared(position(s, world) - old) > far * far ? 1 : 0;
    if (next_.is_due[s] == 0) {
      next_.list.references[s] = old;
      next_.list.has_left[s] = list_.has_left[s];
      continue;
    }
    set_reference(s, world, next_.list);
    ++next_.due_count;
  }
}

// Lists due nodes cell by cell, because neighbours look through the same cells.
void SelfContactList::order_due() {
  next_.due.clear();
  if (next_.due_count == 0) return;
  next_.grid_sites.assign(surface_.sites().begin(), surface_.sites().end());
  next_.grid.build(next_.grid_sites.size(),
                   [&](std::size_t i) { return next_.list.references[next_.grid_sites[i]]; });
  for (const auto i : next_.grid.entries()) {
    const Site s = next_.grid_sites[i];
    // At first, whoever stays where nothing faces it has nothing to look for.
    if (next_.is_due[s] == 1 &&
        (has_list_ || next_.list.has_left[s] == 1 || is_close_at_rest_[s] == 1))
      next_.due.push_back(s);
  }
}

// Copies those pairs of the present list to the next one of which neither node is due.
void SelfContactList::keep_pairs() {
  const auto& references = next_.list.references;
  float least_squared = 1;
  for (std::size_t i = 0; i < list_.pairs.size(); ++i) {
    const auto& pair = list_.pairs[i];
    if (next_.is_due[pair.node] == 1 || next_.is_due[pair.across] == 1) continue;
    next_.list.pairs.push_back(pair);
    next_.list.far_until.push_back(list_.far_until[i]);
    least_squared =
        std::min(least_squared, length_squared(references[pair.node] - references[pair.across]));
  }
  next_.list.note_squared_distance(least_squared);
}

void SelfContactList::end_list() {
  next_.list.add(next_.found);
  std::swap(list_, next_.list);
  is_listing_ = false;
  has_list_ = true;
  ++lists_made_;
}

// share: how much of the work shall be done by now. All of it is done at once; else each tick does
// a little of one kind.
void SelfContactList::go_on_listing(double share, const world::World& world) {
  const auto part = [](double of_it, std::size_t all) {
    return static_cast<std::size_t>(std::clamp(of_it, 0.0, 1.0) * static_cast<double>(all));
  };
  if (next_.sites_seen < surface_.sites().size()) {
    const auto end = std::max(part(share / kReferencesShare, surface_.sites().size()),
                              next_.sites_seen + kReferencesPerTick);
    set_references(std::min(end, surface_.sites().size()), world);
    if (next_.sites_seen < surface_.sites().size()) return;
    keep_pairs();
    order_due();
    if (share < 1) return;
  }
  const auto end =
      std::max(part((share - kReferencesShare) / (1 - kReferencesShare), next_.due.size()),
               next_.sites_listed + kSitesPerTick);
  for (; next_.sites_listed < std::min(end, next_.due.size()); ++next_.sites_listed)
    list_around(next_.due[next_.sites_listed]);
  if (next_.sites_listed == next_.due.size()) end_list();
}

bool SelfContactList::may_meet(Site site, Site other, const NodePairList& list) const {
  if (surface_.is_of(site, Sort::Wound) && surface_.is_of(other, Sort::Wound)) {
    const float far = surface_.near_m() - 0.5f * reach_.slack_m;
    const auto was_far = [&](Site s) {
      return length_squared(list.references[s] - surface_.rest_position(s)) > far * far;
    };
    if (!surface_.share_lip_at_rest(site, other) || was_far(site) || was_far(other)) return true;
  }
  return list.has_left[site] == 1 || list.has_left[other] == 1 ||
         ((is_close_at_rest_[site] == 1 || is_close_at_rest_[other] == 1) &&
          surface_.faced_at_rest(site, other));
}

void SelfContactList::list_around(Site site) {
  const auto stamp_near_sites = [&] {
    is_near_.begin();
    for (const auto s : surface_.near(site)) is_near_.insert(s);
  };
  bool is_stamped = false;
  const bool was_cut = surface_.was_cut(site);
  float least_squared = 1;
  next_.grid.visit(next_.list.references[site], reach_.greatest() + reach_.slack_m,
                   [&](std::uint32_t place, float squared) {
                     const Site other = next_.grid_sites[place];
                     const float range = reach_.range(site, other);
                     if (squared > range * range || other == site) return;
                     if (!may_meet(site, other, next_.list)) return;
                     if (!was_cut && !surface_.was_cut(other)) {
                       if (!std::exchange(is_stamped, true)) stamp_near_sites();
                       if (is_near_.has(other)) return;
                     }
                     next_.found.push_back({site, other});
                     next_.found.push_back({other, site});
                     least_squared = std::min(least_squared, squared);
                   });
  next_.list.note_squared_distance(least_squared);
}

// Measures how far nodes have gone since the last tick, and are from their references. A piece that
// flies is clear of all others, and counts again where it lands.
void SelfContactList::follow_motion(const world::World& world) {
  float farthest_squared = 0, longest = 0;
  for (const Site s : surface_.sites()) {
    const bool flies = world.node_classes[s] == world::NodeClass::Asleep &&
                       length_squared(world.velocities[s]) > 0;
    if (flies) continue;
    const Vec3f place = position(s, world);
    const float squared = length_squared(place - places_[s]);
    if (squared > 0) {
      places_[s] = place;
      travels_[s] += kLonger * std::sqrt(squared) + kTravelRounding_m;
      longest = std::max(longest, travels_[s]);
    }
    farthest_squared = std::max(farthest_squared, length_squared(place - list_.references[s]));
  }
  farthest_m_ = std::sqrt(farthest_squared);
  if (longest <= kLongestTravel_m) return;
  std::ranges::fill(travels_, 0.0f);
  for (auto* list : {&list_, &next_.list}) list->forget_distances();
}

// Made anew when a node is farther than kBegins slacks from its reference, and done before that is
// half a slack.
void SelfContactList::keep(const world::World& world) {
  follow_motion(world);
  const float half = 0.5f * reach_.slack_m, begins = kBegins * reach_.slack_m;
  if (!has_list_) {
    begin_list();
    return go_on_listing(1, world);
  }
  if (!is_listing_ && farthest_m_ <= begins) return;
  if (!is_listing_) begin_list();
  const auto share = (farthest_m_ - begins) / (half - begins);
  go_on_listing(static_cast<double>(share), world);
  if (is_listing_) return;
  // Somebody may have gone as far since the new list took its reference.
  follow_motion(world);
  if (farthest_m_ <= half) return;
  begin_list();
  go_on_listing(1, world);
}

}  // namespace trocar::contact

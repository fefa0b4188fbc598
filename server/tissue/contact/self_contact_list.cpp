// This file lists the pairs of nodes that can come near.

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/math/box.h"
#include "server/tissue/contact/self_contact.h"

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
// Nodes in a cube of this width look for pairs in the same ticks.
constexpr float kPhaseCube_m = 0.03f;

std::uint8_t phase_at(const Vec3f& place) {
  const auto cube = [](float x) { return static_cast<std::int32_t>(std::floor(x / kPhaseCube_m)); };
  const auto mixed = cube(place.x) * 23 + cube(place.y) * 37 + cube(place.z) * 11;
  return static_cast<std::uint8_t>(mixed & static_cast<std::int32_t>(kLookEvery - 1));
}

}  // namespace

SelfContactFinder::SelfContactFinder(const organ::Organ& organ) : surface_(organ), grid_(1, 1) {
  moved_m_ = std::clamp(kMovedEdges * surface_.mean_edge_m(), 1e-4f, kMaxMoved_m);
  slack_m_ = kSlack * moved_m_;
  // An edge far longer than the mean one is a flaw of the mesh.
  corner_reach_m_ = kCornerReach * std::min(surface_.longest_edge_m(), 3 * surface_.mean_edge_m());
  reach_m_ = kSelfMaxMargin_m + corner_reach_m_;
  const auto sites = surface_.sites();
  due_.reserve(sites.size());
  grid_sites_.reserve(sites.size());
  for (auto* list : {&list_, &next_list_}) {
    list->pairs.reserve(kReservedPairs);
    list->far_until.reserve(kReservedPairs);
    list->runs.reserve(sites.size());
  }
  found_.reserve(kReservedPairs);
  next_found_.reserve(kReservedPairs);
  extend();
  update_corner_reaches(sites);
  // Two nodes that have both moved by this come so much nearer.
  const float range = reach_m_ + 2 * moved_m_;
  grid_ = PointGrid(range, sites.size());
  grid_.build(sites.size(), [&](std::size_t i) { return surface_.rest_position(sites[i]); });
  for (const Site s : sites)
    grid_.visit(surface_.rest_position(s), range, [&](std::uint32_t place, float) {
      if (surface_.faced_at_rest(s, sites[place]) && !surface_.is_near(s, sites[place]))
        is_close_at_rest_[s] = 1;
    });
  grid_ = PointGrid(reach_m_ + slack_m_, sites.size());
}

// Makes room for all nodes and triangles.
void SelfContactFinder::extend() {
  const auto count = surface_.node_count();
  is_close_at_rest_.resize(count);
  corner_reaches_.resize(count);
  places_.resize(count);
  travels_.resize(count);
  for (auto s = static_cast<Site>(phases_.size()); s < count; ++s)
    phases_.push_back(phase_at(surface_.rest_position(s)));
  for (auto* list : {&list_, &next_list_}) {
    list->references.resize(count);
    list->has_left.resize(count);
  }
  is_due_.resize(count);
  near_stamp_.resize(count);
  stirred_stamp_.resize(count);
  stirred_nearest_.resize(count);
  has_pair_.resize(count);
  paces_.resize(count);
  normals_.resize(2 * count);
  normal_stamp_.resize(2 * count);
  ups_.resize(surface_.triangle_count());
  up_stamp_.resize(surface_.triangle_count());
}

float SelfContactFinder::measured_corner_reach(Site site) const {
  float squared = 0;
  for (const auto t : surface_.triangles_of(site)) {
    const auto& [a, b, c] = surface_[t];
    const Vec3f &pa = surface_.rest_position(a), &pb = surface_.rest_position(b),
                &pc = surface_.rest_position(c);
    squared = std::max(
        {squared, length_squared(pa - pb), length_squared(pb - pc), length_squared(pc - pa)});
  }
  return std::min(kCornerReach * std::sqrt(squared), corner_reach_m_);
}

// Pairs of nodes that now reach farther are looked at again.
void SelfContactFinder::update_corner_reaches(std::span<const Site> sites) {
  for (const Site s : sites) {
    const float reach = measured_corner_reach(s), before = std::exchange(corner_reaches_[s], reach);
    if (!(reach > before)) continue;
    for (auto* list : {&list_, &next_list_}) forget_distances(s, *list);
  }
}

// A list has each pair from both sides.
void SelfContactFinder::forget_distances(Site site, List& list) {
  const auto& pairs = list.pairs;
  const auto place_of = [&](NodePair pair) {
    return static_cast<std::size_t>(std::ranges::lower_bound(pairs, pair) - pairs.begin());
  };
  for (auto i = place_of({site, 0}); i < pairs.size() && pairs[i].node == site; ++i) {
    list.far_until[i] = kMayBeNear_m;
    list.far_until[place_of({pairs[i].across, site})] = kMayBeNear_m;
  }
}

void SelfContactFinder::set_reference(Site site, const world::World& world, List& list) const {
  list.references[site] = position(site, world);
  list.has_left[site] = has_moved(site, moved_m_ - 0.5f * slack_m_, world) ? 1 : 0;
}

// Adds the pairs of nodes that the edit has changed to the present list and to the next one.
// add_to_list() drops what the next one finds twice.
void SelfContactFinder::update(const topology::Edit& edit, const world::World& world) {
  const auto before = surface_.sites();
  const bool has_references = is_listing_ && sites_seen_ == before.size();
  // The first site whose reference the next list lacks.
  const Site unseen = !has_references && is_listing_ ? before[sites_seen_] : Site{0};
  surface_.update(edit, world);
  extend();
  update_corner_reaches(surface_.updated());
  for (const auto node : edit.surface.touched) is_close_at_rest_[node.value] = 1;
  for (const auto node : edit.surface.surfaced) {
    const Site s = node.value;
    set_reference(s, world, list_);
    places_[s] = list_.references[s];
    is_due_[s] = 0;
    if (has_references || s < unseen) set_reference(s, world, next_list_);
  }
  if (has_list_) list_pairs_of(surface_.updated(), list_), add_to_list(found_, list_);
  if (!is_listing_) return;
  const auto sites = surface_.sites();
  if (!has_references) {
    sites_seen_ = static_cast<std::size_t>(std::ranges::lower_bound(sites, unseen) - sites.begin());
    return;
  }
  sites_seen_ = sites.size();
  list_pairs_of(surface_.updated(), next_list_);
  next_found_.insert(next_found_.end(), found_.begin(), found_.end());
}

// Returns whether the node may meet nodes that do not look around themselves.
bool SelfContactFinder::looks_around(Site site, const List& list) const {
  return list.has_left[site] == 1 || is_close_at_rest_[site] == 1 ||
         surface_.is_of(site, Sort::Wound);
}

// A list has each pair from both sides or not at all.
void SelfContactFinder::list_pairs_of(std::span<const Site> sites, List& list) {
  const float range = reach_m_ + slack_m_;
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
  float least_squared = list.least_distance * list.least_distance;
  for (const Site s : sites) {
    auto known = std::ranges::lower_bound(list.pairs, NodePair{s, 0});
    for (const Site other : looks_around(s, list) ? around_ : looking_) {
      const float squared = length_squared(references[s] - references[other]);
      const float pair_range = range_of(s, other);
      if (squared > pair_range * pair_range || other == s) continue;
      while (known != list.pairs.end() && *known < NodePair{s, other}) ++known;
      const bool is_known = known != list.pairs.end() && *known == NodePair{s, other};
      if (is_known || !may_meet(s, other, list)) continue;
      found_.push_back({s, other});
      found_.push_back({other, s});
      least_squared = std::min(least_squared, squared);
    }
  }
  list.least_distance = std::min(list.least_distance, std::sqrt(least_squared));
}

// Inserts pairs that the list lacks. `found` has each from both sides, some of them twice.
void SelfContactFinder::add_to_list(std::vector<NodePair>& found, List& list) {
  std::ranges::sort(found, {}, [](const NodePair& pair) {
    return std::uint64_t{pair.node} << 32 | pair.across;  // in one comparison
  });
  found.erase(std::unique(found.begin(), found.end()), found.end());
  auto& pairs = list.pairs;
  // Entries are merged from the back, so that each moves only once.
  auto old = pairs.size(), fresh = found.size();
  pairs.resize(old + fresh);
  list.far_until.resize(old + fresh);
  while (fresh > 0) {
    const auto place = old + fresh - 1;
    const bool is_old = old > 0 && found[fresh - 1] < pairs[old - 1];
    pairs[place] = is_old ? pairs[old - 1] : found[fresh - 1];
    list.far_until[place] = is_old ? list.far_until[old - 1] : kMayBeNear_m;
    --(is_old ? old : fresh);
  }
  list.runs.clear();
  for (std::uint32_t i = 0; i < pairs.size(); ++i)
    if (i == 0 || pairs[i].node != pairs[i - 1].node) list.runs.push_back({pairs[i].node, i});
}

// The list has all pairs of nodes whose references are within range_of() and that may
// meet: if they faced each other at rest or one of the references at least is nearly moved_m_ from
// rest, and they are not near each other as the uncut organ is; or, of wounds, if they are not
// beside each other on one lip, or one of the references is as far from rest as what is beside. A
// reference is where the node was when its surroundings were last looked through; it is never
// farther than slack_m_ / 2 from where the node is now. So each pair that is within reach_of() is
// on the list, and only what moves is looked through again.
void SelfContactFinder::begin_list() {
  is_listing_ = true;
  next_list_.least_distance = 1;
  next_list_.pairs.clear();
  next_list_.far_until.clear();
  next_found_.clear();
  sites_seen_ = sites_listed_ = due_count_ = 0;
}

void SelfContactFinder::set_references(std::size_t end, const world::World& world) {
  const float far = kDue * slack_m_;
  for (; sites_seen_ < end; ++sites_seen_) {
    const Site s = surface_.sites()[sites_seen_];
    const Vec3f& old = list_.references[s];
    is_due_[s] = !has_list_ || length_squared(position(s, world) - old) > far * far ? 1 : 0;
    if (is_due_[s] == 0) {
      next_list_.references[s] = old;
      next_list_.has_left[s] = list_.has_left[s];
      continue;
    }
    set_reference(s, world, next_list_);
    ++due_count_;
  }
}

// Lists due nodes cell by cell, because neighbours look through the same cells.
void SelfContactFinder::order_due() {
  due_.clear();
  if (due_count_ == 0) return;
  grid_sites_.assign(surface_.sites().begin(), surface_.sites().end());
  grid_.build(grid_sites_.size(),
              [&](std::size_t i) { return next_list_.references[grid_sites_[i]]; });
  for (const auto i : grid_.entries()) {
    const Site s = grid_sites_[i];
    // At first, whoever stays where nothing faces it has nothing to look for.
    if (is_due_[s] == 1 && (has_list_ || next_list_.has_left[s] == 1 || is_close_at_rest_[s] == 1))
      due_.push_back(s);
  }
}

// Copies those pairs of the present list to the next one of which neither node is due.
void SelfContactFinder::keep_pairs() {
  const auto& references = next_list_.references;
  float least_squared = next_list_.least_distance * next_list_.least_distance;
  for (std::size_t i = 0; i < list_.pairs.size(); ++i) {
    const auto& pair = list_.pairs[i];
    if (is_due_[pair.node] == 1 || is_due_[pair.across] == 1) continue;
    next_list_.pairs.push_back(pair);
    next_list_.far_until.push_back(list_.far_until[i]);
    least_squared =
        std::min(least_squared, length_squared(references[pair.node] - references[pair.across]));
  }
  next_list_.least_distance = std::min(next_list_.least_distance, std::sqrt(least_squared));
}

void SelfContactFinder::end_list() {
  add_to_list(next_found_, next_list_);
  std::swap(list_, next_list_);
  is_listing_ = false;
  has_list_ = true;
  ++lists_made_;
}

// share: how much of the work shall be done by now. All of it is done at once; else each tick does
// a little of one kind.
void SelfContactFinder::go_on_listing(double share, const world::World& world) {
  const auto part = [](double of_it, std::size_t all) {
    return static_cast<std::size_t>(std::clamp(of_it, 0.0, 1.0) * static_cast<double>(all));
  };
  if (sites_seen_ < surface_.sites().size()) {
    const auto end = std::max(part(share / kReferencesShare, surface_.sites().size()),
                              sites_seen_ + kReferencesPerTick);
    set_references(std::min(end, surface_.sites().size()), world);
    if (sites_seen_ < surface_.sites().size()) return;
    keep_pairs();
    order_due();
    if (share < 1) return;
  }
  const auto end = std::max(part((share - kReferencesShare) / (1 - kReferencesShare), due_.size()),
                            sites_listed_ + kSitesPerTick);
  for (; sites_listed_ < std::min(end, due_.size()); ++sites_listed_)
    list_around(due_[sites_listed_]);
  if (sites_listed_ == due_.size()) end_list();
}

bool SelfContactFinder::may_meet(Site site, Site other, const List& list) const {
  if (surface_.is_of(site, Sort::Wound) && surface_.is_of(other, Sort::Wound)) {
    const float far = surface_.near_m() - 0.5f * slack_m_;
    if (!surface_.share_lip_at_rest(site, other) || was_moved(site, far, list) ||
        was_moved(other, far, list))
      return true;
  }
  return list.has_left[site] == 1 || list.has_left[other] == 1 ||
         ((is_close_at_rest_[site] == 1 || is_close_at_rest_[other] == 1) &&
          surface_.faced_at_rest(site, other));
}

void SelfContactFinder::list_around(Site site) {
  const auto stamp_near_sites = [&] {
    if (++near_current_ == 0) {
      std::ranges::fill(near_stamp_, 0u);
      near_current_ = 1;
    }
    for (const auto s : surface_.near(site)) near_stamp_[s] = near_current_;
  };
  bool is_stamped = false;
  const bool was_cut = surface_.was_cut(site);
  float least_squared = next_list_.least_distance * next_list_.least_distance;
  grid_.visit(next_list_.references[site], reach_m_ + slack_m_,
              [&](std::uint32_t place, float squared) {
                const Site other = grid_sites_[place];
                const float range = range_of(site, other);
                if (squared > range * range || other == site) return;
                if (!may_meet(site, other, next_list_)) return;
                if (!was_cut && !surface_.was_cut(other)) {
                  if (!std::exchange(is_stamped, true)) stamp_near_sites();
                  if (near_stamp_[other] == near_current_) return;
                }
                next_found_.push_back({site, other});
                next_found_.push_back({other, site});
                least_squared = std::min(least_squared, squared);
              });
  next_list_.least_distance = std::min(next_list_.least_distance, std::sqrt(least_squared));
}

// Measures how far nodes have gone since the last tick, and are from their references. A piece that
// flies is clear of all others, and counts again where it lands.
void SelfContactFinder::follow_motion(const world::World& world) {
  float farthest_squared = 0, longest = 0;
  for (const Site s : surface_.sites()) {
    const bool flies = paces_[s] == Pace::Asleep && length_squared(world.velocities[s]) > 0;
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
  if (longest > kLongestTravel_m) forget_travels();
}

void SelfContactFinder::forget_travels() {
  std::ranges::fill(travels_, 0.0f);
  for (auto* list : {&list_, &next_list_}) std::ranges::fill(list->far_until, kMayBeNear_m);
}

// Made anew when a node is farther than kBegins slacks from its reference, and done before that is
// half a slack.
void SelfContactFinder::keep_list(const world::World& world) {
  follow_motion(world);
  const float half = 0.5f * slack_m_, begins = kBegins * slack_m_;
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

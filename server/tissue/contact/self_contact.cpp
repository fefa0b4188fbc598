// Why a penalty on pairs that are remembered.
//
// A node and the closest point of a triangle, with barycentric weights w, press with
//   f = k A/2 max(0, shift - n . (x - sum_c w_c x_c)) n,   k = kSelfStiffnessPaPerM,
// A the node's share of the surface; half of it, because nodes of both sides meet each other's
// triangles. Minus f goes to the corners by their weights, so that forces and torques balance.
//
// A force from the present gap alone knows no side: tissue that is pressed through a thin fold
// would be pushed out behind it. Continuous collision detection finds the side, but asks for a
// search along each path in each tick. Here a pair begins before node and triangle can touch, while
// they face each other across a gap, and is state from then on: it keeps its side however deep it
// is pressed. The normal n is the mean of both sides', interpolated by w, so that it turns smoothly
// while the pair slides over edges; the closest point is that of Ericson 2005, sec. 5.1.5.
//
// Where a pair is looked at anew, point and normal change, and with them the gap. Tissue has not
// moved meanwhile: a node that lies deeper behind its new triangle than it did behind the old one
// would get energy from nowhere, and crumpled flaps shook for ever with it. So a pair presses no
// harder after a look than before. The rest of the overlap is in its shift, and comes back slowly
// (eased_shift()), as solvers of rigid contact bound the speed at which they part bodies.
//
// Neighbours in the tissue are near each other without touching. They never meet: neither within
// kNearLayers of edges through the tissue, nor, where cuts have parted the tissue, within as many
// edges' length along the surface that there is now (self_surface.h).

#include "server/tissue/contact/self_contact.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/tick.h"
#include "common/math/nearest_point.h"
#include "server/tissue/contact/surface.h"

namespace trocar::contact {
namespace {

// Faces that touch at rest may do so for ever: a force begins this far beyond.
constexpr float kTouch_m = 2e-6f;
constexpr float kOverlapAtRest_m = 0.001f;
// Cosine of the normals: of a pair that begins, and of one that goes on.
constexpr float kBeginsFacing = -0.1f, kStaysFacing = 0.2f;
// The closest point lies along the normal, within so many gaps and a little.
constexpr float kAsidePerGap = 1, kAside_m = 0.0005f;
constexpr float kDeepest_m = 0.008f;
// In a look this share of the overlap that is not pressed comes back, but no more than so far and
// such a share of the way in a tick: what trembles gets less than friction would take from it.
constexpr float kComesBack = 1e-3f, kComesBack_m = 5e-8f, kComesBackPerWay = 0.01f;
// A pair whose triangle an edit has replaced presses no deeper than this.
constexpr float kDeepestAnew_m = 2e-5f;
constexpr float kNoLimit_n = 1e6f;
// A triangle's corners may move against each other so many times as far as its node may drift: its
// normal then turns by some hundredths of a radian.
constexpr float kCornerDrifts = 16;

// Returns the most ticks, a power of two, in which what moves at this speed stays within a way.
Tick ticks_within(float way_m, float squared_speed) {
  const float squared_way = way_m * way_m;
  Tick ticks = kLookEvery;
  while (ticks > 1) {
    const float seconds = kTickSeconds * static_cast<float>(ticks);
    if (squared_speed * (seconds * seconds) < squared_way) break;
    ticks /= 2;
  }
  return ticks;
}

bool is_asleep_at(std::uint32_t node, const world::World& world) {
  const auto node_class = world.node_classes[node];
  return node_class == world::NodeClass::Asleep ||
         (node_class == world::NodeClass::Fixed && !(length_squared(world.velocities[node]) > 0));
}

}  // namespace

SelfContactTable::SelfContactTable() {
  nodes_.reserve(kMaxSelfPoints);
  triangles_.reserve(kMaxSelfPoints);
  places_.reserve(kMaxSelfPoints);
}

namespace {
bool is_place(const SelfContactPlace& place) {
  const auto& w = place.weights;
  return w.x >= 0 && w.y >= 0 && w.z >= 0 && std::abs(w.x + w.y + w.z - 1) < 1e-4f &&
         std::abs(length_squared(place.normal) - 1) < 1e-3f &&
         std::abs(place.shift) <= 2 * (kOverlapAtRest_m + kDeepest_m);
}
}  // namespace

void SelfContactTable::visit_state(world::StateArchive& archive,
                                   std::span<const NodeIndex> surface_nodes,
                                   std::size_t triangle_count) {
  archive.value(last_pass_);
  archive.value(has_edit_);
  if (archive.is_reading()) {
    clear();
    if (archive.at_end()) return;
  } else if (nodes_.empty()) {
    return;
  }
  archive.sized_array(nodes_, kMaxSelfPoints);
  archive.sized_array(triangles_, kMaxSelfPoints);
  archive.sized_array(places_, kMaxSelfPoints);
  if (!archive.is_reading()) return;
  bool is_good = !nodes_.empty() && nodes_.size() == triangles_.size() &&
                 nodes_.size() == places_.size() && std::ranges::all_of(places_, is_place);
  for (std::size_t i = 0; is_good && i < nodes_.size(); ++i)
    is_good = std::ranges::binary_search(surface_nodes, nodes_[i]) &&
              triangles_[i].value < triangle_count && (i == 0 || nodes_[i - 1] < nodes_[i]);
  if (is_good) return;
  archive.fail();
  clear();
}

const Vec3f& SelfContactFinder::normal(Site site, Sort sort, const world::World& world) {
  const std::size_t place = 2 * std::size_t{site} + static_cast<std::size_t>(sort);
  if (normal_stamp_[place] == tick_current_) return normals_[place];
  normal_stamp_[place] = tick_current_;
  return normals_[place] =
             surface_.normal(site, sort, [&](TriangleIndex t) { return up(t, world); });
}

// Returns that normal of the node, of skin or wound, which is most opposed to `theirs`.
Vec3f SelfContactFinder::normal_towards(Site site, const Vec3f& theirs, const world::World& world) {
  if (!surface_.is_of(site, Sort::Wound)) return normal(site, Sort::Skin, world);
  const Vec3f& of_wound = normal(site, Sort::Wound, world);
  if (!surface_.is_of(site, Sort::Skin)) return of_wound;
  const Vec3f& of_skin = normal(site, Sort::Skin, world);
  const bool is_wound =
      length_squared(of_wound) > 0 && dot(of_wound, theirs) <= dot(of_skin, theirs);
  return is_wound ? of_wound : of_skin;
}

const Vec3f& SelfContactFinder::up(TriangleIndex triangle, const world::World& world) {
  auto& up = ups_[triangle.value];
  if (std::exchange(up_stamp_[triangle.value], tick_current_) != tick_current_)
    up = surface_.up(triangle, [&](Site s) { return position(s, world); });
  return up;
}

bool SelfContactFinder::can_meet(Site site, TriangleIndex triangle, const world::World& world) {
  if (surface_.is_behind(site, triangle)) return false;
  if (!is_of_lips(site, triangle)) return !surface_.is_near(site, triangle);
  return dot(up(triangle, world), normal(site, Sort::Wound, world)) < 0 &&
         !surface_.shares_side(site, triangle);
}

SelfContactFinder::ClosestPoint SelfContactFinder::closest_point(Site site, TriangleIndex triangle,
                                                                 const world::World& world) const {
  const auto& sites = surface_[triangle];
  const Vec3f p = position(site, world), a = position(sites[0], world),
              b = position(sites[1], world), c = position(sites[2], world);
  const Vec3f w = nearest_weights(p, a, b, c);
  const Vec3f from = p - (a * w.x + b * w.y + c * w.z);
  return {triangle, w, from, length_squared(from)};
}

// Returns the closest point on the triangles at some nodes, on the first triangle of equals.
SelfContactFinder::ClosestPoint SelfContactFinder::closest_point_around(
    Site site, std::span<const Site> around, bool is_of_lips, const world::World& world) {
  ClosestPoint best;
  for (std::size_t k = 0; k < around.size(); ++k)
    for (const auto t : surface_.triangles_of(around[k])) {
      const bool is_seen = std::ranges::any_of(
          around.first(k), [&](Site s) { return std::ranges::count(surface_[t], s) > 0; });
      if (is_seen || this->is_of_lips(site, t) != is_of_lips) continue;
      const ClosestPoint closest = closest_point(site, t, world);
      const bool is_better = !best.triangle.is_valid() || closest.squared < best.squared ||
                             (closest.squared == best.squared && closest.triangle < best.triangle);
      if (is_better && can_meet(site, t, world)) best = closest;
    }
  return best;
}

SelfContactFinder::Touch SelfContactFinder::touch_at(Site site, const ClosestPoint& closest,
                                                     const world::World& world) {
  const auto& sites = surface_[closest.triangle];
  const auto sort = surface_.sort_of(closest.triangle);
  const float weights[] = {closest.weights.x, closest.weights.y, closest.weights.z};
  // Corners on a wound's front are as the triangle itself.
  const Vec3f flat =
      sort == Sort::Wound ? normalized(up(closest.triangle, world), {0, 1, 0}) : Vec3f{};
  Vec3f theirs, velocity = world.velocities[site], rest[3];
  Touch touch;
  touch.at_rest = world.rest_positions[site];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto node = sites[k];
    const Vec3f& at_corner = normal(node, sort, world);
    const bool is_flat = sort == Sort::Wound && !(dot(at_corner, flat) > 0);
    theirs += (is_flat ? flat : at_corner) * weights[k];
    velocity -= world.velocities[node] * weights[k];
    rest[k] = world.rest_positions[node];
    touch.at_rest -= rest[k] * weights[k];
  }
  const Vec3f own = normal_towards(site, theirs, world);
  theirs = normalized(theirs, -own);
  touch.own = own;
  touch.facing = dot(own, theirs);
  touch.normal = normalized(theirs - own, theirs);
  touch.shift = -kTouch_m;
  if (length_squared(touch.at_rest) < kOverlapAtRest_m * kOverlapAtRest_m) {
    const Vec3f up = normalized(cross(rest[1] - rest[0], rest[2] - rest[0]), touch.normal);
    touch.shift += std::min(0.0f, dot(up, touch.at_rest));
  }
  const float along = dot(touch.normal, closest.from);
  touch.gap = along - touch.shift;
  touch.aside = std::sqrt(std::max(0.0f, closest.squared - along * along));
  touch.closing = -dot(touch.normal, velocity);
  return touch;
}

float SelfContactFinder::margin_of(float closing) const {
  const float seconds = kTickSeconds * (static_cast<float>(pass_interval_) + kSelfTicksAhead);
  return std::min(kSelfMargin_m + seconds * std::max(0.0f, closing), kSelfMaxMargin_m);
}

namespace {
bool lies_along(float aside, float gap) {
  return aside <= kAsidePerGap * std::abs(gap) + kAside_m;
}
}  // namespace

// The other side of a wound, whether or not anything has moved.
bool SelfContactFinder::can_meet_lip(Site site, Site across, const world::World& world) const {
  if (!surface_.is_on_lip(site) || !surface_.is_of(across, Sort::Wound)) return false;
  const float far = surface_.near_m();
  return !surface_.share_lip_at_rest(site, across) || has_moved(site, far, world) ||
         has_moved(across, far, world);
}

bool SelfContactFinder::can_meet_other(Site site, Site across, bool is_moved,
                                       const world::World& world) {
  if (!(is_moved || has_moved(across, moved_m_, world) || surface_.faced_at_rest(site, across)) ||
      !surface_.is_of_any(site) || !surface_.is_of_any(across))
    return false;
  return dot(main_normal(site, world), main_normal(across, world)) <= kStaysFacing &&
         // Only cut nodes need this check: the list has no near pairs of nodes that were never cut.
         !((surface_.was_cut(site) || surface_.was_cut(across)) && surface_.is_near(site, across));
}

// Whether a pair begins with a triangle at this node.
bool SelfContactFinder::begins(Site site, Site nearest, float squared, bool is_of_lips,
                               const world::World& world, ClosestPoint& closest, Touch& touch) {
  closest = closest_point_around(site, std::span(&nearest, 1), is_of_lips, world);
  if (!closest.triangle.is_valid()) return false;
  touch = touch_at(site, closest, world);
  // Nothing here may let in what find() or a list would not have looked at.
  const float margin = margin_of(touch.closing), reach = corner_reaches_[nearest] + margin;
  return touch.facing < kBeginsFacing && touch.gap >= 0 && closest.squared < margin * margin &&
         squared < reach * reach && lies_along(touch.aside, touch.gap) &&
         dot(closest.from, normalized(up(closest.triangle, world), touch.normal)) >= touch.shift &&
         dot(closest.from, touch.own) <= -touch.shift;
}

bool SelfContactFinder::begins(Site site, const Nearest& nearest, const world::World& world,
                               ClosestPoint& closest, Touch& touch) {
  return (nearest.of_lips != kNoSite &&
          begins(site, nearest.of_lips, nearest.squared_of_lips, true, world, closest, touch)) ||
         (nearest.other != kNoSite &&
          begins(site, nearest.other, nearest.squared_other, false, world, closest, touch));
}

float SelfContactFinder::squared_distance(std::size_t listed, const world::World& world) {
  const auto& pair = list_.pairs[listed];
  const float squared = length_squared(position(pair.across, world) - position(pair.node, world));
  const float reach = reach_of(pair.node, pair.across);
  const float reach_now = reach - (kSelfMaxMargin_m - margin_now_m_);
  if (squared > reach_now * reach_now)
    list_.far_until[listed] =
        travels_[pair.node] + travels_[pair.across] + (std::sqrt(squared) - reach) - kRounding_m;
  return squared;
}

// Those across are considered in ascending order: of equals the first is the nearest.
void SelfContactFinder::consider(Site site, Site across, float squared, const world::World& world,
                                 Nearest& nearest) {
  const float reach = corner_reaches_[across] + margin_now_m_;
  if (squared >= reach * reach) return;
  if (squared < nearest.squared_of_lips && can_meet_lip(site, across, world) &&
      dot(normal(site, Sort::Wound, world), normal(across, Sort::Wound, world)) <= kStaysFacing) {
    nearest.squared_of_lips = squared;
    nearest.of_lips = across;
  }
  if (squared < nearest.squared_other &&
      can_meet_other(site, across, has_moved(site, moved_m_, world), world)) {
    nearest.squared_other = squared;
    nearest.other = across;
  }
}

// Nodes that look stir those that they are listed with. Who waits and has no pair meets nobody but
// them, so that its nearest are found here, without a search through all with whom it is listed.
void SelfContactFinder::stir(const world::World& world) {
  const auto& runs = list_.runs;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Site site = runs[r].node;
    if (paces_[site] != Pace::Looks) continue;
    for (auto i = std::size_t{runs[r].first}; i < end_of_run(r); ++i) {
      if (is_far(i)) continue;
      const Site across = list_.pairs[i].across;
      if (std::exchange(stirred_stamp_[across], tick_current_) != tick_current_)
        stirred_nearest_[across] = {};
      if (paces_[across] == Pace::Looks || has_pair_[across] == 1) continue;
      consider(across, site, squared_distance(i, world), world, stirred_nearest_[across]);
    }
  }
}

SelfContactFinder::Nearest SelfContactFinder::find_nearest(Site site, std::size_t first,
                                                           std::size_t end,
                                                           const world::World& world) {
  Nearest nearest;
  const bool looks_at_all = paces_[site] == Pace::Looks;
  for (auto i = first; i < end; ++i) {
    const Site across = list_.pairs[i].across;
    if (is_far(i) || (!looks_at_all && paces_[across] != Pace::Looks)) continue;
    consider(site, across, squared_distance(i, world), world, nearest);
  }
  return nearest;
}

// Returns the corners of a triangle around which the search for a nearer point goes on from its
// closest point. With is_there_only these are the ends of the edge, or the corner, that the point
// lies on: lips that have not moved are corner on corner.
std::span<const SelfSurface::Site> SelfContactFinder::around(TriangleIndex triangle,
                                                             const Vec3f& weights,
                                                             bool is_there_only) {
  const auto& corners = surface_[triangle];
  if (!is_there_only) return corners;
  const float of_corner[] = {weights.x, weights.y, weights.z};
  corners_.clear();
  for (std::size_t k = 0; k < 3; ++k)
    if (of_corner[k] > 0) corners_.push_back(corners[k]);
  return corners_;
}

// Finds where a pair is now; returns false when it has come apart.
bool SelfContactFinder::stays(Site site, TriangleIndex triangle, const world::World& world,
                              ClosestPoint& closest, Touch& touch) {
  const bool is_of_lips = this->is_of_lips(site, triangle);
  const bool is_there = !surface_.is_gone(triangle) && can_meet(site, triangle, world);
  if (!is_there && !surface_.is_gone(triangle) && !is_of_lips) return false;
  if (is_there) closest = closest_point(site, triangle, world);
  const Vec3f& w = closest.weights;
  if (!is_there || !(w.x > 0 && w.y > 0 && w.z > 0))
    closest =
        closest_point_around(site, around(triangle, w, is_there && is_of_lips), is_of_lips, world);
  if (!closest.triangle.is_valid()) return false;
  touch = touch_at(site, closest, world);
  // A little farther than where it began, so that it does not flutter.
  // Where neither side faces anywhere there is no normal, and nothing to press against.
  return touch.facing < kStaysFacing && length_squared(touch.normal) > 0 &&
         touch.gap < margin_of(touch.closing) + 0.5f * kSelfMargin_m && touch.gap > -kDeepest_m &&
         lies_along(touch.aside, touch.gap);
}

// After an edit active nodes of wounds that have no pair look, however slow they are: it may have
// opened them just now.
void SelfContactFinder::find_pace(const world::World& world, std::span<const NodeIndex> paired) {
  auto pair = paired.begin();
  for (const Site s : surface_.sites()) {
    const bool has_pair = pair != paired.end() && pair->value == s;
    if (has_pair) ++pair;
    has_pair_[s] = has_pair ? 1 : 0;
    const bool may_be_fresh = follows_edit_ && !has_pair &&
                              world.node_classes[s] == world::NodeClass::Active &&
                              surface_.is_of(s, Sort::Wound);
    const bool looks =
        may_be_fresh ||
        is_turn(phases_[s], ticks_within(kLookDrift_m, length_squared(world.velocities[s])), world);
    paces_[s] = is_asleep_at(s, world) ? Pace::Asleep : looks ? Pace::Looks : Pace::Waits;
  }
}

// Finds what decides whether there is a pass.
void SelfContactFinder::survey(const world::World& world) {
  is_any_awake_ = false;
  fastest_squared_ = 0;
  for (const Site s : surface_.sites()) {
    is_any_awake_ |= !is_asleep_at(s, world);
    fastest_squared_ = std::max(fastest_squared_, length_squared(world.velocities[s]));
  }
  pass_interval_ = std::min(kPassEvery, ticks_within(kPassDrift_m, fastest_squared_));
}

bool SelfContactFinder::is_asleep(Site site, TriangleIndex triangle,
                                  const world::World& world) const {
  return is_asleep_at(site, world) &&
         std::ranges::all_of(surface_[triangle], [&](Site s) { return is_asleep_at(s, world); });
}

float SelfContactFinder::squared_drift(Site site, TriangleIndex triangle, const Vec3f& weights,
                                       const world::World& world) const {
  const auto& corners = surface_[triangle];
  const Vec3f& own = world.velocities[site];
  const Vec3f of_corner[] = {world.velocities[corners[0]] - own, world.velocities[corners[1]] - own,
                             world.velocities[corners[2]] - own};
  float squared = length_squared(of_corner[0] * weights.x + of_corner[1] * weights.y +
                                 of_corner[2] * weights.z);
  for (const Vec3f& v : of_corner)
    squared = std::max(squared, length_squared(v) * (1 / (kCornerDrifts * kCornerDrifts)));
  return squared;
}

bool SelfContactFinder::is_due(Site site, TriangleIndex triangle, const Vec3f& weights,
                               const world::World& world) const {
  const bool is_near = world.node_classes[site] == world::NodeClass::Active;
  const auto interval = ticks_within(is_near ? kNearDrift_m : kDrift_m,
                                     squared_drift(site, triangle, weights, world));
  return is_turn(site, interval, world);
}

// Returns the shift of a pair after a look at it; place: where it was before.
float SelfContactFinder::eased_shift(Site site, TriangleIndex triangle, const Place& place,
                                     const ClosestPoint& closest, const Touch& touch,
                                     const world::World& world) const {
  float least = -kDeepestAnew_m;
  if (!surface_.is_gone(triangle)) {
    const auto& corners = surface_[triangle];
    const auto& w = place.weights;
    const Vec3f from = position(site, world) -
                       (position(corners[0], world) * w.x + position(corners[1], world) * w.y +
                        position(corners[2], world) * w.z);
    const float way =
        kTickSeconds * std::sqrt(squared_drift(site, closest.triangle, closest.weights, world));
    const float comes_back = std::min(kComesBack * std::max(0.0f, touch.shift - place.shift),
                                      kComesBack_m + kComesBackPerWay * way);
    least = std::min(0.0f, dot(place.normal, from) - place.shift) - comes_back;
  }
  return touch.shift + std::min(0.0f, touch.gap - least);
}

void SelfContactFinder::add_pair(Site site, TriangleIndex triangle, const Place& place,
                                 const world::World& world, SelfContactTable& pairs,
                                 ContactList& out) const {
  if (pairs.nodes().size() >= kMaxSelfPoints) {
    ++out.dropped;
    return;
  }
  pairs.add(NodeIndex(site), triangle, place);
  add_point(pairs, pairs.nodes().size() - 1, world, out);
}

// Adds the point of a pair, unless nobody has to solve it.
void SelfContactFinder::add_point(const SelfContactTable& pairs, std::size_t pair,
                                  const world::World& world, ContactList& out) const {
  const NodeIndex node = pairs.nodes()[pair];
  const Site site = node.value;
  const auto triangle = pairs.triangles()[pair];
  const Place& place = pairs.places()[pair];
  if (is_asleep(site, triangle, world)) return;
  // Clang 14 lets no lambda capture a structured binding.
  const auto& corners = surface_[triangle];
  const Site a = corners[0], b = corners[1], c = corners[2];
  const auto& w = place.weights;
  const auto between = [&](const auto& at) {
    return at(site) - (at(a) * w.x + at(b) * w.y + at(c) * w.z);
  };
  const Vec3f from = between([&](Site s) { return position(s, world); });
  const bool presses = dot(place.normal, from) <= place.shift;
  const float squared = squared_drift(site, triangle, w, world);
  const bool is_fast = ticks_within(kDrift_m, squared) == 1;
  const bool is_awaited = is_fast || world.node_classes[site] == world::NodeClass::Active;
  if (!is_awaited && !presses) return;
  const Vec3f at_rest = between([&](Site s) -> const Vec3f& { return world.rest_positions[s]; });
  ContactPoint point{
      .nodes = {node, NodeIndex(a), NodeIndex(b), NodeIndex(c)},
      .weights = {1, -w.x, -w.y, -w.z},
      .node_count = 4,
      .id = static_cast<std::uint32_t>(pair),
      .stiffness = 0.5f * kSelfStiffnessPaPerM * world.surface_areas[node.value],
      .limit_n = kNoLimit_n,
      .normal = place.normal,
      .plane = place.normal * place.shift - at_rest,
  };
  out.points.push_back(point);
  if (!presses || ticks_within(kSeedDrift_m, squared) > 1) return;
  out.self_seeds.insert(out.self_seeds.end(), point.nodes.begin(), point.nodes.end());
}

namespace {
// Seeds are ascending, each once.
void tidy_seeds(ContactList& out) {
  auto& seeds = out.self_seeds;
  std::ranges::sort(seeds);
  seeds.erase(std::unique(seeds.begin(), seeds.end()), seeds.end());
}
}  // namespace

void SelfContactFinder::find(const world::World& world, SelfContactTable& pairs, ContactList& out) {
  survey(world);
  pairs_looked_at_ = 0;
  const bool is_due = pairs.has_edit() || world.tick - pairs.last_pass() >= pass_interval_;
  if (is_due || !is_any_awake_) return pass(world, pairs, out);
  for (std::size_t i = 0; i < pairs.nodes().size(); ++i) add_point(pairs, i, world, out);
  tidy_seeds(out);
}

void SelfContactFinder::find_again(const world::World& world, SelfContactTable& pairs,
                                   ContactList& out) {
  survey(world);
  pass(world, pairs, out);
}

void SelfContactFinder::pass(const world::World& world, SelfContactTable& pairs, ContactList& out) {
  if (pairs.last_pass() != world.tick) {
    pass_before_ = pairs.last_pass();
    follows_edit_ = pairs.has_edit();
  }
  pairs.note_pass(world.tick);
  if (!is_any_awake_) return;
  find_pace(world, pairs.nodes());
  // No two nodes approach faster than twice the fastest moves.
  margin_now_m_ =
      std::min(kSelfMaxMargin_m, margin_of(2.001f * std::sqrt(fastest_squared_)) + kRounding_m);
  keep_list(world);
  const auto& runs = list_.runs;
  // Two nodes are nearer to each other than their references by slack_m_ at most.
  const bool is_far =
      runs.empty() || list_.least_distance - slack_m_ > corner_reach_m_ + margin_now_m_;
  if (is_far && pairs.nodes().empty()) return;
  if (++tick_current_ == 0) {
    std::ranges::fill(normal_stamp_, 0u);
    std::ranges::fill(up_stamp_, 0u);
    std::ranges::fill(stirred_stamp_, 0u);
    tick_current_ = 1;
  }
  stir(world);
  pairs.swap_pairs(old_pairs_);
  pairs.clear();
  // Nodes with a pair and nodes with something listed, together ascending.
  const auto nodes = old_pairs_.nodes();
  std::size_t old = 0, run = 0;
  while (old < nodes.size() || run < runs.size()) {
    const Site of_old = old < nodes.size() ? nodes[old].value : kNoSite;
    const Site of_run = run < runs.size() ? runs[run].node : kNoSite;
    const Site site = std::min(of_old, of_run);
    const bool is_old = site == of_old, is_listed = site == of_run;
    const auto i = is_old ? old++ : old;
    const auto r = is_listed ? run++ : run;
    if (is_old && !surface_.is_gone(old_pairs_.triangles()[i])) {
      const auto triangle = old_pairs_.triangles()[i];
      const auto& place = old_pairs_.places()[i];
      if (is_asleep(site, triangle, world) || !is_due(site, triangle, place.weights, world)) {
        add_pair(site, triangle, place, world, pairs, out);
        continue;
      }
    }
    const bool is_stirred = stirred_stamp_[site] == tick_current_;
    ClosestPoint closest;
    Touch touch;
    if (is_old && stays(site, old_pairs_.triangles()[i], world, closest, touch))
      touch.shift = eased_shift(site, old_pairs_.triangles()[i], old_pairs_.places()[i], closest,
                                touch, world);
    else if (!is_listed || !(is_stirred || paces_[site] == Pace::Looks) ||
             !begins(site,
                     is_stirred && !is_old && paces_[site] != Pace::Looks
                         ? stirred_nearest_[site]
                         : find_nearest(site, runs[r].first, end_of_run(r), world),
                     world, closest, touch))
      continue;
    ++pairs_looked_at_;
    add_pair(site, closest.triangle, {closest.weights, touch.normal, touch.shift}, world, pairs,
             out);
  }
  tidy_seeds(out);
}

}  // namespace trocar::contact

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

namespace trocar::contact {
namespace {

// Cosine of the normals: of a pair that begins, and of one that goes on.
constexpr float kBeginsFacing = -0.1f, kStaysFacing = 0.2f;
// The closest point lies along the normal, within so many gaps and a little.
constexpr float kAsidePerGap = 1, kAside_m = 0.0005f;
// In a look this share of the overlap that is not pressed comes back, but no more than so far and
// such a share of the way in a tick: what trembles gets less than friction would take from it.
constexpr float kComesBack = 1e-3f, kComesBack_m = 5e-8f, kComesBackPerWay = 0.01f;
// A pair whose triangle an edit has replaced presses no deeper than this.
constexpr float kDeepestAnew_m = 2e-5f;
constexpr float kNoLimit_n = 1e6f;

bool lies_along(float aside, float gap) {
  return aside <= kAsidePerGap * std::abs(gap) + kAside_m;
}

// Seeds are ascending, each once.
void tidy_seeds(ContactList& out) {
  auto& seeds = out.self_seeds;
  std::ranges::sort(seeds);
  seeds.erase(std::unique(seeds.begin(), seeds.end()), seeds.end());
}

// Adds the point of a pair, unless nobody has to solve it.
void add_point(const SelfContactTable& pairs, std::size_t pair, const SelfSurfaceNow& now,
               ContactList& out) {
  const auto& world = now.world();
  const NodeIndex node = pairs.nodes()[pair];
  const auto site = node.value;
  const auto triangle = pairs.triangles()[pair];
  const auto& place = pairs.places()[pair];
  if (now.is_asleep(site, triangle)) return;
  const auto& [a, b, c] = now.surface()[triangle];
  const auto& w = place.weights;
  const Vec3f from = now.position(site) - now.position(triangle, w);
  const bool presses = dot(place.normal, from) <= place.shift;
  const float squared = now.squared_drift(site, triangle, w);
  const bool is_fast = ticks_within(kDrift_m, squared) == 1;
  const bool is_awaited = is_fast || world.node_classes[site] == world::NodeClass::Active;
  if (!is_awaited && !presses) return;
  const auto& rest = world.rest_positions;
  const Vec3f at_rest = rest[site] - (rest[a] * w.x + rest[b] * w.y + rest[c] * w.z);
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

void add_pair(SelfSurface::Site site, TriangleIndex triangle, const SelfContactPlace& place,
              const SelfSurfaceNow& now, SelfContactTable& pairs, ContactList& out) {
  if (pairs.nodes().size() >= kMaxSelfPoints) {
    ++out.dropped;
    return;
  }
  pairs.add(NodeIndex(site), triangle, place);
  add_point(pairs, pairs.nodes().size() - 1, now, out);
}

}  // namespace

SelfContactFinder::SelfContactFinder(const organ::Organ& organ) : list_(organ) {
  extend();
}

void SelfContactFinder::extend() {
  const auto& surface = list_.surface();
  pace_.resize(surface);
  normals_.resize(surface);
  is_stirred_.resize(surface.node_count());
  stirred_nearest_.resize(surface.node_count());
}

void SelfContactFinder::update(const topology::Edit& edit, const world::World& world) {
  list_.update(edit, world);
  extend();
}

// The other side of a wound, whether or not anything has moved.
bool SelfContactFinder::can_meet_lip(Site site, Site across, const Now& now) const {
  const auto& surface = now.surface();
  if (!surface.is_on_lip(site) || !surface.is_of(across, Sort::Wound)) return false;
  const float far = surface.near_m();
  return !surface.share_lip_at_rest(site, across) || now.has_moved(site, far) ||
         now.has_moved(across, far);
}

bool SelfContactFinder::can_meet_other(Site site, Site across, Now& now) const {
  const auto& surface = now.surface();
  const float moved_m = list_.reach().moved_m;
  if (!(now.has_moved(site, moved_m) || now.has_moved(across, moved_m) ||
        surface.faced_at_rest(site, across)) ||
      !surface.is_of_any(site) || !surface.is_of_any(across))
    return false;
  return dot(now.main_normal(site), now.main_normal(across)) <= kStaysFacing &&
         // Only cut nodes need this check: the list has no near pairs of nodes that were never cut.
         !((surface.was_cut(site) || surface.was_cut(across)) && now.is_near(site, across));
}

// Those across are considered in ascending order: of equals the first is the nearest.
void SelfContactFinder::consider(Site site, Site across, float squared, Now& now,
                                 Nearest& nearest) const {
  const float reach = list_.reach().of_corner[across] + margin_m_;
  if (squared >= reach * reach) return;
  if (squared < nearest.squared_of_lips && can_meet_lip(site, across, now) &&
      dot(now.normal(site, Sort::Wound), now.normal(across, Sort::Wound)) <= kStaysFacing) {
    nearest.squared_of_lips = squared;
    nearest.of_lips = across;
  }
  if (squared < nearest.squared_other && can_meet_other(site, across, now)) {
    nearest.squared_other = squared;
    nearest.other = across;
  }
}

// Nodes that look stir those that they are listed with. Who waits and has no pair meets nobody but
// them, so that its nearest are found here, without a search through all with whom it is listed.
void SelfContactFinder::stir(Now& now) {
  const auto& listed = list_.now();
  is_stirred_.begin();
  for (std::size_t r = 0; r < listed.runs.size(); ++r) {
    const auto& run = listed.runs[r];
    if (!pace_.is_looking(run.node)) continue;
    for (auto i = std::size_t{run.first}; i < listed.end_of_run(r); ++i) {
      if (list_.is_far(i, margin_m_)) continue;
      const Site across = listed.pairs[i].across;
      if (is_stirred_.insert(across)) stirred_nearest_[across] = {};
      if (pace_.is_looking(across) || pace_.had_pair(across)) continue;
      consider(across, run.node, list_.squared_distance(i, margin_m_, now.world()), now,
               stirred_nearest_[across]);
    }
  }
}

SelfContactFinder::Nearest SelfContactFinder::find_nearest(std::size_t run, Now& now) {
  const auto& listed = list_.now();
  const auto [site, first] = listed.runs[run];
  Nearest nearest;
  const bool looks_at_all = pace_.is_looking(site);
  for (auto i = std::size_t{first}; i < listed.end_of_run(run); ++i) {
    const Site across = listed.pairs[i].across;
    if (list_.is_far(i, margin_m_) || (!looks_at_all && !pace_.is_looking(across))) continue;
    consider(site, across, list_.squared_distance(i, margin_m_, now.world()), now, nearest);
  }
  return nearest;
}

// Returns whether a pair begins with a triangle at this node.
bool SelfContactFinder::begins(Site site, Site nearest, float squared, bool is_of_lips, Now& now,
                               Look& look) const {
  auto& [closest, touch] = look;
  closest = now.closest_point_around(site, std::span(&nearest, 1), is_of_lips);
  if (!closest.triangle.is_valid()) return false;
  touch = now.touch_at(site, closest);
  // Nothing here may let in what find() or a list would not have looked at.
  const float margin = pace_.margin_of(touch.closing);
  const float reach = list_.reach().of_corner[nearest] + margin;
  return touch.facing < kBeginsFacing && touch.gap >= 0 && closest.squared < margin * margin &&
         squared < reach * reach && lies_along(touch.aside, touch.gap) &&
         dot(closest.from, normalized(now.up(closest.triangle), touch.normal)) >= touch.shift &&
         dot(closest.from, touch.own) <= -touch.shift;
}

bool SelfContactFinder::begins(Site site, const Nearest& nearest, Now& now, Look& look) const {
  return (nearest.of_lips != kNoSite &&
          begins(site, nearest.of_lips, nearest.squared_of_lips, true, now, look)) ||
         (nearest.other != kNoSite &&
          begins(site, nearest.other, nearest.squared_other, false, now, look));
}

// Returns the corners of a triangle around which the search for a nearer point goes on from its
// closest point. With is_there_only these are the ends of the edge, or the corner, that the point
// lies on: lips that have not moved are corner on corner.
std::span<const SelfSurface::Site> SelfContactFinder::around(TriangleIndex triangle,
                                                             const Vec3f& weights,
                                                             bool is_there_only) {
  const auto& corners = list_.surface()[triangle];
  if (!is_there_only) return corners;
  const float of_corner[] = {weights.x, weights.y, weights.z};
  corners_.clear();
  for (std::size_t k = 0; k < 3; ++k)
    if (of_corner[k] > 0) corners_.push_back(corners[k]);
  return corners_;
}

// Finds where a pair is now; returns false when it has come apart.
bool SelfContactFinder::stays(Site site, TriangleIndex triangle, Now& now, Look& look) {
  auto& [closest, touch] = look;
  const bool is_gone = now.surface().is_gone(triangle);
  const bool is_of_lips = now.is_of_lips(site, triangle);
  const bool is_there = !is_gone && now.can_meet(site, triangle);
  if (!is_there && !is_gone && !is_of_lips) return false;
  if (is_there) closest = now.closest_point(site, triangle);
  const Vec3f& w = closest.weights;
  if (!is_there || !(w.x > 0 && w.y > 0 && w.z > 0))
    closest =
        now.closest_point_around(site, around(triangle, w, is_there && is_of_lips), is_of_lips);
  if (!closest.triangle.is_valid()) return false;
  touch = now.touch_at(site, closest);
  // A little farther than where it began, so that it does not flutter.
  // Where neither side faces anywhere there is no normal, and nothing to press against.
  return touch.facing < kStaysFacing && length_squared(touch.normal) > 0 &&
         touch.gap < pace_.margin_of(touch.closing) + 0.5f * kSelfMargin_m &&
         touch.gap > -kDeepest_m && lies_along(touch.aside, touch.gap);
}

bool SelfContactFinder::is_due(Site site, TriangleIndex triangle, const Vec3f& weights,
                               const Now& now) const {
  const bool is_near = now.world().node_classes[site] == world::NodeClass::Active;
  const auto interval =
      ticks_within(is_near ? kNearDrift_m : kDrift_m, now.squared_drift(site, triangle, weights));
  return pace_.is_turn(site, interval, now.world().tick);
}

// Returns the shift of a pair after a look at it; place: where it was before.
float SelfContactFinder::eased_shift(Site site, TriangleIndex triangle, const Place& place,
                                     const Look& look, const Now& now) {
  const auto& [closest, touch] = look;
  float least = -kDeepestAnew_m;
  if (!now.surface().is_gone(triangle)) {
    const Vec3f from = now.position(site) - now.position(triangle, place.weights);
    const float way =
        kTickSeconds * std::sqrt(now.squared_drift(site, closest.triangle, closest.weights));
    const float comes_back = std::min(kComesBack * std::max(0.0f, touch.shift - place.shift),
                                      kComesBack_m + kComesBackPerWay * way);
    least = std::min(0.0f, dot(place.normal, from) - place.shift) - comes_back;
  }
  return touch.shift + std::min(0.0f, touch.gap - least);
}

void SelfContactFinder::find(const world::World& world, SelfContactTable& pairs, ContactList& out) {
  pace_.survey(list_.surface(), world);
  pairs_looked_at_ = 0;
  if (pace_.is_due(pairs, world.tick) || !pace_.is_any_awake()) return pass(world, pairs, out);
  const Now now(list_.surface(), world, normals_);
  for (std::size_t i = 0; i < pairs.nodes().size(); ++i) add_point(pairs, i, now, out);
  tidy_seeds(out);
}

void SelfContactFinder::find_again(const world::World& world, SelfContactTable& pairs,
                                   ContactList& out) {
  pace_.survey(list_.surface(), world);
  pass(world, pairs, out);
}

void SelfContactFinder::pass(const world::World& world, SelfContactTable& pairs, ContactList& out) {
  pace_.begin_pass(pairs, world.tick);
  if (!pace_.is_any_awake()) return;
  pace_.find_lookers(list_.surface(), world, pairs.nodes());
  margin_m_ = pace_.margin();
  list_.keep(world);
  if (list_.is_all_far(margin_m_) && pairs.nodes().empty()) return;
  normals_.begin();
  Now now(list_.surface(), world, normals_);
  stir(now);
  pairs.swap_pairs(old_pairs_);
  pairs.clear();
  // Nodes with a pair and nodes with something listed, together ascending.
  const auto nodes = old_pairs_.nodes();
  const auto& runs = list_.now().runs;
  std::size_t old = 0, run = 0;
  while (old < nodes.size() || run < runs.size()) {
    const Site of_old = old < nodes.size() ? nodes[old].value : kNoSite;
    const Site of_run = run < runs.size() ? runs[run].node : kNoSite;
    const Site site = std::min(of_old, of_run);
    const bool is_old = site == of_old, is_listed = site == of_run;
    const auto i = is_old ? old++ : old;
    const auto r = is_listed ? run++ : run;
    if (is_old && !now.surface().is_gone(old_pairs_.triangles()[i])) {
      const auto triangle = old_pairs_.triangles()[i];
      const auto& place = old_pairs_.places()[i];
      if (now.is_asleep(site, triangle) || !is_due(site, triangle, place.weights, now)) {
        add_pair(site, triangle, place, now, pairs, out);
        continue;
      }
    }
    const bool is_stirred = is_stirred_.has(site), is_looking = pace_.is_looking(site);
    Look look;
    if (is_old && stays(site, old_pairs_.triangles()[i], now, look))
      look.touch.shift =
          eased_shift(site, old_pairs_.triangles()[i], old_pairs_.places()[i], look, now);
    else if (!is_listed || !(is_stirred || is_looking) ||
             !begins(site,
                     is_stirred && !is_old && !is_looking ? stirred_nearest_[site]
                                                          : find_nearest(r, now),
                     now, look))
      continue;
    ++pairs_looked_at_;
    add_pair(site, look.closest.triangle,
             {look.closest.weights, look.touch.normal, look.touch.shift}, now, pairs, out);
  }
  tidy_seeds(out);
}

}  // namespace trocar::contact

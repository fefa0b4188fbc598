#include "server/contact/self_contact.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/tick.h"

namespace trocar::contact {
namespace {

// How far the surface may move between lists, in mean edges; in metres at most kMaxSlack_m.
constexpr float kSlackEdges = 1, kMaxSlack_m = 0.006f;
// Nodes this far from rest, in slacks, are listed; a pair needs one that is farther than
// kListedSlacks + 1/2, unless it faced something this near at rest.
constexpr float kReferenceSlacks = 0.25f;
constexpr float kListedSlacks = 0.5f, kMovedSlacks = kListedSlacks + 0.5f;
// The nearest corner of a triangle, from any point on it, in longest edges.
constexpr float kCornerReach = 0.6f;
// Faces that touch at rest may do so for ever: a force begins this far beyond.
constexpr float kTouch_m = 2e-6f;
constexpr float kOverlapAtRest_m = 0.001f;
// Cosine of the normals: of a pair that begins, and of one that goes on.
constexpr float kBeginsFacing = -0.1f, kStaysFacing = 0.2f;
// The closest point lies along the normal, within so many gaps and a little.
constexpr float kAsidePerGap = 1, kAside_m = 0.0005f;
constexpr double kNearEdges = 3.5;
constexpr std::uint32_t kMostNearLayers = 8;
constexpr float kDeepest_m = 0.008f;
// Of a list, per tick, at least.
constexpr std::size_t kReferencesPerTick = 512, kSitesPerTick = 32;
// Of the work on a list, the part that taking references is.
constexpr double kReferencesShare = 0.3;
constexpr std::size_t kReservedPairs = 1u << 15;
constexpr float kRounding_m = 1e-5f;
constexpr float kNoLimit_n = 1e6f;

// Barycentric weights of the point of a triangle closest to p (Ericson, Real-Time Collision
// Detection, 5.1.5).
Vec3f nearest_weights(const Vec3f& p, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const Vec3f bp = p - b;
  const float d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) {
    const float v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Vec3f cp = p - c;
  const float d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) {
    const float w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0 && (d4 - d3) + (d5 - d6) > 0) {
    const float w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const float sum = va + vb + vc;
  if (!(sum > 0)) return {1, 0, 0};  // no area
  const float v = vb / sum, w = vc / sum;
  return {1 - v - w, v, w};
}

Vec3f area_vector(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  return cross(b - a, c - a);
}

}  // namespace

SelfContactTable::SelfContactTable(const scene::Organ& organ)
    : is_surface_(organ.mesh.node_count()),
      triangle_count_(static_cast<std::uint32_t>(organ.mesh.boundary_triangles.size())) {
  for (const auto node : organ.mesh.surface_nodes) is_surface_[node.value] = 1;
  nodes_.reserve(kMaxSelfPoints);
  triangles_.reserve(kMaxSelfPoints);
}

void SelfContactTable::visit_state(world::StateArchive& archive) {
  if (archive.is_reading()) {
    clear();
    if (archive.at_end()) return;
  } else if (nodes_.empty()) {
    return;
  }
  archive.sized_array(nodes_, kMaxSelfPoints);
  archive.sized_array(triangles_, kMaxSelfPoints);
  if (!archive.is_reading()) return;
  bool is_good = !nodes_.empty() && nodes_.size() == triangles_.size();
  for (std::size_t i = 0; is_good && i < nodes_.size(); ++i)
    is_good = nodes_[i].value < is_surface_.size() && is_surface_[nodes_[i].value] == 1 &&
              triangles_[i].value < triangle_count_ && (i == 0 || nodes_[i - 1] < nodes_[i]);
  if (is_good) return;
  archive.fail();
  clear();
}

void SelfContactTable::follow(const world::SurfaceEdit& edit) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (std::ranges::binary_search(edit.removed, triangles_[i])) continue;
    nodes_[kept] = nodes_[i];
    triangles_[kept++] = triangles_[i];
  }
  nodes_.resize(kept);
  triangles_.resize(kept);
}

SelfContactFinder::SelfContactFinder(const scene::Organ& organ)
    : sites_(organ.mesh.surface_nodes), grid_(1, 1) {
  std::ranges::sort(sites_);
  site_of_node_.resize(organ.mesh.node_count());
  for (std::size_t s = 0; s < sites_.size(); ++s)
    site_of_node_[sites_[s].value] = static_cast<Site>(s);

  const world::World world(organ);
  double edges = 0;
  float longest = 0;
  site_triangles_.offsets.assign(sites_.size() + 1, 0);
  for (const auto& nodes : organ.mesh.boundary_triangles) {
    auto& sites = triangles_.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      sites[k] = site_of_node_[nodes[k].value];
      ++site_triangles_.offsets[sites[k] + 1];
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const float edge = length(position(sites[k], world) - position(sites[(k + 1) % 3], world));
      edges += static_cast<double>(edge);
      longest = std::max(longest, edge);
    }
  }
  for (std::size_t s = 0; s < sites_.size(); ++s)
    site_triangles_.offsets[s + 1] += site_triangles_.offsets[s];
  site_triangles_.items.resize(3 * triangles_.size());
  auto next = site_triangles_.offsets;
  for (std::size_t t = 0; t < triangles_.size(); ++t)
    for (const auto site : triangles_[t]) site_triangles_.items[next[site]++] = TriangleIndex(t);

  is_gone_.resize(triangles_.size());
  const auto corners = static_cast<double>(std::max<std::size_t>(1, 3 * triangles_.size()));
  const auto mean_edge = static_cast<float>(edges / corners);
  slack_m_ = std::clamp(kSlackEdges * mean_edge, 1e-4f, kMaxSlack_m);
  // An edge far longer than the mean one is a flaw of the mesh.
  corner_reach_m_ = kCornerReach * std::min(longest, 3 * mean_edge);
  reach_m_ = kSelfMaxMargin_m + corner_reach_m_;
  normals_.resize(sites_.size());
  normal_stamp_.resize(sites_.size());
  near_stamp_.resize(sites_.size());
  is_due_.resize(sites_.size());
  due_.reserve(sites_.size());
  list_.pairs.reserve(kReservedPairs);
  next_list_.pairs.reserve(kReservedPairs);
  list_.far_until.reserve(kReservedPairs);
  next_list_.far_until.reserve(kReservedPairs);
  references_.resize(sites_.size());
  has_left_.resize(sites_.size());
  old_nodes_.reserve(kMaxSelfPoints);
  old_triangles_.reserve(kMaxSelfPoints);
  list_near_sites(organ, kNearEdges * static_cast<double>(mean_edge));
  ++normal_current_;
  for (Site s = 0; s < sites_.size(); ++s) {
    rest_positions_.push_back(position(s, world));
    rest_normals_.push_back(normal(s, world));
  }
  // Two nodes that have both moved by kMovedSlacks come this much nearer.
  const float range = reach_m_ + 2 * kMovedSlacks * slack_m_;
  grid_ = PointGrid(range, sites_.size());
  grid_.build(sites_.size(), [&](std::size_t s) { return rest_positions_[s]; });
  is_close_at_rest_.resize(sites_.size());
  for (Site s = 0; s < sites_.size(); ++s)
    grid_.visit(rest_positions_[s], range, [&](Site other, float) {
      if (faced_at_rest(s, other) && !std::ranges::binary_search(near_sites_[SiteIndex{s}], other))
        is_close_at_rest_[s] = 1;
    });
  grid_ = PointGrid(reach_m_ + slack_m_, sites_.size());
}

// Along edges in the tissue, so that both faces of a thin wall are near each other.
void SelfContactFinder::list_near_sites(const scene::Organ& organ, double near_m) {
  const auto& mesh = organ.mesh;
  std::vector<std::uint32_t> seen(mesh.node_count(), 0xffffffffu);
  std::vector<double> paths(mesh.node_count());
  std::vector<std::uint8_t> is_site(mesh.node_count());
  std::vector<NodeIndex> reached;
  for (const auto node : sites_) is_site[node.value] = 1;
  near_sites_.offsets.assign(1, 0);
  for (std::uint32_t s = 0; s < sites_.size(); ++s) {
    reached.assign(1, sites_[s]);
    seen[sites_[s].value] = s;
    paths[sites_[s].value] = 0;
    std::size_t i = 0;
    for (std::uint32_t layer = 1; i < reached.size() && layer <= kMostNearLayers; ++layer)
      for (const auto end = reached.size(); i < end; ++i)
        for (const auto node : mesh.node_neighbours[reached[i]]) {
          const double path =
              paths[reached[i].value] +
              length(mesh.rest_positions[node.value] - mesh.rest_positions[reached[i].value]);
          const bool is_new = seen[node.value] != s;
          if (is_new && layer > kNearLayers && path > near_m) continue;
          paths[node.value] = is_new ? path : std::min(path, paths[node.value]);
          if (!is_new) continue;
          seen[node.value] = s;
          reached.push_back(node);
        }
    const auto begin = static_cast<std::ptrdiff_t>(near_sites_.items.size());
    for (const auto node : reached)
      if (is_site[node.value]) near_sites_.items.push_back(site_of_node_[node.value]);
    std::sort(near_sites_.items.begin() + begin, near_sites_.items.end());
    near_sites_.offsets.push_back(static_cast<std::uint32_t>(near_sites_.items.size()));
  }
}

void SelfContactFinder::follow(const world::SurfaceEdit& edit) {
  for (const auto triangle : edit.removed)
    if (triangle.value < is_gone_.size()) is_gone_[triangle.value] = 1;
}

bool SelfContactFinder::faced_at_rest(Site site, Site across) const {
  const Vec3f way = rest_positions_[across] - rest_positions_[site];
  const Vec3f &own = rest_normals_[site], &theirs = rest_normals_[across];
  return dot(own, theirs) < 0 && dot(way, own) >= -kTouch_m && dot(way, theirs) <= kTouch_m;
}

// --- What can come near ---

bool SelfContactFinder::has_moved(Site site, float by_m, const world::World& world) const {
  return length_squared(world.displacements[sites_[site].value]) > by_m * by_m;
}

// The list has all pairs of nodes that are not near each other in the tissue and whose references
// are within reach_m_ + slack_m_, if they faced each other at rest or one of the references at
// least is kListedSlacks from rest. A reference is where the node was when its surroundings were
// last looked through; it is never farther than slack_m_ / 2 from where the node is now. So each
// pair that is within reach_m_ is on the list, and only what moves is looked through again.
void SelfContactFinder::begin_list() {
  is_listing_ = true;
  next_list_.travel = travel_;
  next_list_.least_distance = 1;
  next_list_.pairs.clear();
  sites_seen_ = sites_listed_ = due_count_ = 0;
}

void SelfContactFinder::take_references(std::size_t end, const world::World& world) {
  const float far = kReferenceSlacks * slack_m_;
  for (; sites_seen_ < end; ++sites_seen_) {
    const auto s = static_cast<Site>(sites_seen_);
    const Vec3f p = position(s, world);
    is_due_[s] = !has_list_ || length_squared(p - references_[s]) > far * far ? 1 : 0;
    if (is_due_[s] == 0) continue;
    references_[s] = p;
    has_left_[s] = has_moved(s, kListedSlacks * slack_m_, world) ? 1 : 0;
    ++due_count_;
  }
}

// Neighbours after one another, which look through the same cells.
void SelfContactFinder::order_due() {
  due_.clear();
  if (due_count_ == 0) return;
  grid_.build(sites_.size(), [&](std::size_t s) { return references_[s]; });
  for (const Site s : grid_.entries())
    // At first, whoever stays where nothing faces it has nothing to look for.
    if (is_due_[s] == 1 && (has_list_ || has_left_[s] == 1 || is_close_at_rest_[s] == 1))
      due_.push_back(s);
}

// Of the list that there is, what has not moved.
void SelfContactFinder::keep_pairs() {
  for (const auto& pair : list_.pairs) {
    if (is_due_[pair.node] == 1 || is_due_[pair.across] == 1) continue;
    next_list_.pairs.push_back(pair);
    next_list_.least_distance = std::min(next_list_.least_distance,
                                         length(references_[pair.node] - references_[pair.across]));
  }
}

void SelfContactFinder::end_list() {
  auto& pairs = next_list_.pairs;
  if (due_count_ > 0) std::ranges::sort(pairs);
  // A pair of two that were due, or none of which looked, was found from both sides or one.
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  next_list_.far_until.assign(pairs.size(), 0);
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
  if (sites_seen_ < sites_.size()) {
    const auto end =
        std::max(part(share / kReferencesShare, sites_.size()), sites_seen_ + kReferencesPerTick);
    take_references(std::min(end, sites_.size()), world);
    if (sites_seen_ < sites_.size()) return;
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

void SelfContactFinder::list_around(Site site) {
  const auto stamp_near_sites = [&] {
    if (++near_current_ == 0) {
      std::ranges::fill(near_stamp_, 0u);
      near_current_ = 1;
    }
    for (const auto s : near_sites_[SiteIndex{site}]) near_stamp_[s] = near_current_;
  };
  bool is_stamped = false;
  const bool has_left = has_left_[site] == 1, is_close = is_close_at_rest_[site] == 1;
  grid_.visit(references_[site], reach_m_ + slack_m_, [&](Site other, float squared) {
    if (!has_left && has_left_[other] == 0 && !(is_close && faced_at_rest(site, other))) return;
    if (!std::exchange(is_stamped, true)) stamp_near_sites();
    if (near_stamp_[other] == near_current_) return;
    next_list_.pairs.push_back({site, other});
    next_list_.pairs.push_back({other, site});
    next_list_.least_distance = std::min(next_list_.least_distance, std::sqrt(squared));
  });
}

// Made anew when the surface has moved by an eighth of the slack since it was last begun, and done
// before that is a quarter: a node that was not due then, up to a quarter from its reference, is
// not beyond half.
void SelfContactFinder::keep_list(const world::World& world) {
  const auto used = [this] {
    return (travel_ - list_.travel) / static_cast<double>(kReferenceSlacks * slack_m_);
  };
  if (!is_listing_ && has_list_ && used() <= 0.5) return;
  if (!is_listing_) begin_list();
  go_on_listing(has_list_ ? 3 * (used() - 0.5) : 1, world);
  if (used() <= 1) return;
  if (is_listing_) go_on_listing(1, world);
  if (used() <= 1) return;
  // It moved farther than that since it began.
  begin_list();
  go_on_listing(1, world);
}

// --- A node and a triangle ---

const Vec3f& SelfContactFinder::normal(Site site, const world::World& world) {
  if (normal_stamp_[site] == normal_current_) return normals_[site];
  normal_stamp_[site] = normal_current_;
  Vec3f sum;
  for (const auto t : site_triangles_[SiteIndex{site}]) {
    if (is_gone_[t.value] != 0) continue;
    const auto& [a, b, c] = triangles_[t.value];
    sum += area_vector(position(a, world), position(b, world), position(c, world));
  }
  return normals_[site] = normalized(sum, {0, 1, 0});
}

bool SelfContactFinder::is_near(Site site, TriangleIndex triangle) const {
  const auto near = near_sites_[SiteIndex{site}];
  return std::ranges::any_of(triangles_[triangle.value],
                             [&](Site corner) { return std::ranges::binary_search(near, corner); });
}

SelfContactFinder::ClosestPoint SelfContactFinder::closest_point(Site site, TriangleIndex triangle,
                                                                 const world::World& world) const {
  const auto& sites = triangles_[triangle.value];
  const Vec3f p = position(site, world), a = position(sites[0], world),
              b = position(sites[1], world), c = position(sites[2], world);
  const Vec3f w = nearest_weights(p, a, b, c);
  const Vec3f from = p - (a * w.x + b * w.y + c * w.z);
  return {triangle, w, from, length_squared(from)};
}

// Of the triangles at some nodes; the first of equals.
SelfContactFinder::ClosestPoint SelfContactFinder::closest_point_around(
    Site site, std::span<const Site> around, const world::World& world) const {
  ClosestPoint best;
  for (const auto corner : around)
    for (const auto t : site_triangles_[SiteIndex{corner}]) {
      if (is_gone_[t.value] != 0) continue;
      const ClosestPoint closest = closest_point(site, t, world);
      const bool is_better = !best.triangle.is_valid() || closest.squared < best.squared ||
                             (closest.squared == best.squared && closest.triangle < best.triangle);
      if (is_better && !is_near(site, t)) best = closest;
    }
  return best;
}

SelfContactFinder::Touch SelfContactFinder::touch_at(Site site, const ClosestPoint& closest,
                                                     const world::World& world) {
  const auto& sites = triangles_[closest.triangle.value];
  const float weights[] = {closest.weights.x, closest.weights.y, closest.weights.z};
  Vec3f theirs, velocity = world.velocities[sites_[site].value], rest[3];
  Touch touch;
  touch.at_rest = world.rest_positions[sites_[site].value];
  for (std::size_t k = 0; k < 3; ++k) {
    const auto node = sites_[sites[k]].value;
    theirs += normal(sites[k], world) * weights[k];
    velocity -= world.velocities[node] * weights[k];
    rest[k] = world.rest_positions[node];
    touch.at_rest -= rest[k] * weights[k];
  }
  const Vec3f own = normal(site, world);
  theirs = normalized(theirs, -own);
  touch.facing = dot(own, theirs);
  touch.normal = normalized(theirs - own, theirs);
  touch.shift = -kTouch_m;
  if (length_squared(touch.at_rest) < kOverlapAtRest_m * kOverlapAtRest_m) {
    const Vec3f up = normalized(area_vector(rest[0], rest[1], rest[2]), touch.normal);
    touch.shift += std::min(0.0f, dot(up, touch.at_rest));
  }
  const float along = dot(touch.normal, closest.from);
  touch.gap = along - touch.shift;
  touch.aside = std::sqrt(std::max(0.0f, closest.squared - along * along));
  touch.closing = -dot(touch.normal, velocity);
  return touch;
}

namespace {
float margin_of(float closing) {
  return std::min(kSelfMargin_m + kSelfTicksAhead * kTickSeconds * std::max(0.0f, closing),
                  kSelfMaxMargin_m);
}
bool lies_along(float aside, float gap) {
  return aside <= kAsidePerGap * std::abs(gap) + kAside_m;
}
}  // namespace

// Whether a node without a pair meets the surface across from it.
bool SelfContactFinder::meets(Site site, std::size_t first, std::size_t end,
                              const world::World& world, ClosestPoint& closest, Touch& touch) {
  const auto passed = static_cast<float>(travel_ - list_.travel);
  while (first < end && list_.far_until[first] > passed) ++first;
  if (first == end) return false;
  const Vec3f p = position(site, world);
  const float moved = kMovedSlacks * slack_m_;
  const bool is_moved = has_moved(site, moved, world);
  float least = reach_m_ * reach_m_;
  Site nearest = 0;
  bool is_found = false;
  for (auto i = first; i < end; ++i) {
    if (list_.far_until[i] > passed) continue;
    const auto& pair = list_.pairs[i];
    const Vec3f way = position(pair.across, world) - p;
    const float squared = length_squared(way);
    if (squared > reach_m_ * reach_m_)
      list_.far_until[i] = passed + 0.5f * (std::sqrt(squared) - reach_m_) - kRounding_m;
    if (!(squared < least) ||
        !(is_moved || has_moved(pair.across, moved, world) || faced_at_rest(site, pair.across)))
      continue;
    if (dot(normal(site, world), normal(pair.across, world)) > kStaysFacing) continue;
    least = squared;
    nearest = pair.across;
    is_found = true;
  }
  if (!is_found) return false;
  closest = closest_point_around(site, std::span(&nearest, 1), world);
  if (!closest.triangle.is_valid()) return false;
  touch = touch_at(site, closest, world);
  const auto& [a, b, c] = triangles_[closest.triangle.value];
  const Vec3f up = area_vector(position(a, world), position(b, world), position(c, world));
  // Nothing here may let in what find() or a list would not have looked at.
  const float margin = margin_of(touch.closing), reach = corner_reach_m_ + margin;
  return touch.facing < kBeginsFacing && touch.gap >= 0 && closest.squared < margin * margin &&
         least < reach * reach && lies_along(touch.aside, touch.gap) &&
         dot(closest.from, normalized(up, touch.normal)) >= touch.shift &&
         dot(closest.from, normal(site, world)) <= -touch.shift;
}

// Where a pair is now; false when it has come apart.
bool SelfContactFinder::stays(Site site, TriangleIndex triangle, const world::World& world,
                              ClosestPoint& closest, Touch& touch) {
  if (is_near(site, triangle)) return false;
  closest = closest_point(site, triangle, world);
  const Vec3f& w = closest.weights;
  if (!(w.x > 0 && w.y > 0 && w.z > 0))
    closest = closest_point_around(site, triangles_[triangle.value], world);
  if (!closest.triangle.is_valid()) return false;
  touch = touch_at(site, closest, world);
  // A little farther than where it began, so that it does not flutter.
  return touch.facing < kStaysFacing &&
         touch.gap < margin_of(touch.closing) + 0.5f * kSelfMargin_m && touch.gap > -kDeepest_m &&
         lies_along(touch.aside, touch.gap);
}

void SelfContactFinder::add_point(Site site, const ClosestPoint& closest, const Touch& touch,
                                  const world::World& world, SelfContactTable& pairs,
                                  ContactList& out) const {
  if (pairs.nodes().size() >= kMaxSelfPoints) {
    ++out.dropped;
    return;
  }
  const auto& sites = triangles_[closest.triangle.value];
  const auto node = sites_[site];
  pairs.add(node, closest.triangle);
  ContactPoint point{
      .nodes = {node, sites_[sites[0]], sites_[sites[1]], sites_[sites[2]]},
      .weights = {1, -closest.weights.x, -closest.weights.y, -closest.weights.z},
      .node_count = 4,
      .id = static_cast<std::uint32_t>(pairs.nodes().size() - 1),
      .stiffness = 0.5f * kSelfStiffnessPaPerM * world.surface_areas[node.value],
      .limit_n = kNoLimit_n,
      .normal = touch.normal,
      .plane = touch.normal * touch.shift - touch.at_rest,
  };
  out.points.push_back(point);
  if (touch.gap > 0) return;
  out.self_seeds.insert(out.self_seeds.end(), point.nodes.begin(), point.nodes.end());
}

void SelfContactFinder::find(const world::World& world, SelfContactTable& pairs, ContactList& out) {
  keep_list(world);
  const auto& listed = list_.pairs;
  // No two are nearer to each other than their references by more than that.
  const float moved =
      2 * (kReferenceSlacks * slack_m_ + static_cast<float>(travel_ - list_.travel));
  // What the fastest pair could reach.
  const float reach = corner_reach_m_ + margin_of(2 * last_move_m_ / kTickSeconds);
  const bool is_far = listed.empty() || list_.least_distance - moved > reach;
  if (is_far && pairs.nodes().empty()) return;
  if (++normal_current_ == 0) {
    std::ranges::fill(normal_stamp_, 0u);
    normal_current_ = 1;
  }
  old_nodes_.assign(pairs.nodes().begin(), pairs.nodes().end());
  old_triangles_.assign(pairs.triangles().begin(), pairs.triangles().end());
  pairs.clear();
  // Nodes with a pair and nodes with something listed, together ascending.
  std::size_t old = 0, first = 0;
  while (old < old_nodes_.size() || first < listed.size()) {
    const Site of_old = old < old_nodes_.size() ? site_of_node_[old_nodes_[old].value] : ~Site{0};
    const Site of_listed = first < listed.size() ? listed[first].node : ~Site{0};
    const Site site = std::min(of_old, of_listed);
    std::size_t end = first;
    while (end < listed.size() && listed[end].node == site) ++end;
    ClosestPoint closest;
    Touch touch;
    bool is_pair = site == of_old && stays(site, old_triangles_[old], world, closest, touch);
    if (!is_pair) is_pair = meets(site, first, end, world, closest, touch);
    if (is_pair) add_point(site, closest, touch, world, pairs, out);
    if (site == of_old) ++old;
    first = end;
  }
  std::ranges::sort(out.self_seeds);
  out.self_seeds.erase(std::unique(out.self_seeds.begin(), out.self_seeds.end()),
                       out.self_seeds.end());
}

}  // namespace trocar::contact

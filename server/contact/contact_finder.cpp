#include "server/contact/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::contact {
namespace {

constexpr float kSlack_m = 0.005f;
constexpr std::size_t kMaxPathSteps = 64;

// Part t of the way from a to b.
Pose between(const Pose& a, const Pose& b, float t) {
  if (t >= 1) return b;
  return {a.position + (b.position - a.position) * t, interpolate(a.orientation, b.orientation, t)};
}

float distance_to(const ToolSolid& solid, const Vec3f& p) {
  return length(p - solid.nearest_on_core(p));
}

float stiffness_of(float radius_m) {
  const float thinness = kStiffnessRadius_m / radius_m;
  return kStiffnessPaPerM * std::max(1.0f, thinness * thinness);
}

struct Triangle {
  std::array<Vec3f, 3> corners;
  Vec3f centre;
  float radius = 0;  // of a ball around the centre that holds it

  Triangle(const SurfaceTriangle& triangle, const world::World& world) {
    for (std::size_t i = 0; i < 3; ++i) corners[i] = world.position(triangle.nodes[i]);
    centre = (corners[0] + corners[1] + corners[2]) * (1.0f / 3.0f);
    float squared = 0;
    for (const auto& corner : corners) squared = std::max(squared, length_squared(corner - centre));
    radius = std::sqrt(squared);
  }
  Vec3f at(const std::array<float, 3>& place) const {
    return corners[0] * place[0] + corners[1] * place[1] + corners[2] * place[2];
  }
  Vec3f outward() const { return cross(corners[1] - corners[0], corners[2] - corners[0]); }
};

// A place this far inside the tool, in radii, at the start of its way was not met from outside.
constexpr float kMet = 0.7f;

// Where a place that is at `p` meets the tool on its way. is_held: the tool pressed it in the last
// tick, so that it was met from outside whatever it looks like now.
struct Meeting {
  bool is_near = false;     // within the margin at the end of the way
  bool is_touched = false;  // inside the tool somewhere on the way
  Vec3f normal, on_face;    // of the tool at the end of the way
};
Meeting meet(std::span<const ToolSolid> path, const Vec3f& p, const Vec3f& outward, bool is_held) {
  Meeting result;
  const Vec3f core_at_start = path.front().nearest_on_core(p);
  const Vec3f from_start = p - core_at_start;
  const float radius = path.front().radius;
  const bool is_behind = dot(from_start, outward) > 0;
  const bool is_deep = length_squared(from_start) < kMet * kMet * radius * radius;
  if (!is_held && (is_behind || is_deep)) return result;
  Vec3f carried = p, normal = normalized(from_start, normalized(-outward, {0, 1, 0}));
  if (is_behind) {  // pressed through the tool's core: back to the side on which it was met
    normal = -normal;
    carried = core_at_start + normal * radius;
    result.is_touched = true;
  }
  for (const auto& solid : path) {
    const Vec3f from_core = carried - solid.nearest_on_core(carried);
    const float distance = length(from_core);
    if (distance > 1e-9f) normal = from_core / distance;
    if (distance > radius) continue;
    result.is_touched = true;
    carried += normal * (radius - distance);
  }
  const Vec3f core = path.back().nearest_on_core(carried);
  const Vec3f from_core = carried - core;
  const float distance = length(from_core);
  if (distance > 1e-9f) normal = from_core / distance;
  result.is_near = result.is_touched || distance <= radius + kMargin_m;
  result.normal = normal;
  result.on_face = core + normal * radius;
  return result;
}

// Places keep their names while their triangle keeps its divisions.
std::uint32_t place_id(TriangleIndex triangle, std::uint32_t divisions, std::size_t place) {
  constexpr std::uint32_t kPlaces = kMaxDivisions * kMaxDivisions;
  return (triangle.value * kMaxDivisions + divisions - 1) * kPlaces +
         static_cast<std::uint32_t>(place);
}

float greatest_modulus_pa(const scene::Organ& organ) {
  double most = organ.material.young_modulus_pa;
  for (const auto& region : organ.regions) most = std::max(most, region.material.young_modulus_pa);
  return static_cast<float>(most);
}

}  // namespace

ContactFinder::ContactFinder(const scene::Organ& organ)
    : surface_(organ), greatest_pressure_(kGreatestPressure * greatest_modulus_pa(organ)) {
  path_.reserve(kMaxPathSteps + 1);
  for (auto& nearby : nearby_) nearby.triangles.reserve(256);
}

std::span<const TriangleIndex> ContactFinder::triangles_near(const world::World& world,
                                                             ToolSlot slot) {
  Nearby& nearby = nearby_[slot.value];
  const auto start = path_.front().core_corners(), goal = path_.back().core_corners();
  const float reach = path_.front().radius + kMargin_m + greatest_distance(start, goal);
  const auto moved = static_cast<float>(surface_travel_ - nearby.surface_travel);
  if (nearby.is_known && greatest_distance(start, nearby.corners) + moved + reach <= nearby.range)
    return nearby.triangles;
  if (refreshed_travel_ != surface_travel_) {
    surface_.refresh(world);
    refreshed_travel_ = surface_travel_;
  }
  nearby = {true, start, reach + kSlack_m, surface_travel_, std::move(nearby.triangles)};
  Box box;
  for (const auto& corner : start) box.include(corner);
  box.grow(nearby.range);
  surface_.collect(box, world, nearby.triangles);
  std::erase_if(nearby.triangles, [&](TriangleIndex t) {
    const Triangle triangle(surface_[t], world);
    return distance_to(path_.front(), triangle.centre) > nearby.range + triangle.radius;
  });
  return nearby.triangles;
}

// From the proxy towards the hand.
void ContactFinder::plan_way(const ContactScene& scene, ToolContact& contact) {
  const auto& tool = scene.tools[contact.tool];
  const auto& proxy = scene.proxies[contact.tool];
  const bool has_appeared =
      !proxy.is_placed || way_between(proxy.hand, tool.pose, tool.shape) > scene.jump_m;
  contact.is_placed = !has_appeared;
  contact.softness_m = greatest_pressure_ / stiffness_of(tool.shape.radius_m);
  contact.start = has_appeared ? tool.pose : proxy.pose;
  const float way = way_between(contact.start, tool.pose, tool.shape);
  const float most = std::min(scene.max_step_m, has_appeared ? contact.softness_m : proxy.step_m);
  const float part = way > most ? most / way : 1.0f;
  contact.goal = between(contact.start, tool.pose, part);
  lay_path(tool.shape, contact, way * part);
}

// Steps of at most half a radius.
void ContactFinder::lay_path(const trocar::scene::ToolShape& shape, const ToolContact& contact,
                             float way) {
  const float step = 0.5f * shape.radius_m;
  const auto steps =
      std::clamp<std::size_t>(static_cast<std::size_t>(std::ceil(way / step)), 1, kMaxPathSteps);
  path_.clear();
  for (std::size_t i = 0; i <= steps; ++i)
    path_.emplace_back(
        between(contact.start, contact.goal, static_cast<float>(i) / static_cast<float>(steps)),
        shape);
}

// Whether the tool at the start of its way holds a place of the surface deeper than one that it
// could have met.
bool ContactFinder::is_inside_tissue(std::span<const TriangleIndex> triangles,
                                     const world::World& world) const {
  const ToolSolid& solid = path_.front();
  const float deep = kMet * solid.radius;
  return std::ranges::any_of(triangles, [&](TriangleIndex t) {
    const Triangle triangle(surface_[t], world);
    if (distance_to(solid, triangle.centre) > deep + triangle.radius) return false;
    const auto divisions = surface_[t].divisions(kPlaceSpacing * solid.radius, 2 * triangle.radius);
    return std::ranges::any_of(places_on_triangle(divisions), [&](const auto& place) {
      return distance_to(solid, triangle.at(place)) < deep;
    });
  });
}

// A tool that has appeared a little inside comes from where it is just outside along its shaft, as
// instruments do.
bool ContactFinder::comes_from_outside(const ContactScene& scene, ToolContact& contact) {
  const auto& shape = scene.tools[contact.tool].shape;
  const Vec3f back = path_.front().along * (0.5f * shape.radius_m);
  for (float gone = 0; gone <= kBack_m; gone += 0.5f * shape.radius_m) {
    if (!is_inside_tissue(triangles_near(scene.world, contact.tool), scene.world)) return true;
    contact.start.position += back;
    contact.goal = contact.start;
    lay_path(shape, contact, 0);
  }
  return false;
}

void ContactFinder::find_push(const ContactScene& scene, float strength, ContactList& out) {
  ToolContact& contact = out.tools.back();
  plan_way(scene, contact);
  if (!contact.is_placed && !comes_from_outside(scene, contact)) {
    ++out.tools_inside;
    return;
  }
  const bool has_walked = std::exchange(contact.is_placed, true);
  const auto triangles = triangles_near(scene.world, contact.tool);
  triangles_visited_ += triangles.size();

  const auto& proxy = scene.proxies[contact.tool];
  const float radius = path_.front().radius;
  const float range = radius + kMargin_m +
                      greatest_distance(path_.front().core_corners(), path_.back().core_corners());
  std::size_t held = 0;  // into the proxy's places
  for (const auto t : triangles) {
    const Triangle triangle(surface_[t], scene.world);
    if (distance_to(path_.front(), triangle.centre) > range + triangle.radius) continue;
    const auto divisions = surface_[t].divisions(kPlaceSpacing * radius, 2 * triangle.radius);
    const auto places = places_on_triangle(divisions);
    const Vec3f outward = triangle.outward();
    bool is_touched = false;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Vec3f p = triangle.at(places[i]);
      const auto id = place_id(t, divisions, i);
      while (held < proxy.places.size() && proxy.places[held] < id) ++held;
      const bool is_held = has_walked && held < proxy.places.size() && proxy.places[held] == id;
      const Meeting meeting = meet(path_, p, outward, is_held);
      if (!meeting.is_near) continue;
      if (out.points.size() - contact.begin >= kMaxPointsPerTool) {
        ++out.dropped;
        continue;
      }
      is_touched |= meeting.is_touched;
      ContactPoint point = point_of(scene, contact.tool, t, places[i]);
      const float area = surface_[t].area / static_cast<float>(places.size()) * strength;
      point.place = id;
      point.stiffness = stiffness_of(radius) * area;
      point.hold_stiffness = kHoldRatio * point.stiffness;
      point.limit_n = greatest_pressure_ * area;
      point.normal = meeting.normal;
      const Vec3f at_rest = rest_position_of(point, scene.world);
      point.plane = meeting.on_face - at_rest;
      const Vec3f anchor = is_held ? proxy.anchors[held] : contact.start.apply_inverse(p);
      point.anchor = contact.goal.apply(anchor) - at_rest;
      out.points.push_back(point);
    }
    const auto& nodes = surface_[t].nodes;
    if (is_touched) out.seeds.insert(out.seeds.end(), nodes.begin(), nodes.end());
  }
  const auto seeds = out.seeds.begin() + contact.seeds_begin;
  std::sort(seeds, out.seeds.end());
  out.seeds.erase(std::unique(seeds, out.seeds.end()), out.seeds.end());
}

ContactPoint ContactFinder::point_of(const ContactScene& scene, ToolSlot tool,
                                     TriangleIndex triangle,
                                     const std::array<float, 3>& place) const {
  ContactPoint point{.friction = scene.tools[tool].shape.friction};
  for (std::size_t k = 0; k < 3; ++k) {
    point.nodes[k] = surface_[triangle].nodes[k];
    point.weights[k] = place[k];
    const auto owner = scene.claims.owner(point.nodes[k]);
    if (owner.is_valid() && owner != tool)
      point.moved = static_cast<std::uint8_t>(point.moved & ~(1u << k));
  }
  return point;
}

void ContactFinder::add_grips(const ContactScene& scene, ToolSlot slot, float strength,
                              ContactList& out) const {
  const Grasp& grasp = scene.grasps[slot];
  const auto& world = scene.world;
  ToolContact& contact = out.tools.back();
  contact.goal = scene.grasps.pose(slot, scene.tools[slot]);
  float area = 0;
  for (const auto node : grasp.nodes) area += world.surface_areas[node.value];
  for (std::size_t i = 0; i < grasp.nodes.size(); ++i) {
    const auto node = grasp.nodes[i];
    const float own = world.surface_areas[node.value];
    out.points.push_back(
        {.nodes = {node},
         .weights = {1},
         .kind = ContactPoint::Kind::Grip,
         .node_count = 1,
         .moved = 1,
         .place = static_cast<std::uint32_t>(i),
         .stiffness = kStiffnessPaPerM * own * strength,
         .limit_n = grasp.grip_n * (own / area) * grasp.closed * strength,
         .anchor = contact.goal.apply(held_offset(grasp, i)) - world.rest_positions[node.value]});
    out.seeds.push_back(node);
  }
}

void ContactFinder::find_reach(const ContactScene& scene, ToolSlot slot, ContactList& out) const {
  const auto& tool = scene.tools[slot];
  const float reach = tool.shape.reach_m;
  const std::size_t first = out.reach_nodes.size();
  for (const auto node : scene.world.surface_nodes) {
    if (scene.world.node_classes[node.value] == world::NodeClass::Fixed) continue;
    if (length_squared(scene.world.position(node) - tool.pose.position) > reach * reach) continue;
    if (out.reach_nodes.size() - first >= kMaxPointsPerTool) {
      ++out.dropped;
      continue;
    }
    out.reach_nodes.push_back(node);
  }
}

void ContactFinder::find(const ContactScene& scene, ContactList& out) {
  out.clear();
  triangles_visited_ = 0;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    const auto& tool = scene.tools[slot];
    const auto& claim = scene.claims.claim(slot);
    const bool grasps = claim.verb == trocar::scene::Verb::Grasp;
    if (scene.claims.is_in_effect(slot)) {
      if (!grasps && !tool.has_sample) continue;
      const float strength = scene.claims.strength(slot, scene.tick);
      out.tools.push_back({.tool = slot,
                           .verb = claim.verb,
                           .begin = static_cast<std::uint32_t>(out.points.size()),
                           .seeds_begin = static_cast<std::uint32_t>(out.seeds.size())});
      if (grasps)
        add_grips(scene, slot, strength, out);
      else
        find_push(scene, strength, out);
      out.tools.back().end = static_cast<std::uint32_t>(out.points.size());
      out.tools.back().seeds_end = static_cast<std::uint32_t>(out.seeds.size());
    } else if (tool.has_sample && tool.verb == trocar::scene::Verb::Grasp) {
      const auto begin = static_cast<std::uint32_t>(out.reach_nodes.size());
      find_reach(scene, slot, out);
      out.reach[i] = {begin, static_cast<std::uint32_t>(out.reach_nodes.size())};
    }
  }
  out.self_begin = static_cast<std::uint32_t>(out.points.size());
}

}  // namespace trocar::contact

#include "server/tissue/contact/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trocar::contact {
namespace {

constexpr float kSlack_m = 0.005f;
constexpr std::size_t kMaxPathSteps = 64;
constexpr std::uint32_t kNotNear = 0xffffffffu;

float distance_to(const ToolSolid& solid, const Vec3f& p) {
  return length(p - solid.nearest_on_core(p));
}

// A tool touches a patch as wide as its radius one way, and as its half width more the other.
float stiffness_of(const trocar::tool::ToolShape& shape) {
  const auto thinness = [](float half_m) { return std::max(1.0f, kStiffnessRadius_m / half_m); };
  return kStiffnessPaPerM *
         (thinness(shape.radius_m) * thinness(shape.radius_m + shape.half_width_m));
}

struct Triangle {
  std::array<Vec3f, 3> corners;
  Vec3f centre;
  float radius = 0;  // of a ball around the centre that holds it

  Triangle(const NearTriangle& near, std::span<const Vec3f> positions)
      : Triangle(positions[near.corners[0]], positions[near.corners[1]],
                 positions[near.corners[2]]) {}
  Triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c) : corners{a, b, c} {
    centre = (corners[0] + corners[1] + corners[2]) * (1.0f / 3.0f);
    float squared = 0;
    for (const auto& corner : corners) squared = std::max(squared, length_squared(corner - centre));
    radius = std::sqrt(squared);
  }
  Vec3f at(const std::array<float, 3>& weights) const {
    return corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
  }
  Vec3f outward() const { return cross(corners[1] - corners[0], corners[2] - corners[0]); }
};

// A point this far inside the tool, in radii, at the start of its way was not met from outside.
constexpr float kMet = 0.7f;

// A point is met head-on within this cosine of a tool's way.
constexpr float kHeadOn = 0.5f;

// A combination of a triangle's corners' values.
Vec3f combine(std::span<const Vec3f> values, const std::array<std::uint32_t, 3>& corners,
              const std::array<float, 3>& weights) {
  Vec3f sum;
  for (std::size_t k = 0; k < 3; ++k) sum += values[corners[k]] * weights[k];
  return sum;
}

// Finds where a point that is at `p` meets the tool on its way. is_held: the tool pressed it in the
// last tick, so that it was met from outside whatever it looks like now.
struct Meeting {
  bool is_near = false;     // within the margin at the end of the way
  bool is_touched = false;  // inside the tool somewhere on the way
  Vec3f normal, on_face;    // of the tool at the end of the way
};
// reach_m: what is farther than that from the core at the start is not near on the way.
Meeting meet(std::span<const ToolSolid> path, float reach_m, const Vec3f& p, const Vec3f& outward,
             bool is_held) {
  Meeting result;
  const float radius = path.front().radius;
  Vec3f carried = p, core = path.front().nearest_on_core(p), from_core = p - core;
  const float squared = length_squared(from_core);
  if (!is_held && squared > reach_m * reach_m) return result;
  const bool is_behind = dot(from_core, outward) > 0;
  const bool is_deep = squared < kMet * kMet * radius * radius;
  if (!is_held && (is_behind || is_deep)) return result;
  float distance = std::sqrt(squared);
  // The normal, undivided: the last way from the core that had a length.
  Vec3f along = from_core;
  float along_length = distance;
  if (!(distance > 1e-30f)) along = normalized(-outward, {0, 1, 0}), along_length = 1;
  const auto look = [&](const ToolSolid& solid) {
    core = solid.nearest_on_core(carried);
    from_core = carried - core;
    distance = length(from_core);
    if (distance > 1e-9f) along = from_core, along_length = distance;
  };
  const auto carry = [&] {
    if (distance > radius) return false;
    result.is_touched = true;
    carried += along / along_length * (radius - distance);
    return true;
  };
  if (is_behind) {  // pressed through the tool's core: back to the side on which it was met
    along = -along;
    carried = core + along / along_length * radius;
    result.is_touched = true;
    look(path.front());
  }
  bool is_carried = carry();
  for (const auto& solid : path.subspan(1)) {
    look(solid);
    is_carried = carry();
  }
  if (is_carried) look(path.back());
  result.is_near = result.is_touched || distance <= radius + kMargin_m;
  if (!result.is_near) return result;
  result.normal = along / along_length;
  result.on_face = core + result.normal * radius;
  return result;
}

// Returns the first step of the path, of fewer than `most`, at which the tool has met the point
// head-on: it was outside before; otherwise `most`.
std::size_t first_meeting(std::span<const ToolSolid> path, const Vec3f& ahead, const Vec3f& p,
                          const Vec3f& outward, std::size_t most) {
  const float squared = path.front().radius * path.front().radius;
  const Vec3f at_start = p - path.front().nearest_on_core(p);
  if (dot(at_start, outward) > 0 || length_squared(at_start) < squared) return most;
  for (std::size_t step = 1; step < most; ++step) {
    const Vec3f from_core = p - path[step].nearest_on_core(p);
    if (length_squared(from_core) < squared)
      return dot(from_core, ahead) > kHeadOn * length(from_core) ? step : most;
  }
  return most;
}

// Points keep their ids while their triangle keeps its divisions. Those of the finest division
// share numbers with the coarsest, to which no triangle turns within a tick.
std::uint32_t point_id(TriangleIndex triangle, std::uint32_t divisions, std::size_t point) {
  constexpr std::uint32_t kPoints = kMaxDivisions * kMaxDivisions;
  static_assert(kFineDivisions * kFineDivisions <= kMaxDivisions * kPoints);
  if (divisions == kFineDivisions) divisions = 1;
  return (triangle.value * kMaxDivisions + divisions - 1) * kPoints +
         static_cast<std::uint32_t>(point);
}

// The points of one pushing tool, triangle by triangle in ascending order.
class PushPoints {
 public:
  struct Push {
    float strength = 0, greatest_pressure = 0;
    bool has_walked = false;  // from where it was: it holds what it pressed there
  };

  PushPoints(const ContactScene& scene, const ToolContact& contact, std::span<const ToolSolid> path,
             std::span<const Vec3f> rest_positions, const Push& push)
      : scene_(scene),
        proxy_(scene.proxies[contact.tool]),
        contact_(contact),
        path_(path),
        rest_positions_(rest_positions),
        push_(push),
        stiffness_(stiffness_of(scene.tools[contact.tool].shape)),
        friction_(scene.tools[contact.tool].shape.friction) {
    const auto start = path.front().core_corners();
    for (const auto& solid : path)
      reach_m_ = std::max(reach_m_, greatest_distance(start, solid.core_corners()));
    reach_m_ += path.front().radius + kMargin_m + kRounding_m;
  }

  // Whether it holds a point of this triangle; ascending, as add().
  bool holds(TriangleIndex triangle) {
    const auto& held = proxy_.point_ids;
    const auto first = point_id(triangle, 1, 0);
    while (next_held_ < held.size() && held[next_held_] < first) ++next_held_;
    return next_held_ < held.size() &&
           held[next_held_] <= point_id(triangle, kMaxDivisions, kMaxDivisions * kMaxDivisions - 1);
  }
  // Whether the tool touches the triangle.
  bool add(const NearTriangle& near, const Triangle& triangle, ContactList& out) {
    const auto& held = proxy_.point_ids;
    const auto divisions =
        near.surface.divisions(kPointSpacing * path_.front().radius, 2 * triangle.radius);
    const auto quadrature = quadrature_points(divisions);
    const Vec3f outward = triangle.outward();
    const float area = near.surface.area / static_cast<float>(quadrature.size()) * push_.strength;
    bool is_touched = false;
    for (std::size_t i = 0; i < quadrature.size(); ++i) {
      const Vec3f p = triangle.at(quadrature[i]);
      const auto id = point_id(near.index, divisions, i);
      while (next_held_ < held.size() && held[next_held_] < id) ++next_held_;
      const bool is_held = push_.has_walked && next_held_ < held.size() && held[next_held_] == id;
      const Meeting meeting = meet(path_, reach_m_, p, outward, is_held);
      if (!meeting.is_near) continue;
      if (out.points.size() - contact_.begin >= kMaxPointsPerTool) {
        ++out.dropped;
        continue;
      }
      is_touched |= meeting.is_touched;
      const auto& nodes = near.surface.nodes;
      const auto& weights = quadrature[i];
      const float stiffness = stiffness_ * area;
      const Vec3f at_rest = combine(rest_positions_, near.corners, weights);
      const Vec3f anchor = is_held ? proxy_.anchors[next_held_] : contact_.start.apply_inverse(p);
      out.points.push_back({.nodes = {nodes[0], nodes[1], nodes[2], {}},
                            .weights = {weights[0], weights[1], weights[2], 0},
                            .kind = ContactPoint::Kind::Push,
                            .node_count = 3,
                            .moved = moved_nodes(nodes),
                            .id = id,
                            .stiffness = stiffness,
                            .hold_stiffness = kHoldRatio * stiffness,
                            .friction = friction_,
                            .limit_n = push_.greatest_pressure * area,
                            .normal = meeting.normal,
                            .plane = meeting.on_face - at_rest,
                            .anchor = contact_.goal.apply(anchor) - at_rest});
    }
    return is_touched;
  }

 private:
  std::uint8_t moved_nodes(const std::array<NodeIndex, 3>& nodes) const {
    std::uint8_t moved = 0b1111;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto owner = scene_.claims.owner(nodes[k]);
      if (owner.is_valid() && owner != contact_.tool)
        moved = static_cast<std::uint8_t>(moved & ~(1u << k));
    }
    return moved;
  }

  const ContactScene& scene_;
  const Proxy& proxy_;
  const ToolContact& contact_;
  std::span<const ToolSolid> path_;
  std::span<const Vec3f> rest_positions_;  // by NearTriangle::corners
  Push push_;
  float stiffness_, friction_;
  float reach_m_ = 0;          // of the core at the start, beyond which nothing is near on the way
  std::size_t next_held_ = 0;  // into the proxy's points
};

float greatest_modulus_pa(const organ::Organ& organ) {
  double most = organ.material.young_modulus_pa;
  for (const auto& region : organ.regions) most = std::max(most, region.material.young_modulus_pa);
  return static_cast<float>(most);
}

}  // namespace

ContactFinder::ContactFinder(const organ::Organ& organ)
    : surface_(organ),
      greatest_pressure_(kGreatestPressure * greatest_modulus_pa(organ)),
      near_of_node_(organ.mesh.node_count(), kNotNear) {
  path_.reserve(kMaxPathSteps + 1);
  found_.reserve(1024);
  near_nodes_.reserve(3 * 1024);
  positions_.reserve(1024);
  for (auto& nearby : nearby_) {
    nearby.triangles.reserve(256);
    nearby.gaps.reserve(256);
    nearby.nodes.reserve(256);
    nearby.rest_positions.reserve(256);
  }
}

void ContactFinder::update(const topology::SurfaceEdit& edit, const world::World& world) {
  surface_.update(edit, world);
  near_of_node_.resize(world.node_count(), kNotNear);
  for (auto& nearby : nearby_) nearby.is_known = false;
}

const ContactFinder::Nearby& ContactFinder::look_near(const world::World& world, ToolSlot slot) {
  Nearby& nearby = nearby_[slot.value];
  const bool is_other_tool = nearby.radius_m != path_.front().radius;
  if (!nearby.is_known || is_other_tool || nearer_by(nearby) > nearby.slack) {
    nearby.is_known = true;
    nearby.radius_m = path_.front().radius;
    nearby.corners = path_.front().core_corners();
    nearby.surface_travel = surface_travel_;
    nearby.slack = kSlack_m + nearer_by(nearby);
    list_near(world, nearby);
  }
  positions_.resize(nearby.nodes.size());
  for (std::size_t i = 0; i < positions_.size(); ++i)
    positions_[i] = nearby.rest_positions[i] + world.displacements[nearby.nodes[i].value];
  return nearby;
}

// How much nearer any point of the surface can have come to the tool's core, until the end of its
// way, than it was when the list was made.
float ContactFinder::nearer_by(const Nearby& nearby) const {
  const auto start = path_.front().core_corners(), goal = path_.back().core_corners();
  return greatest_distance(start, nearby.corners) +
         static_cast<float>(surface_travel_ - nearby.surface_travel) +
         greatest_distance(start, goal);
}

void ContactFinder::list_near(const world::World& world, Nearby& nearby) {
  Box box;
  for (const auto& corner : nearby.corners) box.include(corner);
  const float reach = path_.front().radius + kMargin_m;
  box.grow(reach + nearby.slack);
  surface_.collect(box, world, surface_travel_, found_);
  nearby.triangles.clear();
  nearby.gaps.clear();
  nearby.nodes.clear();
  nearby.rest_positions.clear();
  for (const auto t : found_) {
    const auto& nodes = surface_[t].nodes;
    const Triangle now(world.position(nodes[0]), world.position(nodes[1]),
                       world.position(nodes[2]));
    const float gap = distance_to(path_.front(), now.centre) - now.radius - reach;
    if (gap > nearby.slack) continue;
    nearby.gaps.push_back(gap);
    auto& triangle = nearby.triangles.emplace_back(NearTriangle{t, surface_[t], {}});
    for (std::size_t k = 0; k < 3; ++k) {
      auto& near = near_of_node_[nodes[k].value];
      if (near == kNotNear) {
        near = static_cast<std::uint32_t>(nearby.nodes.size());
        nearby.nodes.push_back(nodes[k]);
        nearby.rest_positions.push_back(world.rest_positions[nodes[k].value]);
      }
      triangle.corners[k] = near;
    }
  }
  for (const auto node : nearby.nodes) near_of_node_[node.value] = kNotNear;
}

// From the proxy towards the hand.
void ContactFinder::plan_way(const ContactScene& scene, ToolContact& contact) {
  const auto& tool = scene.tools[contact.tool];
  const auto& proxy = scene.proxies[contact.tool];
  const bool has_appeared =
      !proxy.is_placed || way_between(proxy.hand, tool.pose, tool.shape) > scene.jump_m;
  contact.is_placed = !has_appeared;
  contact.softness_m = greatest_pressure_ / stiffness_of(tool.shape);
  contact.start = has_appeared ? tool.pose : proxy.pose;
  const float way = way_between(contact.start, tool.pose, tool.shape);
  const float most = std::min(scene.max_step_m, has_appeared ? contact.softness_m : proxy.step_m);
  float part = way > most ? most / way : 1.0f;
  const bool is_held_back = (scene.held_back >> contact.tool.value & 1) != 0;
  if (const float tip_way = length(tool.pose.position - contact.start.position);
      is_held_back && proxy.presses() && tip_way > kHeldBack_m)
    part = std::min(part, kHeldBack_m / tip_way);
  contact.goal = part_of_way(contact.start, tool.pose, part);
  lay_path(tool.shape, contact, way * part);
}

// Steps of at most half a radius.
void ContactFinder::lay_path(const trocar::tool::ToolShape& shape, const ToolContact& contact,
                             float way) {
  const float step = 0.5f * shape.radius_m;
  const auto steps =
      std::clamp<std::size_t>(static_cast<std::size_t>(std::ceil(way / step)), 1, kMaxPathSteps);
  path_.clear();
  for (std::size_t i = 0; i <= steps; ++i)
    path_.emplace_back(
        part_of_way(contact.start, contact.goal, static_cast<float>(i) / static_cast<float>(steps)),
        shape);
}

// Whether the tool at the start of its way holds a quadrature point deeper than one that it
// could have met.
bool ContactFinder::is_inside_tissue(const Nearby& nearby) const {
  const ToolSolid& solid = path_.front();
  const float deep = kMet * solid.radius;
  return std::ranges::any_of(nearby.triangles, [&](const NearTriangle& near) {
    const Triangle triangle(near, positions_);
    if (distance_to(solid, triangle.centre) > deep + triangle.radius) return false;
    const auto divisions =
        near.surface.divisions(kPointSpacing * solid.radius, 2 * triangle.radius);
    return std::ranges::any_of(quadrature_points(divisions), [&](const auto& weights) {
      return distance_to(solid, triangle.at(weights)) < deep;
    });
  });
}

// A tool that has appeared a little inside comes from where it is just outside along its shaft, as
// instruments do.
bool ContactFinder::comes_from_outside(const ContactScene& scene, ToolContact& contact) {
  const auto& shape = scene.tools[contact.tool].shape;
  const Vec3f back = path_.front().along * (0.5f * shape.radius_m);
  for (float gone = 0; gone <= kBack_m; gone += 0.5f * shape.radius_m) {
    if (!is_inside_tissue(look_near(scene.world, contact.tool))) return true;
    contact.start.position += back;
    contact.goal = contact.start;
    lay_path(shape, contact, 0);
  }
  return false;
}

// A tool that is fast for its radius would part the points that it meets, and go between them: it
// stops where it first meets one head-on.
void ContactFinder::stop_at_meeting(const Nearby& nearby, ToolContact& contact) {
  if (path_.size() <= 2) return;
  const Vec3f way = contact.goal.position - contact.start.position;
  const Vec3f ahead = normalized(way, {});
  const float range = path_.front().radius +
                      greatest_distance(path_.front().core_corners(), path_.back().core_corners());
  auto most = path_.size();
  for (const auto& near : nearby.triangles) {
    const Triangle triangle(near, positions_);
    if (distance_to(path_.front(), triangle.centre) > range + triangle.radius) continue;
    const auto divisions =
        near.surface.divisions(kPointSpacing * path_.front().radius, 2 * triangle.radius);
    for (const auto& weights : quadrature_points(divisions))
      most = first_meeting(path_, ahead, triangle.at(weights), triangle.outward(), most);
  }
  if (most == path_.size()) return;
  const float part = static_cast<float>(most) / static_cast<float>(path_.size() - 1);
  contact.goal = part_of_way(contact.start, contact.goal, part);
  path_.resize(most + 1, path_.front());
}

void ContactFinder::find_push(const ContactScene& scene, float strength, ContactList& out) {
  ToolContact& contact = out.tools.back();
  plan_way(scene, contact);
  if (!contact.is_placed && !comes_from_outside(scene, contact)) {
    ++out.tools_inside;
    return;
  }
  const bool has_walked = std::exchange(contact.is_placed, true);
  const Nearby& nearby = look_near(scene.world, contact.tool);
  triangles_visited_ += nearby.triangles.size();
  if (has_walked) stop_at_meeting(nearby, contact);

  const float radius = path_.front().radius;
  const float range = radius + kMargin_m +
                      greatest_distance(path_.front().core_corners(), path_.back().core_corners());
  PushPoints points(scene, contact, path_, nearby.rest_positions,
                    {strength, greatest_pressure_, has_walked});
  const float nearer = nearer_by(nearby) + kRounding_m;
  for (std::size_t i = 0; i < nearby.triangles.size(); ++i) {
    const auto& near = nearby.triangles[i];
    if (nearby.gaps[i] > nearer && !points.holds(near.index)) continue;
    const Triangle triangle(near, positions_);
    if (distance_to(path_.front(), triangle.centre) > range + triangle.radius) continue;
    if (points.add(near, triangle, out))
      out.seeds.insert(out.seeds.end(), near.surface.nodes.begin(), near.surface.nodes.end());
  }
  const auto seeds = out.seeds.begin() + contact.seeds_begin;
  std::sort(seeds, out.seeds.end());
  out.seeds.erase(std::unique(seeds, out.seeds.end()), out.seeds.end());
}

void ContactFinder::add_grips(const ContactScene& scene, ToolSlot slot, float strength,
                              ContactList& out) const {
  const Grasp& grasp = scene.grasps[slot];
  const auto& world = scene.world;
  ToolContact& contact = out.tools.back();
  contact.goal = grasp.jaws;
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
         .id = static_cast<std::uint32_t>(i),
         .stiffness = kStiffnessPaPerM * own * strength,
         .limit_n = grasp.grip_n * (own / area) * grasp.closed * strength,
         .anchor = contact.goal.apply(held_offset(grasp, i)) - world.rest_positions[node.value]});
    out.seeds.push_back(node);
  }
}

void ContactFinder::find_reach(const ContactScene& scene, ToolSlot slot, ContactList& out) {
  const auto& tool = scene.tools[slot];
  const bool cuts = tool.verb == trocar::tool::Verb::Cut;
  const float reach = cuts ? kCutCore_m : tool.shape.reach_m;
  const Vec3f edge = cuts ? hands::cut_line_of(tool) : Vec3f{};
  const float edge_squared = std::max(length_squared(edge), 1e-12f);
  Box box;
  box.include(tool.pose.position);
  box.include(tool.pose.position + edge);
  box.grow(reach);
  surface_.collect(box, scene.world, surface_travel_, found_);
  near_nodes_.clear();
  for (const auto triangle : found_)
    for (const auto node : surface_[triangle].nodes) near_nodes_.push_back(node);
  std::ranges::sort(near_nodes_);
  near_nodes_.erase(std::unique(near_nodes_.begin(), near_nodes_.end()), near_nodes_.end());
  const std::size_t first = out.reach_nodes.size();
  for (const auto node : near_nodes_) {
    if (scene.world.node_classes[node.value] == world::NodeClass::Fixed) continue;
    const Vec3f from_tip = scene.world.position(node) - tool.pose.position;
    const float along = std::clamp(dot(from_tip, edge) / edge_squared, 0.0f, 1.0f);
    if (length_squared(from_tip - edge * along) > reach * reach) continue;
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
    const bool grasps = claim.verb == trocar::tool::Verb::Grasp;
    if (scene.claims.is_in_effect(slot) && claim.verb != trocar::tool::Verb::Cut) {
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
    } else if (tool.has_sample &&
               (tool.verb == trocar::tool::Verb::Grasp || tool.verb == trocar::tool::Verb::Cut)) {
      const auto begin = static_cast<std::uint32_t>(out.reach_nodes.size());
      find_reach(scene, slot, out);
      out.reach[i] = {begin, static_cast<std::uint32_t>(out.reach_nodes.size())};
    }
  }
  out.self_begin = static_cast<std::uint32_t>(out.points.size());
}

}  // namespace trocar::contact

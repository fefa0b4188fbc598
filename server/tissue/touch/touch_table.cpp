#include "server/tissue/touch/touch_table.h"

#include <algorithm>
#include <cmath>

#include "server/tissue/contact/contact_law.h"
#include "server/tissue/contact/proxies.h"
#include "server/tissue/touch/haptic_law.h"

namespace trocar::touch {
namespace {

using wire::TouchKind;

// Across the normal, tissue is so much softer than along it (measured on the liver).
constexpr float kAcross = 0.72f;
constexpr float kLeastDepth_m = 0.001f;
constexpr float kExpectedDepth_m = 0.005f;  // of a press that has not begun

bool is_touching(TouchKind kind) {
  return kind != TouchKind::Free && kind != TouchKind::Near;
}

Vec3f shaft_of(const Pose& pose) {
  return rotate(pose.orientation, {0, 0, 1});
}

// Tissue that others have moved goes on for so long, as what relaxed comes back.
constexpr Tick kActedTicks = 10'000;

// Whether another tool touches, holds or cuts.
bool do_others_act(const TouchTable::Scene& scene, ToolSlot slot) {
  for (const auto& contact : scene.contacts.tools)
    if (contact.tool != slot && contact.begin < contact.end) return true;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const auto& force = scene.cuts.felt(ToolSlot{i}).force_n;
    if (ToolSlot{i} != slot && dot(force, force) > 0) return true;
  }
  return false;
}

// More than half of what it feels is tissue that somebody else holds, or a claim was refused here.
bool is_rigid(const TouchTable::Scene& scene, const contact::ToolContact& contact) {
  float held = 0, all = 0;
  for (const auto& point : scene.contacts.points_of(contact)) {
    all += point.stiffness;
    const auto moves = static_cast<unsigned>(point.moved) & ((1u << point.node_count) - 1);
    if (moves == 0) held += point.stiffness;
  }
  return held > 0.5f * all;
}

// A wall bends while it is dented, as two springs in a row. Returns the stiffness of both over that
// of a solid.
float yielding_of_wall(const wire::HapticLaw& law, const UndentedSurface::Wall& wall,
                       float radius_m) {
  const float bends = wall_stiffness_n_m(law, wall.thickness_m, wall.curvature);
  return bends / (bends + hertz_stiffness_n_m(law, radius_m, kExpectedDepth_m));
}

// A tool stops where one of its points presses as hard as tissue bears, and its force grows no more
// however deep the hand goes. Returns the force along the normal then, else 0.
float pressed_limit_n(const TouchTable::Scene& scene, ToolSlot slot, const Vec3f& force,
                      const Vec3f& normal) {
  constexpr float kAlmost = 0.999f;
  constexpr float kHeldBack_m = 0.001f;  // by which the hand is deeper than the tool
  for (const auto& contact : scene.contacts.tools) {
    if (contact.tool.value != slot.value) continue;
    // One point of a blunt tool may bear no more while the others do.
    const Vec3f back = contact.start.position - scene.tools[slot].pose.position;
    if (dot(back, normal) < kHeldBack_m) return 0;
    const auto points = scene.contacts.points_of(contact);
    const bool has_stopped = std::ranges::any_of(points, [&](const auto& point) {
      const auto d = contact::displacement_of(point, scene.world);
      return contact::load_at(point, d).pressed_n > kAlmost * point.limit_n;
    });
    return has_stopped ? std::max(0.0f, dot(force, normal)) : 0;
  }
  return 0;
}

}  // namespace

TouchTable::TouchTable(const organ::Organ& organ)
    : laws_(haptic_laws(organ)), law_of_node_(organ::material_map(organ).nodes) {}

void TouchTable::update(const Scene& scene) {
  std::array<const contact::ToolContact*, kMaxTools> contacts{};
  for (const auto& contact : scene.contacts.tools) contacts[contact.tool.value] = &contact;
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot slot{i};
    const auto& tool = scene.tools[slot];
    auto& touch = touches_[i];
    if (!tool.has_sample || tool.time_us == 0) {  // Nobody feels it.
      touch.kind = TouchKind::Free;
      continue;
    }
    const auto& claim = scene.claims.claim(slot);
    auto kind = TouchKind::Free;
    contact::Reaction reaction;
    if (claim.verb == tool::Verb::Cut && scene.claims.is_in_effect(slot)) {
      const auto& felt = scene.cuts.felt(slot);
      reaction.force_n = felt.force_n;
      reaction.torque_nm = felt.torque_nm;
      if (dot(reaction.force_n, reaction.force_n) > 0) kind = TouchKind::Cut;
    } else if (const auto* contact = contacts[i]; contact && contact->begin < contact->end) {
      reaction = contact::reaction_on(scene.contacts, *contact, scene.world);
      const bool presses = dot(reaction.force_n, reaction.force_n) > 0;
      if (contact->verb == tool::Verb::Grasp)
        kind = TouchKind::Grip;
      else if (presses)
        kind = is_rigid(scene, *contact) ? TouchKind::Rigid : TouchKind::Push;
    }
    const bool is_refused = claim.phase == hands::ClaimPhase::Wanted &&
                            claim.last_refusal != hands::ClaimOutcome::Granted;
    if (is_refused && !is_touching(kind) && touch.kind != TouchKind::Free) kind = TouchKind::Rigid;
    if (kind == TouchKind::Free && touch.surface.is_known()) kind = TouchKind::Near;

    // To begin and to end to press is what depth says; the rest is another thing.
    const auto thing = [](TouchKind k) { return is_touching(k) ? k : TouchKind::Push; };
    if (thing(kind) != thing(touch.kind)) {
      touch.structure = static_cast<std::uint32_t>(scene.world.tick);
      if (kind == TouchKind::Grip) touch.grip_point = tool.pose.position;
      touch.stiffness.clear();
    }
    touch.kind = kind;
    touch.force = reaction.force_n;
    touch.torque = reaction.torque_nm;
    const auto& held_at = kind == TouchKind::Grip ? scene.grasps[slot].jaws : tool.pose;
    if (is_touching(kind)) touch.stiffness.add(held_at.position, touch.force);
    if (kind != TouchKind::Push) continue;
    // Torque about the tip is the force's lever along the shaft, and what little friction adds.
    const Vec3f shaft = shaft_of(tool.pose);
    const Vec3f turn = cross(shaft, touch.force);
    const float turning = dot(turn, turn);
    // A force along the shaft has no lever: it is the tip that presses.
    const bool has_lever = turning > 0.1f * dot(touch.force, touch.force);
    const float along = has_lever ? dot(touch.torque, turn) / turning : 0;
    touch.along_m = std::clamp(along, 0.0f, tool.shape.length_m);
  }
}

void TouchTable::describe_surface(const Scene& scene, ToolSlot slot, wire::HapticPatch& patch) {
  const auto& tool = scene.tools[slot];
  auto& touch = touches_[slot.value];
  const auto& layout = scene.cuts.layout();
  auto& surface = touch.surface;
  const Vec3f shaft = shaft_of(tool.pose);
  const Vec3f place = tool.pose.position + shaft * touch.along_m;
  if (!is_touching(touch.kind)) {
    touch.along_m = 0;
    surface.settle(scene.world, layout, place);
  } else if (!surface.is_known() || surface.has_changed(layout, place)) {
    if (surface.is_known()) {
      touch.structure = static_cast<std::uint32_t>(scene.world.tick);
      // A blade feels no spring, and each step of it is another surface.
      if (touch.kind == TouchKind::Grip) touch.stiffness.clear();
    }
    if (touch.kind == TouchKind::Cut) {
      surface.take_beside_wound(scene.world, layout, place);
    } else {
      surface.clear();
      surface.take(scene.world, layout, place);
    }
  }
  if (!surface.is_known()) {
    if (!is_touching(touch.kind)) touch.kind = TouchKind::Free;
    return;
  }
  if (is_touching(touch.kind)) {
    const Vec3f core = tool.pose.position + shaft * std::max(touch.along_m, tool.shape.radius_m);
    if (do_others_act(scene, slot)) touch.others_tick = scene.world.tick;
    const bool do_others =
        touch.others_tick != 0 && scene.world.tick - touch.others_tick < kActedTicks;
    surface.follow(scene.world, layout, core, tool.shape.radius_m, do_others);
  }
  const float radius = std::max(tool.shape.radius_m, 0.004f);
  const auto [point, normal, corner] = surface.felt_plane(place, radius);
  auto node = corner;
  while (node.value >= law_of_node_.size())
    node = scene.world.origins[node.value - law_of_node_.size()].a;
  touch.law = law_of_node_[node.value];
  const auto& law = laws_[touch.law];
  // Clients measure the depth of the round tip. Where the shaft touches, the plane is brought
  // there.
  const float beyond_tip = std::max(0.0f, touch.along_m - tool.shape.radius_m);
  patch.plane_point_m = point - normal * (dot(normal, shaft) * beyond_tip);
  patch.plane_normal = normal;
  const float depth = dot(normal, patch.plane_point_m - tool.pose.position);
  if (!is_touching(touch.kind)) {
    touch.kind = -depth < kNear_m ? TouchKind::Near : TouchKind::Free;
    if (touch.kind == TouchKind::Free) surface.clear();
  }
  const bool touches = is_touching(touch.kind);
  if (!touches) {
    const auto wall = surface.wall({point, normal, corner});
    touch.yielding = wall ? yielding_of_wall(law, *wall, tool.shape.radius_m) : 1;
  }
  const float pressed_m = touches ? std::max(depth, kLeastDepth_m) : kExpectedDepth_m;
  const float stiffness = touch.yielding * hertz_stiffness_n_m(law, tool.shape.radius_m, pressed_m);
  SymMat3f guess;
  guess.add_identity(kAcross * stiffness);
  guess.add_outer(normal, (1 - kAcross) * stiffness);
  patch.stiffness_n_m = touches ? touch.stiffness.stiffness(guess) : guess;
  patch.has_stiffness = true;
  patch.law = law.number;
}

wire::HapticPatch TouchTable::describe(const Scene& scene, ToolSlot slot) {
  const auto& tool = scene.tools[slot];
  const auto& touch = touches_[slot.value];
  wire::HapticPatch patch;
  patch.tick = scene.world.tick;
  patch.echo_time_us = tool.time_us;
  patch.used_position_m = tool.pose.position;
  describe_surface(scene, slot, patch);
  patch.kind = touch.kind;
  patch.structure = touch.structure;
  patch.force_n = touch.force;
  patch.torque_nm = touch.torque;
  patch.friction = tool.shape.friction;
  if (touch.kind == TouchKind::Push)
    patch.pressed_limit_n = pressed_limit_n(scene, slot, touch.force, patch.plane_normal);
  if (touch.kind == TouchKind::Grip) {
    patch.grip_point_m = touch.grip_point;
    patch.grip_limit_n = scene.grasps[slot].grip_n;
  }
  if (touch.kind == TouchKind::Cut) {
    patch.cut_force_n = scene.cuts.edge(slot).cutting_n();
    patch.side_friction_n = scene.cuts.edge(slot).most_friction_n();
  }
  return patch;
}

}  // namespace trocar::touch

#pragma once

// Finds what the tools of a tick touch.
//
// Push. A tool moves from its proxy to the hand, in steps of at most half its radius. A
// quadrature point of the surface (surface.h) that it meets on the way is carried ahead of it; the
// plane that holds the point out is the tool's face at the end of the way, on the side from which
// it was met. So a tool passes through nothing, however thin and however fast it is, and a surface
// is met from outside only: a tool that appears inside tissue, deeper than kBack_m along its shaft,
// touches nothing until it has come out. Points within kMargin_m get a plane before they touch, so
// that none slips in during a tick.
//
// Cut. A blade that cuts presses nothing; what it claims is listed.
//
// Grasp. Nodes held by the jaws are gripped where they are in the jaws' frame.
//
// Work: triangles near a tool, listed with some slack and listed again when the tool and the
// surface together have moved that far. Results do not depend on when.

#include <span>
#include <vector>

#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/grasps.h"
#include "server/tissue/contact/proxies.h"
#include "server/tissue/contact/surface.h"
#include "server/tissue/contact/tool_solid.h"

namespace trocar::contact {

// Stiffness of contact per surface area, Pa/m, for tools of 8 mm radius and more: at the 1 cm^2 of
// a node of a 4,000-node liver this is 2.5 kN/m, a hundred times the tissue's own: 0.1 N indents
// 0.04 mm. Ten times less is visibly soft; ten times more slows the solver's convergence. What a
// thinner tool touches is smaller in proportion to the square of its radius, and its face is
// stiffer by that much; that of a blade in proportion to its radius and to its half width.
inline constexpr float kStiffnessPaPerM = 2.5e7f;
inline constexpr float kStiffnessRadius_m = 0.008f;
// Friction's elastic range: how stiff it is beside the face.
inline constexpr float kHoldRatio = 0.5f;
inline constexpr float kMargin_m = 0.001f;
// A tool presses no harder than this many times the greatest Young's modulus in the organ, whatever
// the hand does: tissue is moved aside, or the tool stops; it is not crushed.
inline constexpr float kGreatestPressure = 5;
// A hand that moves farther than this in a tick, 10 m/s, has not moved but appeared.
inline constexpr float kJump_m = 0.01f;
// A hand at 5 m/s; a faster one is followed at that speed.
inline constexpr float kMaxStep_m = 0.005f;
// A blade claims the surface this near to its edge, ahead of its motion.
inline constexpr float kCutCore_m = 0.004f;
// A point that appears inside by no more than this is taken to have come from outside.
inline constexpr float kBack_m = 0.012f;
// Quadrature points for a tool are this many radii apart, at most: between them it enters by 1/20
// of a radius.
inline constexpr float kPointSpacing = 0.6f;

struct ContactScene {
  const world::World& world;
  const hands::ToolTable& tools;
  const hands::ClaimTable& claims;
  const GraspTable& grasps;
  const ProxyTable& proxies;
  Tick tick = 0;
  // Per tick, of any point of a tool's core: how far a proxy walks, and beyond what a hand has
  // appeared.
  float max_step_m = kMaxStep_m, jump_m = kJump_m;
  std::uint32_t held_back = 0;  // bits of tools
};

struct NearTriangle {
  TriangleIndex index;
  SurfaceTriangle surface;
  std::array<std::uint32_t, 3> corners;  // into the nodes near the tool
};

class ContactFinder {
 public:
  explicit ContactFinder(const organ::Organ& organ);

  void find(const ContactScene& scene, ContactList& out);

  // No node has moved by more than this since the last call.
  void surface_moved(float at_most_m) { surface_travel_ += at_most_m; }

  // The world has its new nodes.
  void update(const topology::SurfaceEdit& edit, const world::World& world);

  const Surface& surface() const { return surface_; }
  // Triangles looked at by the last find(), all tools together.
  std::size_t triangles_visited() const { return triangles_visited_; }

 private:
  // The list holds what a tool can meet while nothing has come nearer to it by more than the slack.
  struct Nearby {
    bool is_known = false;
    float radius_m = 0;  // of the tool
    std::array<Vec3f, 4> corners;
    float slack = 0;
    double surface_travel = 0;
    std::vector<NearTriangle> triangles;  // ascending
    std::vector<float> gaps;  // per triangle: how much nearer it must come for the tool to meet it
    std::vector<NodeIndex> nodes;       // of these
    std::vector<Vec3f> rest_positions;  // per node
  };

  void plan_way(const ContactScene& scene, ToolContact& contact);
  void lay_path(const trocar::tool::ToolShape& shape, const ToolContact& contact, float way);
  bool comes_from_outside(const ContactScene& scene, ToolContact& contact);
  void stop_at_meeting(const Nearby& nearby, ToolContact& contact);
  void find_push(const ContactScene& scene, float strength, ContactList& out);
  void add_grips(const ContactScene& scene, ToolSlot slot, float strength, ContactList& out) const;
  void find_reach(const ContactScene& scene, ToolSlot slot, ContactList& out);
  bool is_inside_tissue(const Nearby& nearby) const;
  // Also takes positions_.
  const Nearby& look_near(const world::World& world, ToolSlot slot);
  float nearer_by(const Nearby& nearby) const;
  void list_near(const world::World& world, Nearby& nearby);

  Surface surface_;
  float greatest_pressure_ = 0;  // Pa
  double surface_travel_ = 0;    // m, sum over ticks
  std::array<Nearby, kMaxTools> nearby_;
  // The tool in work has a path (start, ..., goal), and positions of the nodes near it.
  std::vector<ToolSolid> path_;
  std::vector<Vec3f> positions_;
  // These are scratch of list_near() and find_reach().
  std::vector<TriangleIndex> found_;
  std::vector<NodeIndex> near_nodes_;
  std::vector<std::uint32_t> near_of_node_;  // per node of the organ
  std::size_t triangles_visited_ = 0;
};

}  // namespace trocar::contact

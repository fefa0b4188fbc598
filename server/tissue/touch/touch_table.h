#pragma once

// The table says what each tool feels, for a client that renders its force between two frames.
// Nothing of this is state: it follows from the ticks since the tool came near.

#include <array>
#include <vector>

#include "common/base/ids.h"
#include "common/wire/haptic_patch.h"
#include "server/organs/organ/organ.h"
#include "server/tissue/blades/tissue_cuts.h"
#include "server/tissue/contact/contact_list.h"
#include "server/tissue/contact/grasps.h"
#include "server/tissue/hands/tool_table.h"
#include "server/tissue/touch/stiffness_fit.h"
#include "server/tissue/touch/undented_surface.h"

namespace trocar::touch {

// Tissue this near to a tip is told of before it is touched.
inline constexpr float kNear_m = 0.020f;

class TouchTable {
 public:
  explicit TouchTable(const organ::Organ& organ);

  struct Scene {
    const world::World& world;
    const hands::ToolTable& tools;
    const hands::ClaimTable& claims;
    const contact::GraspTable& grasps;
    const contact::ContactList& contacts;
    const blades::TissueCuts& cuts;
  };

  // After each tick: O(points in contact).
  void update(const Scene& scene);
  // At the end of a frame, of a tool that is asked for; `tool` and `sequence` are the caller's.
  // O(triangles around the tool); where the tool has just come near, O(triangles of the surface).
  wire::HapticPatch describe(const Scene& scene, ToolSlot slot);

 private:
  struct Touch {
    wire::TouchKind kind = wire::TouchKind::Free;
    std::uint32_t structure = 0;  // the tick of its last change
    Vec3f force, torque;
    float along_m = 0;      // of the middle of the contact along the shaft, from the tip
    Vec3f grip_point;       // of the tip when the jaws closed
    std::uint16_t law = 0;  // of the tissue that it touched last
    float yielding = 1;     // stiffness of what was near, over that of a solid
    Tick others_tick = 0;   // in which others have acted last
    StiffnessFit stiffness;
    UndentedSurface surface;
  };

  void describe_surface(const Scene& scene, ToolSlot slot, wire::HapticPatch& patch);

  std::vector<wire::HapticLaw> laws_;
  std::vector<std::uint16_t> law_of_node_;  // per node of the organ
  std::array<Touch, kMaxTools> touches_;
};

}  // namespace trocar::touch

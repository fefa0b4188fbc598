#pragma once

// A tool has a shape, and a verb says what it is asked to do.

#include <cstdint>

#include "common/math/frame.h"

namespace trocar::tool {

// The verb is what the holder wants the tool to do, as long as the sample says so.
enum class Verb : std::uint8_t { None = 0, Push = 1, Grasp = 2, Cut = 3 };
inline constexpr int kVerbCount = 4;
const char* name_of(Verb verb);

// The form says how an instrument looks, and where its edge is when it cuts.
enum class Form : std::uint8_t {
  Plain = 0,  // a rod with jaws; its edge runs from the tip up along the shaft, as a scalpel's
  Probe = 1,
  Grasper = 2,
  Scissors = 3,  // two blades in the tool's yz plane: closing, they cut from the hinge to the tip
  Scalpel = 4,
  Hook = 5,  // an energised edge from the tip along the tool's y
  Spatula = 6,
  Endoscope = 7,    // looks along its shaft
  Endoscope30 = 8,  // looks 30 degrees from it, towards the tool's y
  Suction = 9,      // a tube; pushing, it takes blood away
  Clipper = 10,     // jaws that set a clip on a vessel as they close
  Coagulator = 11,  // a ball; pushing, it seals what oozes
};
inline constexpr int kFormCount = 12;
inline constexpr bool is_endoscope(Form form) {
  return form == Form::Endoscope || form == Form::Endoscope30;
}
const char* name_of(Form form);

// A capsule: tip at the tool frame's origin, shaft along +z. With a half width it is a flat blade
// with round edges, as wide along the tool's x on both sides of the shaft.
struct ToolShape {
  float radius_m = 0.005f;  // 0.0005 to 0.05
  float length_m = 0.30f;   // 0.01 to 1
  float reach_m = 0.010f;   // a grasp takes the surface nodes this near to the tip; 0.001 to 0.05
  float half_width_m = 0;   // 0 to 0.05
  float friction = 0.2f;    // Coulomb's coefficient on tissue, 0 to 2
  float grip_n = 8;  // pulled harder than this, tissue slips out of the jaws; 0.1 to 100, 0: none
  float edge_m = 0.020f;  // length of what is sharp when it cuts; 0.001 to 0.2, 0: nothing is
  Form form = Form::Plain;

  bool operator==(const ToolShape&) const = default;
};
bool is_valid(const ToolShape& shape);
// Returns what such a tool does of what its holder wants: who cannot hold or cut presses.
Verb possible(const ToolShape& shape, Verb wanted);
// Returns what an instrument is for: its main button asks for this.
Verb main_verb(const ToolShape& shape);

// One reading of a tool, as the client sent it.
struct ToolSample {
  Pose world_from_tool;
  Verb verb = Verb::None;

  bool operator==(const ToolSample&) const = default;
};

}  // namespace trocar::tool

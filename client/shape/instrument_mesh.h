#pragma once

// Each form of instrument as triangles, in the tool frame (tip at the origin, +z back along the
// shaft).

#include "client/shape/tool_mesh.h"

namespace trocar::shape {

// A jaw moves about a hinge, a line along x through (0, 0, hinge_m). It is drawn twice: as
// it is, and turned by half a turn about z.
struct InstrumentMesh {
  MeshVertices body;
  MeshVertices jaw;  // empty: nothing moves
  float hinge_m = 0;
};
InstrumentMesh make_instrument(const tool::ToolShape& shape, Colour colour);

// How far each jaw is turned about its hinge for what the tool does, rad, and how long it takes
// to get there, s. has_claim: what it wants is granted.
struct JawMotion {
  float opening = 0, seconds = 0.08f;
};
JawMotion jaw_motion(tool::Form form, tool::Verb verb, bool has_claim);

}  // namespace trocar::shape

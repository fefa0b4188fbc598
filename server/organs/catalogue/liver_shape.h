#pragma once

// The built-in liver as a signed field: the shape alone, without a mesh.
//
// Body axes as in the world frame, seen by a surgeon who stands before an upright patient: +x to
// the patient's left, +y up (towards the head), +z towards the viewer (anterior). Metres; the
// origin is near the middle of the organ. Smooth unions and cuts of ellipsoids, a few kinks on
// purpose: the inferior border, where the visceral surface cuts the diaphragmatic one, is sharp.
// Sizes and landmarks follow the adult liver of anatomy books (23 cm wide, about 1.5 l): right lobe
// under its dome, left lobe that tapers to a tip, hollow visceral surface with gallbladder fossa,
// porta hepatis and umbilical fissure, groove of the vena cava, hollow for the spine behind.
// Arithmetic is + - * / and sqrt only, so the values are the same on every machine.

#include "common/math/vec3.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {

// Negative inside; near the surface about the distance in metres.
double liver_field(const Vec3d& p);

// Box that holds the whole liver.
mesh::Box liver_box();

// Whether ligaments hold a surface point: the bare area behind the right lobe, where the organ is
// grown to the diaphragm; the bed of the vena cava; the falciform ligament along the top.
bool is_liver_held(const Vec3d& p);

}  // namespace trocar::catalogue

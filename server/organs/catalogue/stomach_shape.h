#pragma once

// The built-in stomach as a signed field: the wall of a hollow sac, without a mesh.
//
// Body axes as in the world frame, seen by a surgeon who stands before an upright patient: +x to
// the patient's left, +y up (towards the head), +z towards the viewer (anterior). Metres; the
// origin is near the middle of the organ. A J-shaped tube of changing width along a smooth centre
// line: fundus under the left dome of the diaphragm, body, antrum, pylorus; the greater curvature
// on the left and below, the lesser one with its notch, the angular incisure, on the right. The end
// of the oesophagus joins from the right above, with a notch between it and the fundus. Sizes
// follow an adult's, moderately filled. Both ends of the tube are cut off flat, so that the wall is
// one solid with one surface, of genus 1: outside, through one opening, inside, out of the other.
// Arithmetic is + - * / and sqrt only, so the values are the same on every machine.

#include "common/math/vec3.h"
#include "server/organs/mesh/stuffing.h"

namespace trocar::catalogue {

inline constexpr double kStomachWall_m = 0.007;

// Negative within the wall; near the surface about the distance in metres.
double stomach_field(const Vec3d& p);

// This is the stomach_field() of the sac without its hollow and with the tube going on at both
// ends: it is zero on the outer face of the wall, -kStomachWall_m on the inner face.
double stomach_sac_field(const Vec3d& p);

// Box that holds the whole stomach.
mesh::Box stomach_box();

// Signed distance to the plane that ends the tube, positive beyond the end.
double beyond_cardia(const Vec3d& p);
double beyond_pylorus(const Vec3d& p);

// Whether a point of the wall is held: within 8 mm of one of the openings, where the oesophagus,
// which the diaphragm holds, and the duodenum, which is grown to the wall behind, go on.
bool is_stomach_held(const Vec3d& p);

}  // namespace trocar::catalogue

#pragma once

// Closed curves that blades draw through a block, all the way through it: whatever is inside has to
// come free.

#include <string>

#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {

enum class CurveKind {
  Polygon,    // three to six corners, with a stop at each
  Circle,     // or an ellipse
  Eight,      // crosses itself once
  Wedge,      // from outside to a turn inside, and out again
  TwoHands,   // a polygon, half of it each by two blades at the same time
  BothSides,  // a polygon, its second half from the other end, with the blade turned round
  Swift,      // a polygon without stops
};
inline constexpr int kCurveKinds = 7;
const char* name_of(CurveKind kind);

struct ClosedCurve {
  CurveKind kind = CurveKind::Polygon;
  // Paths of one round are drawn at the same time, by one blade each; rounds follow each other.
  std::vector<std::vector<Path>> rounds;
  std::size_t pieces = 2;  // that there must be at least
  double inside_m2 = 0;    // the area that the curve surrounds in the block
};

// Draws in a block of this half side (m) with edges of mean length h (m). The blade is along z,
// tilted by up to 10 degrees.
ClosedCurve random_curve(CurveKind kind, double half_m, double h, trocar::testing::Random& random);

// Draws it. Returns what is wrong, or nothing.
std::string draw(CutOrgan& organ, const ClosedCurve& curve);

// Draws the curves of seeds 0 to `curves`, each in a block of its own: 40 mm, cells of 5 mm,
// jittered as box_organ() says. Returns a line for each that is wrong.
std::vector<std::string> draw_many(double jitter, std::uint64_t curves);

}  // namespace trocar::cutting::testing

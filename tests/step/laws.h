#pragma once

// Laws that hold of any organ in any hands, and random scenes to try them in: organs that nobody
// tuned for are pulled, twisted, pressed and cut, and then left alone.

#include <string>
#include <vector>

#include "tests/step/law_organs.h"

namespace trocar::step::testing {

// This is how far a scene, or the worst of many, went against the laws.
struct LawFigures {
  // The fastest node, over what it may be at most: four times the fastest tool, or what springs
  // back. Tissue of density rho and shear modulus mu at three times its length has the energy
  // W = mu/2 (3^2 + 2/3 - 3) per volume, so sqrt(2 W / rho), and twice that at a free end.
  double speed = 0;
  // In a row, of one tet: without tools, and with them (jaws may hold a tet inside out).
  int inverted_ticks = 0, inverted_held_ticks = 0;
  // Energy, kinetic and potential, has grown by so much without tools, over what it was at first.
  double growth = 0;
  double drift_m_s = 0;  // of the centre of mass of what nothing holds, without tools
};

struct LawScene {
  std::string name;  // organ, work, speed and seed
  LawFigures figures;
};

inline constexpr int kLawWorks = 5, kLawSpeeds = 6;

// Runs the n-th scene: organs change first, then works, then speeds.
LawScene run_law_scene(int n);

// Says what is broken of "no node is faster, no tet inside out for 100 ticks without tools, energy
// never grows by more than a hundredth, momentum is kept", or nothing.
std::string broken_laws(const LawFigures& figures);

}  // namespace trocar::step::testing

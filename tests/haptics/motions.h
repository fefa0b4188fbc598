#pragma once

// The motions of a hand that every scheme is measured with, and the tissues.

#include <vector>

#include "tests/haptics/closed_loop.h"

namespace trocar::haptics::testing {

// `stiffness_n_m`: of the tissue; the hand goes less deep into stiffer tissue.
Motion press(double stiffness_n_m);
Motion palpation(double stiffness_n_m, double frequency_hz);
Motion taps(double stiffness_n_m);
Motion slide(double stiffness_n_m);  // on a wavy surface, there and back, then a circle
Motion grasp(double stiffness_n_m);  // pulls along all three axes
Motion release(double stiffness_n_m);
Motion topology(double stiffness_n_m);  // the tissue becomes half as stiff, then 0.9
Motion refusal(double stiffness_n_m);
Motion lifted(double stiffness_n_m);  // another hand lifts the tissue
Motion cut();                         // through it, at 0.7 N

// A tissue, and how wrong the client's first guess of its stiffness is at 3 mm.
struct Trial {
  TissueFigures tissue;
  double guess;
};
std::vector<Trial> trials();

tool::ToolShape probe();
// The law that the client has: right relaxation, wrong shape and fast terms, a stiffness that is
// `guess` times the tissue's at 3 mm.
wire::HapticLaw client_law(const TissueFigures& tissue, double guess);

}  // namespace trocar::haptics::testing

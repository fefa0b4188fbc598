#pragma once

// Motions of a hand on an organ in which something happens that the hand's client cannot foresee.
// Surface coordinates as in feel_loop.h.

#include "tests/feel/feel_loop.h"

namespace trocar::haptics::testing {

// A motion of tests/haptics/motions.h: the tool grasps when that says so, else it pushes.
FeltMotion plain(const Motion& motion);

// Another hand has grasped tissue 25 mm aside and moves it by 4 mm up and down, at 1 Hz, while this
// one presses.
FeltMotion lifted_by_another(const step::Simulation& simulation, const Frame& place);
// Another hand has grasped tissue 14 mm aside and, within 0.1 s, lifts it by 8 mm; half a second
// later it brings it back as quickly, and so on, while this one presses.
FeltMotion tugged_by_another(const step::Simulation& simulation, const Frame& place);
// Another hand holds the tissue under the tool. The tool presses it, or closes its jaws, or wants
// to cut.
FeltMotion refused(const Frame& place, tool::Verb verb);
// A press; after 2.5 s the organ becomes what it was when it was marked.
FeltMotion returned_to_mark();
// A press and a palpation; from 2 to 5 s nothing passes the line.
FeltMotion reconnected();
// A palpation; the server simulates at half of real time.
FeltMotion at_half_pace();
// A palpation at 3 Hz; the server does as little as the rate controller lets it.
FeltMotion with_little_time();
// Jaws pull tissue up until it slips out, or tears if the organ's can.
FeltMotion pulled_off();
// The same, half as far again.
FeltMotion torn_off();
// A blade goes in, through 20 mm of tissue, and out.
FeltMotion cut_through();

}  // namespace trocar::haptics::testing

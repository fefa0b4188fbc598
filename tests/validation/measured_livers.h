#pragma once

// The liver of about 4,000 nodes that Dogan 2011 is compared on (4,055 nodes, 9,126 tets there),
// made of table 1.

#include <string>
#include <vector>

#include "server/organs/organ/organ.h"
#include "tests/validation/lab.h"

namespace trocar::validation {

struct MeasuredLiver {
  std::string name;   // in names of files and checks
  std::string title;  // for people
  organ::Organ organ;
};

// Returns the built-in liver; in the short form it is a coarse one.
std::vector<MeasuredLiver> measured_livers(const Lab& lab);

}  // namespace trocar::validation

#pragma once

// The livers of about 4,000 nodes that Dogan 2011 is compared on (4,055 nodes, 9,126 tets there),
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

// The built-in liver, and the imported one if the folder of optional test material has it: else the
// section says that it was left out. Short form: a coarse built-in one alone.
std::vector<MeasuredLiver> measured_livers(const Lab& lab, Section& section);

}  // namespace trocar::validation

#pragma once

// One organ of the bodies of a part file, tied to one another.

#include "server/organs/catalogue/part_file.h"
#include "server/organs/organ/organ.h"

namespace trocar::catalogue {

struct JoinedParts {
  organ::Organ organ;
  std::vector<std::string> notes, warnings;  // one line each
};

// Each part is a region of the organ by its name, and the regions of its source by theirs behind a
// slash. Of each source the largest body stays. Error: one line with the file and the part.
Result<JoinedParts> join_parts(const PartFile& file);

}  // namespace trocar::catalogue

// Stands in for ours_feel.cpp in a build without the client.

#include "tests/validation/experiments.h"

namespace trocar::validation {

void run_feel(const Lab&, Section& section) {
  section.say("LEFT OUT: the client is not built (TROCAR_CLIENT).");
}

}  // namespace trocar::validation

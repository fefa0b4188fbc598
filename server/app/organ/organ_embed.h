#pragma once

// The options --embed and --embed-picture of trocar-organ: a fine surface for an organ.

#include <string>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::app {

struct EmbedCommand {
  std::string file, picture;  // empty: none
  double unit_m = 1;          // of the surface's numbers
};

// Reads the files and gives the organ its fine surface, and says on stderr how it fits. Nothing is
// done without a file.
Status embed_surface(const EmbedCommand& command, organ::Organ& organ);

}  // namespace trocar::app

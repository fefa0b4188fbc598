#pragma once

// The options --embed, --embed-picture, --embed-frame and --embed-unit of trocar-organ: a fine
// surface for an organ.

#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"
#include "server/organs/surface/raw_surface.h"

namespace CLI {
class App;
}

namespace trocar::app {

struct EmbedCommand {
  std::string file, picture;  // empty: none
  // "auto", "file", "ras", "lps" or "organ": in which axes, and around which place, the file is.
  std::string frame = "auto";
  std::string unit;  // of its lengths; empty: what it says, or else that of the organ's file
};

// It tells how the organ's file was read: a fine surface follows that.
struct EmbedPlace {
  std::string file;
  double unit_m = 1;                                 // of the file's numbers
  surface::Axes axes = surface::Axes::Unsaid;        // that it says
  surface::Axes organ_axes = surface::Axes::Unsaid;  // into which it was turned, or the same
};

void add_embed_options(CLI::App& app, EmbedCommand& command);

// Reads the files and gives the organ its fine surface, and says on stderr how it is placed and how
// it fits. Nothing is done without a file. Error: what embed() refuses; the file says axes
// where the organ's does not.
Status embed_surface(const EmbedCommand& command, const EmbedPlace& place, organ::Organ& organ);

}  // namespace trocar::app

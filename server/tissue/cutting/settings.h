#pragma once

// These settings bound what a cut may do to the mesh. Lengths are in h, the local mean edge length
// of the uncut mesh.

#include <cstdint>
#include <memory>

namespace trocar::cutting {

class PatchSplitter;

struct Settings {
  // Makes the method that splits tets; null: splitter.h.
  std::unique_ptr<PatchSplitter> (*make_splitter)() = nullptr;
  double snap = 0.15;        // share of an edge: a crossing nearer to an end labels that end
  double extension_h = 0.3;  // how far the patch goes ahead of the blade and past its ends
  // Sine of 8 degrees. A mesh whose own worst angle is below it gets 0.9 of that instead.
  double floor_sine = 0.13917310096006544;
  // No part of a split edge is shorter; where the mesh has grown, so that it grows no more than a
  // tick has time for, parts are longer.
  double length_floor_h = 0.2, growing_length_floor_h = 0.35, grown_length_floor_h = 0.5;
  // A mesh is growing, and has grown, with so many times the tets that it had uncut. Small organs
  // have room for this many before that.
  double growing = 1.1, grown = 1.3;
  std::uint32_t roomy_tets = 8000;
  // Motion is collected until it is so long, or so many ticks old.
  double collect_h = 0.1;
  std::uint32_t collect_ticks = 8;
  double least_turn_h = 0.05;  // a shorter motion is no turn of the blade
  double piece_h = 0.5;        // longer motion is cut piece by piece
  // A blade that has gone farther at once, or since it was so many pieces ahead of the cutting, has
  // not moved but appeared.
  std::uint32_t most_pieces_of_motion = 16;
  // A part cut off stays with the other side if it has fewer tets, or at most four times as many
  // and less volume (in h^3; a regular tet has 0.12).
  std::uint32_t debris_tets = 4;
  double debris_volume_h3 = 0.25;
  // A piece of less volume is not cut any further.
  double whole_volume_h3 = 0.5;
  // No stroke begins where all that there are have so many pieces still to be cut.
  std::uint32_t most_pieces_planned = 64;
  // Splits, by the tets that they bisect, and labels, all strokes together: so many in a call, and
  // so many in the mean of many calls. Where they are used up, the cutter rests until half of them
  // are there again, because a call that cuts costs whatever it cuts.
  std::uint32_t edits_per_call = 64, edits_in_the_mean = 8;
  // Waiting faces this far from the blade are repaired.
  double repair_h = 1;
  // Labels farther from the blade are forgotten.
  double forget_h = 2;
};

}  // namespace trocar::cutting

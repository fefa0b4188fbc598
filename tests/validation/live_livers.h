#pragma once

// The measured livers with local reductions that the live-reduction experiments share: made when
// the first of them asks.

#include <memory>
#include <string>
#include <vector>

#include "tests/validation/live_sessions.h"
#include "tests/validation/measured_livers.h"

namespace trocar::validation {

// Below this share of a session's largest force the tool has hardly met the tissue.
inline constexpr double kLeastShare = 0.05;

struct LiveLiver {
  MeasuredLiver liver;
  LiveReduction reduction;

  const organ::Organ& organ() const { return liver.organ; }
  const std::string& name() const { return liver.name; }
  const std::string& title() const { return liver.title; }
};

reduce::LocalSettings live_settings(const Lab& lab);
// Describes the training in a sentence for the report.
std::string live_training_text(const Lab& lab);
// Returns the livers of measured_livers() with their reductions, which are made only once.
std::vector<std::shared_ptr<const LiveLiver>> live_livers(const Lab& lab);

// Root of the sum of squares, m.
double norm_of(const LiveField& field);

}  // namespace trocar::validation

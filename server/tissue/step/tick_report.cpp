#include "server/tissue/step/tick_report.h"

namespace trocar::step {

LayerCounts sweeps_of_layers(const TickDecisions& decisions) {
  LayerCounts sweeps{decisions.sweeps};
  for (std::size_t layer = 1; layer < kSweepLayers; ++layer) {
    const auto own = decisions.layer_sweeps[layer - 1];
    sweeps[layer] = own > 0 ? own : sweeps[layer - 1];
  }
  return sweeps;
}

const char* name_of(RateLevel level) {
  switch (level) {
    case RateLevel::Fixed:
      return "fixed";
    case RateLevel::Full:
      return "full";
    case RateLevel::Reduced:
      return "reduced";
    case RateLevel::Overloaded:
      return "overloaded";
  }
  return "?";
}

const char* name_of(Stage stage) {
  switch (stage) {
    case Stage::Admit:
      return "admit";
    case Stage::Contacts:
      return "contacts";
    case Stage::Queue:
      return "queue";
    case Stage::Solve:
      return "solve";
    case Stage::Cut:
      return "cut";
    case Stage::Claims:
      return "claims";
    case Stage::Hash:
      return "hash";
    case Stage::Publish:
      return "publish";
  }
  return "?";
}

}  // namespace trocar::step

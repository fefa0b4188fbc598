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

std::uint32_t faults_of(const TickReport& report) {
  std::uint32_t faults = 0;
  if (report.inputs_dropped > 0) faults |= kFaultInputDropped;
  if (report.contact.is_full) faults |= kFaultContactLimit;
  if (report.contact.has_tool_inside) faults |= kFaultToolInside;
  if (report.solve.is_stepped_down) faults |= kFaultOverRelaxation;
  if (report.solve.nodes_rejected > 0) faults |= kFaultNonFinite;
  if (report.cut.is_full) faults |= kFaultCutLimit;
  return faults;
}

}  // namespace trocar::step

#pragma once

// The whole organ at one time: field_<ms>ms.csv, one row per node, in mm; and field_<ms>ms.vtu, a
// VTK UnstructuredGrid (ASCII XML) at rest with displacement and velocity as point data, in metres,
// as ParaView wants it for "Warp By Vector". Cells are the tets, or the springs of an organ without
// tets. `region` is 0 for the organ's own material and r + 1 for organ.regions[r]: of a cell that
// of its material, of a node the last that lists it; the string array `region_names` has the
// organ's name, then the regions', in that order. Each file appears complete or not at all.

#include <filesystem>

#include "common/base/result.h"
#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {

struct Field {
  const organ::Organ& organ;
  double time_s = 0;
  std::vector<Vec3d> displacements_m, velocities_m_s;  // per node
  std::vector<std::uint8_t> is_held;                   // fixed or displaced
};
Field field_of(const ScenarioRun& run);

Status write_field(const std::filesystem::path& folder, const Field& field);
inline Status write_field(const std::filesystem::path& folder, const ScenarioRun& run) {
  return write_field(folder, field_of(run));
}

}  // namespace trocar::scenario

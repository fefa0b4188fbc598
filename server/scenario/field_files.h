#pragma once

// The whole organ at one time: field_<ms>ms.csv, one row per node, in mm; and field_<ms>ms.vtu, a
// VTK UnstructuredGrid (ASCII XML) at rest with displacement and velocity as point data, in metres,
// as ParaView wants it for "Warp By Vector". Cells are the tets, or the springs of an organ without
// tets. Each file appears complete or not at all.

#include <filesystem>

#include "common/base/result.h"
#include "server/scenario/scenario_run.h"

namespace trocar::scenario {

Status write_field(const std::filesystem::path& folder, const ScenarioRun& run);

}  // namespace trocar::scenario

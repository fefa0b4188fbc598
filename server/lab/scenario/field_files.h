#pragma once

// The whole organ at one time: field_<ms>ms.csv, one row per node, in mm; and field_<ms>ms.vtu, a
// VTK UnstructuredGrid (ASCII XML) at rest with displacement and velocity as point data, in metres,
// as ParaView wants it for "Warp By Vector". Cells are the tets, or the springs of an organ without
// tets. `region` is 0 for the organ's own material and r + 1 for organ.regions[r]: of a cell that
// of its material, of a node the last that lists it; the string array `region_names` has the
// organ's name, then the regions', in that order. Once the organ is cut, cells are the tets there
// are then, and nodes that the cut made follow the organ's own. Each file appears complete or not
// at all.

#include <filesystem>
#include <optional>

#include "common/base/result.h"
#include "server/lab/scenario/scenario_run.h"

namespace trocar::scenario {

// The organ's mesh after cuts has as many nodes as the field, and the tets that are left.
struct CutMesh {
  std::vector<Vec3d> rest_m;  // per node
  std::vector<mesh::Tet> tets;
  std::vector<std::uint16_t> node_regions;  // per node
  std::vector<std::uint16_t> tet_regions;   // per tet
};

struct Field {
  const organ::Organ& organ;
  double time_s = 0;
  std::vector<Vec3d> displacements_m, velocities_m_s;  // per node
  std::vector<std::uint8_t> is_held;                   // fixed or displaced
  std::optional<CutMesh> cut = {};                     // without: the organ's own mesh
};
Field field_of(const step::Simulation& simulation, double time_s);
inline Field field_of(const ScenarioRun& run) {
  return field_of(run.simulation(), run.time_s());
}

Status write_field(const std::filesystem::path& folder, const Field& field);
inline Status write_field(const std::filesystem::path& folder, const ScenarioRun& run) {
  return write_field(folder, field_of(run));
}

}  // namespace trocar::scenario

#include "server/lab/scenario/field_files.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <span>
#include <string>

#include "common/base/unfinished_file.h"

namespace trocar::scenario {
namespace {

constexpr int kVtkLine = 3, kVtkTetra = 10;

template <typename Body>
Status write_file(const std::filesystem::path& path, Body body) {
  UnfinishedFile part(UnfinishedFile::name_for(path));
  std::FILE* file = std::fopen(part.path().c_str(), "wb");
  if (file != nullptr) {
    body(file);
    const bool is_good = std::ferror(file) == 0;
    if (std::fclose(file) == 0 && is_good) return part.rename_to(path);
  }
  return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written (" +
                                               std::strerror(errno) + "), check the folder"};
}

// A mesh as field files hold it: the organ's own, or the one that cuts have left.
struct Mesh {
  std::span<const Vec3d> rest_m;
  std::span<const mesh::Tet> tets;
  std::span<const std::uint16_t> node_regions, cell_regions;
};

void write_csv(std::FILE* file, const Field& field, const Mesh& mesh) {
  std::fputs(
      "node,rest_x_mm,rest_y_mm,rest_z_mm,displacement_x_mm,displacement_y_mm,"
      "displacement_z_mm,velocity_x_mm_s,velocity_y_mm_s,velocity_z_mm_s,held,region\n",
      file);
  for (std::size_t i = 0; i < mesh.rest_m.size(); ++i) {
    const Vec3d p = mesh.rest_m[i] * 1e3;
    const Vec3d u = field.displacements_m[i] * 1e3;
    const Vec3d v = field.velocities_m_s[i] * 1e3;
    std::fprintf(file, "%zu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%u\n", i, p.x, p.y, p.z,
                 u.x, u.y, u.z, v.x, v.y, v.z, field.is_held[i], mesh.node_regions[i]);
  }
}

void write_vectors(std::FILE* file, const char* name, std::span<const Vec3d> vectors) {
  std::fprintf(file,
               "        <DataArray type=\"Float64\" Name=\"%s\" NumberOfComponents=\"3\" "
               "format=\"ascii\">\n",
               name);
  for (const auto& v : vectors) std::fprintf(file, "%.9g %.9g %.9g\n", v.x, v.y, v.z);
  std::fputs("        </DataArray>\n", file);
}

void write_regions(std::FILE* file, std::span<const std::uint16_t> regions) {
  std::fputs("        <DataArray type=\"UInt16\" Name=\"region\" format=\"ascii\">\n", file);
  for (const auto region : regions) std::fprintf(file, "%u\n", region);
  std::fputs("        </DataArray>\n", file);
}

// VTK wants the bytes of a string as numbers, and 0 after each string.
void write_region_names(std::FILE* file, const organ::Organ& organ) {
  std::fprintf(file,
               "    <FieldData>\n"
               "      <DataArray type=\"String\" Name=\"region_names\" NumberOfTuples=\"%zu\" "
               "format=\"ascii\">\n",
               organ.regions.size() + 1);
  const auto write = [file](const std::string& name) {
    for (const char c : name) std::fprintf(file, "%d ", static_cast<unsigned char>(c));
    std::fputs("0\n", file);
  };
  write(organ.name);
  for (const auto& region : organ.regions) write(region.name);
  std::fputs("      </DataArray>\n    </FieldData>\n", file);
}

template <typename Cells>
void write_cells(std::FILE* file, const Cells& cells, int type) {
  std::fputs(
      "      <Cells>\n        <DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n",
      file);
  for (const auto& cell : cells) {
    for (const auto node : cell) std::fprintf(file, "%u ", node.value);
    std::fputc('\n', file);
  }
  std::fputs(
      "        </DataArray>\n        <DataArray type=\"Int64\" Name=\"offsets\" "
      "format=\"ascii\">\n",
      file);
  std::size_t offset = 0;
  for (const auto& cell : cells) std::fprintf(file, "%zu\n", offset += cell.size());
  std::fputs(
      "        </DataArray>\n        <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">\n",
      file);
  for (std::size_t i = 0; i < cells.size(); ++i) std::fprintf(file, "%d\n", type);
  std::fputs("        </DataArray>\n      </Cells>\n", file);
}

void write_vtu(std::FILE* file, const Field& field, const Mesh& mesh) {
  const auto& links = field.organ.mesh.links;
  const std::size_t cell_count = mesh.tets.empty() ? links.size() : mesh.tets.size();
  std::fputs(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n"
      "  <UnstructuredGrid>\n",
      file);
  write_region_names(file, field.organ);
  std::fprintf(file,
               "    <Piece NumberOfPoints=\"%zu\" NumberOfCells=\"%zu\">\n      <PointData>\n",
               mesh.rest_m.size(), cell_count);
  write_vectors(file, "displacement_m", field.displacements_m);
  write_vectors(file, "velocity_m_s", field.velocities_m_s);
  std::fputs("        <DataArray type=\"UInt8\" Name=\"held\" format=\"ascii\">\n", file);
  for (std::size_t i = 0; i < mesh.rest_m.size(); ++i) std::fprintf(file, "%d\n", field.is_held[i]);
  std::fputs("        </DataArray>\n", file);
  write_regions(file, mesh.node_regions);
  std::fputs("      </PointData>\n      <CellData>\n", file);
  write_regions(file, mesh.cell_regions);
  std::fputs("      </CellData>\n      <Points>\n", file);
  write_vectors(file, "rest_m", mesh.rest_m);
  std::fputs("      </Points>\n", file);
  if (mesh.tets.empty())
    write_cells(file, links, kVtkLine);
  else
    write_cells(file, mesh.tets, kVtkTetra);
  std::fputs("    </Piece>\n  </UnstructuredGrid>\n</VTKFile>\n", file);
}

}  // namespace

namespace {

CutMesh cut_mesh_of(const topology::Topology& topology) {
  CutMesh mesh;
  mesh.rest_m.assign(topology.rest().begin(), topology.rest().end());
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    mesh.node_regions.push_back(topology.has_node(NodeIndex(n)) ? topology.material_of(NodeIndex(n))
                                                                : std::uint16_t{0});
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    mesh.tets.push_back(topology.tet(TetIndex(t)));
    mesh.tet_regions.push_back(topology.material_of(TetIndex(t)));
  }
  return mesh;
}

}  // namespace

Field field_of(const step::Simulation& simulation, double time_s) {
  const auto& world = simulation.state().world;
  Field field{simulation.organ(), time_s, {}, {}, {}};
  for (std::size_t i = 0; i < world.node_count(); ++i) {
    field.displacements_m.push_back(to_double(world.displacements[i]));
    field.velocities_m_s.push_back(to_double(world.velocities[i]));
    field.is_held.push_back(world.node_classes[i] == world::NodeClass::Fixed ? 1 : 0);
  }
  const auto& cuts = simulation.state().cuts;
  if (!cuts.history().empty()) field.cut = cut_mesh_of(cuts.topology());
  return field;
}

Status write_field(const std::filesystem::path& folder, const Field& field) {
  char name[40];
  std::snprintf(name, sizeof name, "field_%07lldms", std::llround(field.time_s * 1e3));
  const auto regions = organ::material_map(field.organ);
  const auto& whole = field.organ.mesh;
  const Mesh mesh = field.cut ? Mesh{field.cut->rest_m, field.cut->tets, field.cut->node_regions,
                                     field.cut->tet_regions}
                              : Mesh{whole.rest_positions, whole.tets, regions.nodes,
                                     whole.tets.empty() ? regions.spring_pairs : regions.tets};
  const auto csv = folder / (std::string(name) + ".csv");
  if (auto s = write_file(csv, [&](std::FILE* f) { write_csv(f, field, mesh); }); !s) return s;
  const auto vtu = folder / (std::string(name) + ".vtu");
  return write_file(vtu, [&](std::FILE* f) { write_vtu(f, field, mesh); });
}

}  // namespace trocar::scenario

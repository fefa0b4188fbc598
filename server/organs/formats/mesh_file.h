#pragma once

// One entry for mesh files of other programs: by a file's first bytes, and where they say nothing
// by the end of its name, a reader is chosen.
//
// Tetrahedra: Gmsh (.msh), VTK (.vtk, .vtu), TetGen (.node and .ele), MEDIT (.mesh), Abaqus and
// CalculiX (.inp). Surfaces: STL, OBJ, PLY, glTF in one
// file (.glb), polygonal VTK. A file may have 1 GiB.

#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/formats/vtk_reader.h"

namespace trocar::formats {

// The ends of names that are read, with their point and a comma between them.
inline constexpr const char* kMeshEndings =
    ".msh, .vtk, .vtu, .node, .ele, .mesh, .inp, .stl, .obj, .ply, .glb";
// Those of them that may hold a surface.
inline constexpr const char* kSurfaceEndings = ".stl, .obj, .ply, .glb, .vtk";
bool is_mesh_file(const std::filesystem::path& path);

Result<TetsOrSurface> read_mesh_file(const std::filesystem::path& path);
// The same from memory, but for TetGen's two files. The name's end counts as the path's.
Result<TetsOrSurface> parse_mesh(std::string_view text, const std::string& name);

// A file's bytes. Error: it cannot be read, or has more than 1 GiB.
Result<std::string> read_foreign_file(const std::filesystem::path& path);

}  // namespace trocar::formats

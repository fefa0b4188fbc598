#pragma once

// Meshes of ours in the files of other programs.
//
// Gmsh 2.2 text and VTK XML text hold nodes, tetrahedra, regions and held nodes; numbers are
// written so that reading gives the same double. STL (binary) and GLB hold the surface. Lengths are
// in `unit` and at the source's place (offset added), but for GLB, which is in metres around the
// origin.
//
// Source: as for the readers; Khronos: glTF 2.0 specification, 2021.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

struct WrittenMesh {
  const mesh::TetMesh& mesh;
  std::string name;  // plain text
  Vec3d offset_m;
  mesh::Unit unit = mesh::Unit::Metre;
  std::vector<std::uint16_t> tet_regions;  // one a tet, or empty
  std::vector<std::string> region_names;   // of region 0, 1, ...
  std::vector<NodeIndex> held_nodes;
};

// A surface in m around the organ's centre, per vertex but for the triangles.
struct GlbSurface {
  std::string name;                                     // plain text
  std::vector<Vec3f> positions, normals;                // normals: or none
  std::vector<std::array<float, 2>> texture;            // none, or u and v upward
  std::vector<std::array<std::uint32_t, 3>> triangles;  // outward
  std::string picture;                                  // none, or a PNG or JPEG file
};

std::string to_gmsh(const WrittenMesh& written);
std::string to_vtu(const WrittenMesh& written);
std::string to_stl(const WrittenMesh& written);
std::string to_glb(const WrittenMesh& written);
std::string to_glb(const GlbSurface& surface);

}  // namespace trocar::formats

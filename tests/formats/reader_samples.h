#pragma once

// One tetrahedron and one closed surface in each format, as text that tests change.

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/formats/mesh_file.h"

namespace trocar::formats::testing {

inline const std::string kVtk =
    "# vtk DataFile Version 3.0\none tet\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    "POINTS 4 double\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    "CELLS 2 9\n4 0 1 2 3\n3 0 1 2\nCELL_TYPES 2\n10\n5\n"
    "CELL_DATA 2\nSCALARS region int 1\nLOOKUP_TABLE default\n7\n0\n"
    "FIELD FieldData 1\nother 1 2 double\nnan 1\nPOINT_DATA 4\nVECTORS u float\n"
    "0 0 0 0 0 0 0 0 0 0 0 0\n";

inline const std::string kVtk51 =
    "# vtk DataFile Version 5.1\none tet\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    "POINTS 4 float\n0 0 0 1 0 0 0 1 0\n0 0 1\n"
    "CELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";

inline const std::string kVtu =
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" "
    "byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n"
    "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n"
    "<PointData><DataArray type=\"Float64\" Name=\"u\" format=\"ascii\">1 2 3 4</DataArray>"
    "</PointData>\n"
    "<CellData><DataArray type=\"Int32\" Name=\"region\" "
    "format=\"ascii\">7</DataArray></CellData>\n"
    "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n"
    "0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>\n"
    "<Cells>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2 "
    "3</DataArray>\n"
    "<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray>\n"
    "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray>\n</Cells>\n"
    "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";

inline const std::string kMedit =
    "MeshVersionFormatted 2\n# a comment\nDimension\n3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n"
    "0 0 1 9\nTriangles\n1\n1 2 3 5\nTetrahedra\n1\n1 2 3 4 7\nCorners\n1\n4\nEnd\n";

inline const std::string kAbaqus =
    "*HEADING\n one tet, with, commas\n** a comment\n*NODE, NSET=ALL\n 11, 0., 0., 0.\n"
    "12, 1., 0., 0.\n13, 0., 1., 0.\n14, 0., 0., 1.\n15, 0., 0., -1.\n"
    "*ELEMENT, TYPE=C3D4, ELSET=EBODY\n1, 11, 12, 13, 14\n2, 11, 13, 12, 15\n"
    "*ELSET, ELSET=TUMOUR\n2\n*NSET, NSET=BASE, GENERATE\n11, 13, 1\n"
    "*SOLID SECTION, ELSET=EBODY, MATERIAL=M\n*MATERIAL, NAME=M\n*ELASTIC\n1e3, 0.3\n";

inline const std::string kTetgenNodes =
    "# points\n4 3 1 0\n0 0 0 0 5\n1 1 0 0 5\n2 0 1 0 5\n3 0 0 1 5\n";
inline const std::string kTetgenElements = "1 4 1\n0 0 1 2 3 7\n# by a program\n";

inline const std::string kObj =
    "# a tetrahedron\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\n"
    "f 1//1 3//1 2//1\nf 1 2 4\nf 2/1 3/1/1 4\nf -4 -1 -2\n";

inline const std::string kPly =
    "ply\nformat ascii 1.0\ncomment a tetrahedron\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nelement face 4\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\n"
    "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

inline const std::string kStl =
    "solid a tetrahedron\n"
    "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
    "facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n"
    "facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n"
    "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\n"
    "endsolid a tetrahedron\n";

// `text` with the first `from` replaced by `to`; empty if there is none.
inline std::string changed(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  return at == std::string::npos ? "" : text.replace(at, from.size(), to);
}

inline std::string error_of(std::string_view text, const std::string& name) {
  const auto result = parse_mesh(text, name);
  return result.ok() ? "accepted" : result.error().message;
}

}  // namespace trocar::formats::testing

#pragma once

// A fine surface for an organ, from the triangles of a file (common/wire/fine_surface.h says what
// it is for). It need not be closed: it is drawn, and nothing is computed of it.
//
// The vertices must be near the surface of the organ's mesh, by which clients move them: within
// half of its mean edge. A thin rim that the mesh does not have is left to ride on what is nearest,
// with a warning. Repaired, with a warning: triangles that repeat a corner or have no area are
// dropped, vertices at the same place and with the same place in a picture are welded, those of no
// triangle that is kept are dropped, and a surface that looks inward is turned.

#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"
#include "common/wire/fine_surface.h"
#include "server/organs/mesh/tet_mesh.h"
#include "server/organs/surface/raw_surface.h"

namespace trocar::embed {

// Vertices are so far from the mesh's surface, in its mean edges; the share kMostBeyond of them may
// be beyond the first, and none is beyond the second.
inline constexpr double kMostEdgesAway = 0.5, kMostEdgesBeyond = 2;
inline constexpr double kMostBeyond = 0.05;

struct EmbedOptions {
  double unit_m = 1;  // of the file's numbers
  // Those of the file and of the organ, between which places are turned. Either is unsaid: they are
  // the same.
  surface::Axes axes = surface::Axes::Unsaid, organ_axes = surface::Axes::LeftHeadFront;
  Vec3d offset_m;       // of the organ's origin in the file's frame
  std::string picture;  // a PNG or JPEG file's bytes; empty: none
  // It starts errors of the picture, usually the file's path; empty: the surface's file holds it.
  std::string picture_name;
  std::string name;  // it starts all other errors, usually the file's path
};

struct EmbeddedFine {
  wire::FineSurface surface;
  double farthest_m = 0;              // of a vertex from the mesh's surface
  std::vector<std::string> warnings;  // one line each
};

// `mesh`: the organ's, with its boundary. Error: more than kMostBeyond of the vertices are too far
// away, or one by more than kMostEdgesBeyond, which names the place; limits of wire::FineSurface; a
// picture larger than wire::kMostFinePictureSide, that cannot be unpacked, or for which there are
// no texture coordinates; places in a picture that are wrong; there is nothing to embed.
Result<EmbeddedFine> embed(const surface::RawSurface& raw, const mesh::TetMesh& mesh,
                           const EmbedOptions& options);

// Moves a surface from the mesh's rest pose to another one of its nodes: each vertex as the nearest
// place on the mesh's surface. Nothing if there is no surface.
void carry(const mesh::TetMesh& before, std::span<const Vec3d> now, wire::FineSurface& surface);

}  // namespace trocar::embed

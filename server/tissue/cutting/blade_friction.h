#pragma once

// How firmly tissue holds the sides of a blade: by Material::blade_friction_pa along the part of
// its edge that is in tissue now, or so near to it that tissue lies against the blade. A wound that
// gapes there, and what the blade has gone through, holds nothing.
//
// Cost: of collecting the nodes by the edge (NodeBundles), and a clipped line per tet at these.

#include <vector>

#include "server/tissue/cutting/cut_mesh.h"

namespace trocar::cutting {

class BladeFriction {
 public:
  // Integral of the shear stress over the way from one end of an edge to the other, N/m; of one
  // side. 0 for what is no blade. Between begin() and end() of the mesh.
  double along(CutMesh& mesh, const Vec3d& from, const Vec3d& to);

 private:
  // Part of the edge in a tet: shares of its length.
  struct Part {
    double begin, end;
    TetIndex tet;
  };

  void find_tets(CutMesh& mesh, const Vec3d& from, const Vec3d& to);

  std::vector<NodeIndex> nodes_;
  std::vector<TetIndex> tets_;
  std::vector<Part> parts_;
};

}  // namespace trocar::cutting

#pragma once

// A block of n x n x n cubes, six tets each, for tests that need a plain mesh.

#include "server/organs/mesh/tet_mesh.h"

namespace trocar::testing {

inline mesh::TetMesh block_mesh(int n, double spacing_m) {
  mesh::TetMesh mesh;
  const int m = n + 1;
  for (int k = 0; k < m; ++k)
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < m; ++i)
        mesh.rest_positions.push_back(Vec3d{i - n / 2.0, j - n / 2.0, k - n / 2.0} * spacing_m);
  const int steps[3] = {1, m, m * m};
  // Kuhn's six tets: the corners along each order of the three axes. Odd orders are mirrored.
  const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        for (int o = 0; o < 6; ++o) {
          const int a = i + m * (j + m * k);
          const int b = a + steps[orders[o][0]], c = b + steps[orders[o][1]];
          const int d = c + steps[orders[o][2]];
          if (o < 3)
            mesh.tets.push_back({NodeIndex(a), NodeIndex(b), NodeIndex(c), NodeIndex(d)});
          else
            mesh.tets.push_back({NodeIndex(a), NodeIndex(c), NodeIndex(b), NodeIndex(d)});
        }
  mesh.build_adjacency();
  return mesh;
}

}  // namespace trocar::testing

#pragma once

// Karhunen-Loeve modes of snapshots by the method of snapshots (Dogan 2011 eq. 6 to 10). For
// snapshots Q (numbers x count) the modes are the eigenvectors of C = Q Q^T / count, of the size of
// the mesh (eq. 6). The same eigenvalues has Q^T Q / count, of the size of the count, and a of its
// eigenvectors gives the mode Q a / |Q a| (eq. 8 to 11). O(numbers count^2 + count^3).

#include <Eigen/Core>

namespace trocar::dogan {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

struct KarhunenLoeve {
  Vector eigenvalues;  // all of them, descending, none below 0
  Matrix modes;        // B, numbers x modes, orthonormal
};

// At most `mode_count` modes: no more than the snapshots span, where an eigenvalue below 1e-14 of
// the first counts as none.
KarhunenLoeve karhunen_loeve(const Matrix& snapshots, std::size_t mode_count);

}  // namespace trocar::dogan

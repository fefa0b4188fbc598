#pragma once

// Inertia adds these fields to those of forces that change. A force f of rate w is answered by (K -
// w^2 M)^-1 f = K^-1 f + w^2 K^-1 M K^-1 f + ...: the first term is of Green's functions, these
// fields are of the second, without which an organ rings off the beat where it is struck (Krylov
// vectors, Su and Craig 1991). Vibrations, the organ's slowest, do not reach as far: a contact
// rings at some 40 Hz, the first 36 vibrations of a liver end at 14.

#include <cstddef>

#include "server/lab/reduce/full_model.h"

namespace trocar::reduce {

// Takes displacement fields K^-1 f, a column each, and returns the first `count` Karhunen-Loeve
// modes of K^-1 M of them; fewer if they are of fewer dimensions. The modes are orthonormal, also
// with the columns of `vibrations`, which are so themselves, and have nothing that columns of
// `known` have.
Matrix inertia_modes(FullModel& model, const Matrix& fields, const Matrix& vibrations,
                     const Matrix& known, std::size_t count);

}  // namespace trocar::reduce

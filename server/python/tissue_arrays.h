#pragma once

// The tissue of a simulation as it has been cut, as arrays of numpy. Each call copies what is there
// now. Call with the GIL held, between two ticks.

#include <pybind11/numpy.h>

#include "server/tissue/step/simulation.h"

namespace trocar::python {

// Node numbers of each boundary triangle, outward; uint32 (triangles x 3).
pybind11::array triangles_of(const step::Simulation& simulation);
// Whether a blade made each of these triangles; bool (triangles).
pybind11::array wounds_of(const step::Simulation& simulation);
// Node numbers of each tet; uint32 (tets x 4).
pybind11::array tets_of(const step::Simulation& simulation);
// Rest positions of all nodes, m, world frame; float64 (nodes x 3).
pybind11::array rest_of(const step::Simulation& simulation);
// How many there are of nodes, tets, triangles, wound triangles, free pieces, edits, and ties that
// hold.
pybind11::dict counts_of(const step::Simulation& simulation);

}  // namespace trocar::python

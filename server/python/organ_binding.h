#pragma once

// trocar.Organ: an organ of the catalogue, of a file, or imported. It never changes, so that its
// arrays can be looked at without copies, and sessions share it.

#include <pybind11/pybind11.h>

#include "server/organs/organ/organ.h"

namespace trocar::python {

void bind_organ(pybind11::module_& module);

}  // namespace trocar::python

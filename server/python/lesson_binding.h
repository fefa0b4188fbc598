#pragma once

// Lessons, and lines that are cut, for Python.

#include <pybind11/pybind11.h>

namespace trocar::python {

void bind_lesson(pybind11::module_& module);

}  // namespace trocar::python

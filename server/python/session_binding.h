#pragma once

// trocar.Session: the engine of a session without network and pace. Hands put tools, ticks follow.

#include <pybind11/pybind11.h>

namespace trocar::python {

void bind_session(pybind11::module_& module);

}  // namespace trocar::python

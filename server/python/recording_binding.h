#pragma once

// trocar.Recording: a session or scenario that was recorded (.mcap), read without simulating it.

#include <pybind11/pybind11.h>

namespace trocar::python {

void bind_recording(pybind11::module_& module);

}  // namespace trocar::python

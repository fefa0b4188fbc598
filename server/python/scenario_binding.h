#pragma once

// trocar.Scenario and trocar.ScenarioResult: what trocar-sim runs, with its series as arrays.

#include <pybind11/pybind11.h>

namespace trocar::python {

void bind_scenario(pybind11::module_& module);

}  // namespace trocar::python

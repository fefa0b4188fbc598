// This file begins trocar._engine, out of which the Python module trocar takes everything.

#include <pybind11/pybind11.h>

#include "common/base/log.h"
#include "common/base/version.h"
#include "server/python/errors.h"
#include "server/python/lesson_binding.h"
#include "server/python/organ_binding.h"
#include "server/python/recording_binding.h"
#include "server/python/scenario_binding.h"
#include "server/python/session_binding.h"

PYBIND11_MODULE(_engine, module) {
  // All code is compiled for these; without them Python would end by an illegal instruction.
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") ||
      !__builtin_cpu_supports("bmi2"))
    throw pybind11::import_error("trocar: needs a processor with AVX2, FMA and BMI2");
  module.doc() =
      "Soft tissue that hands push, grasp and cut: organs, lessons, scenarios, sessions and "
      "recordings.\n\n"
      "Lengths are in m, forces in N, masses in kg; a tick is 1 ms. Arrays are read-only.";
  // Classes say that they are of the module that people import.
  const pybind11::object own_name = module.attr("__name__");
  module.attr("__name__") = "trocar";
  module.attr("__version__") = trocar::kVersion;
  trocar::python::bind_errors(module);
  if (const auto set = trocar::log::configure("trocar", "warn"); !set)
    trocar::python::raise(set.error());
  trocar::python::bind_organ(module);
  trocar::python::bind_scenario(module);
  trocar::python::bind_lesson(module);
  trocar::python::bind_session(module);
  trocar::python::bind_recording(module);
  module.attr("__name__") = own_name;
}

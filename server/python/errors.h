#pragma once

// Errors of the project become exceptions of Python with the same one line. trocar.Error: a file,
// a scenario or a recording that cannot be used. ValueError and TypeError: an argument that cannot
// be one, which pybind11 throws for wrong types. Call with the GIL held.

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include "common/base/result.h"

namespace trocar::python {

// Registers trocar.Error; its attribute `code` is the error's kind as a word.
void bind_errors(pybind11::module_& module);

[[noreturn]] void raise(const Error& error);

inline void check(const Status& status) {
  if (!status) raise(status.error());
}
template <typename T>
T value_of(Result<T> result) {
  if (!result) raise(result.error());
  return std::move(*result);
}

}  // namespace trocar::python

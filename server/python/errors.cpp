#include "server/python/errors.h"

namespace trocar::python {
namespace {

namespace py = pybind11;

const char* word_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::Usage:
      return "usage";
    case ErrorCode::BadFile:
      return "bad file";
    case ErrorCode::BadMessage:
      return "bad message";
    case ErrorCode::Refused:
      return "refused";
    case ErrorCode::ResourceMissing:
      return "missing";
    case ErrorCode::Mismatch:
      return "mismatch";
  }
  return "unknown";
}

}  // namespace

void bind_errors(py::module_& module) {
  const auto type = py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(
      "trocar.Error",
      "A file, scenario or recording cannot be used. The text is one line with file, field and "
      "limit; `code` is a word such as \"bad file\".",
      PyExc_RuntimeError, nullptr));
  if (!type) throw py::error_already_set();
  module.attr("Error") = type;
}

void raise(const Error& error) {
  const auto type = py::module_::import("trocar._engine").attr("Error");
  // Messages may quote bytes of a file that are no UTF-8.
  const auto text = py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(
      error.message.data(), static_cast<Py_ssize_t>(error.message.size()), "replace"));
  const auto exception = type(text);
  exception.attr("code") = word_of(error.code);
  PyErr_SetObject(type.ptr(), exception.ptr());
  throw py::error_already_set();
}

}  // namespace trocar::python

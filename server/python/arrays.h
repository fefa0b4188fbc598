#pragma once

// Arrays of the project as read-only arrays of numpy, and back. A view shares memory and keeps its
// owner alive. Call with the GIL held.

#include <pybind11/numpy.h>

#include <memory>
#include <string>
#include <vector>

#include "common/base/index.h"
#include "common/math/frame.h"

namespace trocar::python {

static_assert(sizeof(Vec3f) == 3 * sizeof(float) && sizeof(Vec3d) == 3 * sizeof(double));
static_assert(sizeof(NodeIndex) == sizeof(std::uint32_t));

// Read-only view of `rows` rows of `columns` numbers; a column count of 0 makes it flat.
template <typename T>
pybind11::array view_of(const T* data, std::size_t rows, std::size_t columns,
                        const pybind11::object& owner) {
  std::vector<pybind11::ssize_t> shape{static_cast<pybind11::ssize_t>(rows)};
  if (columns > 0) shape.push_back(static_cast<pybind11::ssize_t>(columns));
  pybind11::array_t<T> array(shape, data, owner);
  array.attr("setflags")(pybind11::arg("write") = false);
  return array;
}

// Read-only array that keeps these numbers, without a copy.
template <typename T>
pybind11::array take_array(std::vector<T> numbers, std::size_t columns) {
  auto kept = std::make_unique<std::vector<T>>(std::move(numbers));
  const T* const data = kept->data();
  const std::size_t rows = columns == 0 ? kept->size() : kept->size() / columns;
  pybind11::capsule owner(kept.get(),
                          [](void* vector) { delete static_cast<std::vector<T>*>(vector); });
  kept.release();
  return view_of(data, rows, columns, owner);
}

// Three finite numbers from any sequence of them. Error (ValueError): names the argument.
Vec3f read_vec3(const pybind11::object& numbers, const std::string& name);
// The same for x, y, z, w of any length but zero; returns them at length 1.
Quatf read_quat(const pybind11::object& numbers, const std::string& name);

}  // namespace trocar::python

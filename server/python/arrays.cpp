#include "server/python/arrays.h"

#include <array>
#include <cmath>

namespace trocar::python {
namespace {

namespace py = pybind11;

constexpr double kMost = 1e3;

template <std::size_t N>
std::array<float, N> read_numbers(const py::object& numbers, const std::string& name) {
  const auto array =
      py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(numbers);
  if (!array) PyErr_Clear();
  if (!array || array.ndim() != 1 || array.shape(0) != static_cast<py::ssize_t>(N))
    throw py::value_error(name + ": needs " + std::to_string(N) + " numbers");
  std::array<float, N> out;
  for (std::size_t i = 0; i < N; ++i) {
    const double number = array.at(static_cast<py::ssize_t>(i));
    if (!(std::abs(number) <= kMost))
      throw py::value_error(name + ": must be finite, and at most 1000 in size");
    out[i] = static_cast<float>(number);
  }
  return out;
}

}  // namespace

Vec3f read_vec3(const py::object& numbers, const std::string& name) {
  const auto v = read_numbers<3>(numbers, name);
  return {v[0], v[1], v[2]};
}

Quatf read_quat(const py::object& numbers, const std::string& name) {
  const auto v = read_numbers<4>(numbers, name);
  const Quatf q{v[0], v[1], v[2], v[3]};
  if (!(norm(q) > 1e-6f)) throw py::value_error(name + ": must not be zero");
  return normalized(q);
}

}  // namespace trocar::python

#include "server/python/organ_binding.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <numeric>
#include <optional>

#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/organ_file.h"
#include "server/python/arrays.h"
#include "server/python/errors.h"

namespace trocar::python {
namespace {

namespace py = pybind11;
using organ::Organ;

constexpr const char* kAbout =
    "An organ: mesh, material and what holds it. It never changes.\n\n"
    "Organ(\"liver\") is a built-in one (liver, elastic-liver, lattice, plate, stomach, chest), "
    "Organ(\"file.organ\") a file, Organ(\"file.toml\") one of parts, and the path of a mesh "
    "imports it in metres; see import_mesh().";

Organ load(const std::string& spec) {
  return value_of([&] {
    const py::gil_scoped_release others_run;
    return catalogue::load_organ(spec);
  }());
}

Organ import_mesh(const std::filesystem::path& path, const std::string& unit,
                  const std::optional<int>& nodes, const std::optional<std::string>& name) {
  catalogue::ImportOptions options;
  options.unit = value_of(mesh::parse_unit(unit));
  options.unit_is_said = true;
  options.nodes = nodes;
  options.name = name;
  auto imported = value_of([&] {
    const py::gil_scoped_release others_run;
    return catalogue::import_organ(path, options);
  }());
  const auto warn = py::module_::import("warnings").attr("warn");
  for (const auto& line : imported.warnings) warn(line);
  return std::move(imported.organ);
}

const Organ& organ_in(const py::object& self) {
  return self.cast<const Organ&>();
}

py::array nodes(const py::object& self) {
  const auto& rest = organ_in(self).mesh.rest_positions;
  return view_of(reinterpret_cast<const double*>(rest.data()), rest.size(), 3, self);
}
py::array tets(const py::object& self) {
  const auto& tets = organ_in(self).mesh.tets;
  return view_of(reinterpret_cast<const std::uint32_t*>(tets.data()), tets.size(), 4, self);
}
py::array surface(const py::object& self) {
  const auto& triangles = organ_in(self).mesh.boundary_triangles;
  return view_of(reinterpret_cast<const std::uint32_t*>(triangles.data()), triangles.size(), 3,
                 self);
}
py::array fixed_nodes(const py::object& self) {
  const auto& fixed = organ_in(self).fixed_nodes;
  return view_of(reinterpret_cast<const std::uint32_t*>(fixed.data()), fixed.size(), 0, self);
}
py::array masses(const py::object& self) {
  const auto& masses = organ_in(self).node_masses_kg;
  return view_of(masses.data(), masses.size(), 0, self);
}

py::dict regions(const Organ& organ) {
  py::dict out;
  for (const auto& region : organ.regions) {
    std::vector<std::uint32_t> numbers;
    for (const auto node : region.nodes) numbers.push_back(node.value);
    out[py::str(region.name)] = take_array(std::move(numbers), 0);
  }
  return out;
}

py::dict ties(const Organ& organ) {
  py::dict out;
  for (const auto& band : organ.ties) {
    std::vector<double> places;
    for (const auto& tie : band.ties)
      for (const auto& end : tie.ends) {
        const Vec3d place = organ::place_of(end, organ.mesh, organ.mesh.rest_positions);
        places.insert(places.end(), {place.x, place.y, place.z});
      }
    out[py::str(band.name)] =
        take_array(std::move(places), 3).attr("reshape")(band.ties.size(), 2, 3);
  }
  return out;
}

double total_mass(const Organ& organ) {
  return std::accumulate(organ.node_masses_kg.begin(), organ.node_masses_kg.end(), 0.0);
}

std::string description(const Organ& organ) {
  return "<trocar.Organ " + organ.name + ", " + std::to_string(organ.mesh.node_count()) +
         " nodes, " + std::to_string(organ.mesh.tets.size()) + " tets>";
}

}  // namespace

void bind_organ(py::module_& module) {
  py::class_<Organ>(module, "Organ", kAbout)
      .def(py::init(&load), py::arg("spec"), kAbout)
      .def_static("import_mesh", &import_mesh, py::arg("path"), py::kw_only(),
                  py::arg("unit") = "m", py::arg("nodes") = py::none(),
                  py::arg("name") = py::none(),
                  "Imports a mesh, a surface or a label map, whose lengths are in `unit` (m, cm or "
                  "mm). A surface or a label map is filled with about `nodes` nodes. What was "
                  "repaired comes as warnings. Raises Error.")
      .def(
          "save",
          [](const Organ& organ, const std::filesystem::path& path) {
            check(organ::write_organ(path, organ));
          },
          py::arg("path"), "Writes an .organ file; it is whole or not there. Raises Error.")
      .def_readonly("name", &Organ::name, "Name of the organ, or its file's without its end.")
      .def_readonly("source", &Organ::source, "One line: where it comes from.")
      .def_property_readonly("nodes", &nodes,
                             "Rest positions, m, world frame; float64 (nodes x 3), read-only view.")
      .def_property_readonly("tets", &tets,
                             "Node numbers of each tet; uint32 (tets x 4), read-only view.")
      .def_property_readonly("surface", &surface,
                             "Node numbers of each boundary triangle, counterclockwise from "
                             "outside; uint32 (triangles x 3), read-only view.")
      .def_property_readonly("fixed_nodes", &fixed_nodes,
                             "Nodes that are held, ascending; uint32, read-only view.")
      .def_property_readonly("regions", &regions,
                             "Node numbers of each part or region by its name, ascending; uint32.")
      .def_property_readonly("ties", &ties,
                             "Places that ties hold to one another at rest, m, by the name of "
                             "their table; float64 (ties x 2 x 3).")
      .def_property_readonly("node_masses", &masses, "kg per node; float64, read-only view.")
      .def_property_readonly(
          "volume", [](const Organ& organ) { return total_volume(organ.mesh); },
          "Volume of its tets at rest, m^3.")
      .def_property_readonly("mass", &total_mass, "Mass of all nodes, kg.")
      .def_property_readonly("hash", &organ::organ_hash,
                             "XXH3-64 over all that makes a difference to a result.")
      .def("__repr__", &description);
}

}  // namespace trocar::python
